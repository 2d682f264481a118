"""Exact soft shadows from area lights, on NumPy arrays.

For every receiver and every sample of a light one bit: is a triangle in between? The bits are those of exact
arithmetic, the same for any number of threads and any instruction set.

    scene = halfshade.Scene()
    scene.add_mesh(positions, triangles)        # (n, 3) float32 or float64, (m, 3) uint32
    scene.commit()
    light = halfshade.Light.rectangle(center, u, v)
    solver = halfshade.Solver(light_sample_count=256)
    visibility = solver.visibility(scene, receivers, light)

Arrays are read and written where they are, and copied only where the library cannot read them as they are. Calls
release the interpreter's lock; Ctrl-C stops them. What the calls mean in detail is said in the C++ headers
halfshade/shadow_scene.h and halfshade/shadow_solver.h.
"""

import threading
from typing import NamedTuple, Optional

import numpy as np

from . import _halfshade
from ._halfshade import (
    NONE,
    BadInputError,
    CancelledError,
    Error,
    GBuffer,
    Light,
    LimitError,
    OutputError,
    Scene,
    UsageError,
    Workspace,
    __version__,
)

__all__ = [
    "NONE",
    "BadInputError",
    "CancelledError",
    "Error",
    "GBuffer",
    "Light",
    "LimitError",
    "OutputError",
    "Result",
    "Scene",
    "Solver",
    "UsageError",
    "Workspace",
    "unpack_masks",
]


class Result(NamedTuple):
    """What Solver.solve was asked for; None where it was not."""

    masks: Optional[np.ndarray]
    visibility: Optional[np.ndarray]
    irradiance: Optional[np.ndarray]
    total_irradiance: Optional[np.ndarray]


class Solver(_halfshade.BaseSolver):
    """A configuration: method, light samples, seed. Immutable; threads may share it."""

    def __init__(self, **config):
        super().__init__(**config)
        self._workspace = Workspace()
        self._workspace_free = threading.Lock()

    def solve(
        self,
        scene,
        receivers,
        lights,
        *,
        masks=False,
        visibility=False,
        irradiance=False,
        total_irradiance=False,
        normals=None,
        meshes=None,
        triangles=None,
        lift=None,
        first=0,
        frame=None,
        workspace=None,
        progress=None,
        serial=False,
    ):
        """Each of masks, visibility, irradiance and total_irradiance is False, True, or the array to write into.

        Without a workspace the solver's own is used, or a new one while another thread uses that.
        """

        def run(chosen):
            results = self.solve_into(
                scene,
                receivers,
                lights,
                chosen,
                masks,
                visibility,
                irradiance,
                total_irradiance,
                normals,
                meshes,
                triangles,
                lift,
                first,
                frame,
                progress,
                serial,
            )
            return Result(**results)

        if workspace is not None:
            return run(workspace)
        if not self._workspace_free.acquire(blocking=False):
            return run(Workspace())
        try:
            return run(self._workspace)
        finally:
            self._workspace_free.release()

    def masks(self, scene, receivers, lights, *, out=None, **keywords):
        """Blocked masks alone, see solve; into `out` where given."""
        return self.solve(scene, receivers, lights, masks=True if out is None else out, **keywords).masks

    def visibility(self, scene, receivers, lights, *, out=None, **keywords):
        """Visible fractions alone, see solve; into `out` where given."""
        return self.solve(scene, receivers, lights, visibility=True if out is None else out, **keywords).visibility

    def irradiance(self, scene, receivers, lights, *, out=None, **keywords):
        """Irradiance alone, see solve; into `out` where given."""
        return self.solve(scene, receivers, lights, irradiance=True if out is None else out, **keywords).irradiance


def unpack_masks(masks, sample_count):
    """Masks as booleans: the last axis becomes light samples, True where a sample is hidden."""
    as_bytes = np.ascontiguousarray(masks).view(np.uint8)
    if not 0 <= sample_count <= 8 * as_bytes.shape[-1]:
        raise UsageError(f"sample_count: {sample_count}, but the masks have {8 * as_bytes.shape[-1]} bits")
    return np.unpackbits(as_bytes, axis=-1, count=sample_count, bitorder="little").view(bool)
