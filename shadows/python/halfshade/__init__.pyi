from typing import Any, Callable, Mapping, NamedTuple, Optional, Sequence, Union, overload

import numpy as np
import numpy.typing as npt

__version__: str
NONE: int
"""No such number: a receiver without a triangle of its own, a pixel without a triangle."""

_Progress = Optional[Callable[[float], Any]]
"""Called with the share done, 0..1, now and then; a false result raises CancelledError."""
_Wanted = Union[bool, npt.NDArray[Any]]
"""False: not wanted. True: a new array. An array: that one, C-contiguous, of the right shape and type."""
_Lights = Union[Light, Sequence[Light]]
_Floats = npt.NDArray[np.float32]
_Masks = npt.NDArray[np.uint64]

class Error(RuntimeError): ...
class UsageError(Error, ValueError): ...
class BadInputError(Error, ValueError): ...
class LimitError(Error): ...
class OutputError(Error): ...
class CancelledError(Error): ...

class Light:
    """World space; u and v are full edge vectors; flat lights face u x v or `normal`, unless two_sided."""

    @staticmethod
    def point(center: npt.ArrayLike, *, emission: npt.ArrayLike = ...) -> Light: ...
    @staticmethod
    def rectangle(
        center: npt.ArrayLike,
        u: npt.ArrayLike,
        v: npt.ArrayLike,
        *,
        two_sided: bool = ...,
        emission: npt.ArrayLike = ...,
        emission_image: Optional[npt.ArrayLike] = ...,
    ) -> Light: ...
    @staticmethod
    def disk(
        center: npt.ArrayLike,
        normal: npt.ArrayLike,
        radius: float,
        *,
        two_sided: bool = ...,
        emission: npt.ArrayLike = ...,
    ) -> Light: ...
    @staticmethod
    def sphere(center: npt.ArrayLike, radius: float, *, emission: npt.ArrayLike = ...) -> Light: ...
    @staticmethod
    def ellipsoid(center: npt.ArrayLike, axes: Sequence[npt.ArrayLike], *, emission: npt.ArrayLike = ...) -> Light: ...
    @staticmethod
    def polygon(points: npt.ArrayLike, *, two_sided: bool = ..., emission: npt.ArrayLike = ...) -> Light: ...
    @staticmethod
    def sun(
        direction: npt.ArrayLike,
        low: npt.ArrayLike,
        high: npt.ArrayLike,
        *,
        angular_diameter_deg: float = ...,
        emission: npt.ArrayLike = ...,
    ) -> Light:
        """The sun of a scene between two corners, as a disk far away; `direction` is the way its light travels."""
    @staticmethod
    def samples(points: npt.ArrayLike, *, emission: npt.ArrayLike = ...) -> Light: ...

class GBuffer:
    """What a camera sees, [height, width], row 0 = top. The arrays are read-only views of its memory."""

    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def triangle(self) -> npt.NDArray[np.uint32]: ...
    @property
    def position(self) -> npt.NDArray[np.float64]:
        """In the scene's local frame: see Scene.to_world."""
    @property
    def geometric_normal(self) -> _Floats: ...
    @property
    def shading_normal(self) -> _Floats: ...
    @property
    def albedo(self) -> _Floats: ...
    @property
    def depth(self) -> _Floats: ...

class Scene:
    """Meshes in world space. Changes are done together by commit(). A change while another thread solves raises."""

    def __init__(self, *, rebuild_cost: float = ..., back_face_casters: bool = ...) -> None: ...
    def add_alpha_map(self, alpha: npt.NDArray[np.uint8]) -> int: ...
    def add_mesh(
        self,
        positions: npt.ArrayLike,
        triangles: Optional[npt.ArrayLike] = ...,
        *,
        transform: Optional[npt.ArrayLike] = ...,
        uvs: Optional[npt.ArrayLike] = ...,
        alpha_map: Optional[int] = ...,
        alpha_cutoff: float = ...,
        albedo: npt.ArrayLike = ...,
    ) -> int:
        """Copies the mesh; returns its number."""
    def remove_mesh(self, mesh: int) -> None: ...
    def set_positions(self, mesh: int, positions: npt.ArrayLike) -> None: ...
    def set_transform(self, mesh: int, transform: npt.ArrayLike) -> None: ...
    @overload
    def extend(self, light: Light) -> None: ...
    @overload
    def extend(self, points: npt.ArrayLike) -> None: ...
    def commit(self, *, progress: _Progress = ..., serial: bool = ...) -> None: ...
    def rasterize(
        self,
        width: int,
        height: int,
        *,
        eye: npt.ArrayLike,
        target: npt.ArrayLike = ...,
        up: npt.ArrayLike = ...,
        fov_y_deg: float = ...,
        progress: _Progress = ...,
        serial: bool = ...,
    ) -> GBuffer: ...
    def to_world(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Points in the local frame of the last commit, [..., 3], as GBuffer.position has them, to world space."""
    def triangle_of(self, number: int) -> tuple[int, int]:
        """(mesh, triangle) of a number in a G-buffer."""
    @property
    def committed(self) -> bool: ...
    @property
    def reach(self) -> npt.NDArray[np.float64]:
        """Lowest and highest corner of the box that receivers and lights may be in."""
    @property
    def stats(self) -> dict[str, float]: ...

class Workspace:
    """Scratch memory, and what can be kept from call to call, of one call at a time."""

    def __init__(self, kept_lights: int = ...) -> None: ...
    def clear(self) -> None: ...
    @property
    def bytes(self) -> int: ...
    @property
    def stats(self) -> dict[str, float]: ...

class Result(NamedTuple):
    masks: Optional[_Masks]
    visibility: Optional[_Floats]
    irradiance: Optional[_Floats]
    total_irradiance: Optional[_Floats]

class Solver:
    """A configuration: method, light samples, seed. Immutable; threads may share it."""

    def __init__(
        self,
        *,
        method: str = ...,
        light_sample_count: int = ...,
        pattern: str = ...,
        sample_sets: int = ...,
        seed: int = ...,
        frame: int = ...,
        interleave: bool = ...,
        rotate_sets: bool = ...,
        options: Mapping[str, Any] = ...,
    ) -> None: ...
    def sample_count(self, light: Light) -> int: ...
    def mask_words(self, lights: _Lights) -> int: ...
    def solve(
        self,
        scene: Scene,
        receivers: Union[npt.ArrayLike, GBuffer],
        lights: _Lights,
        *,
        masks: _Wanted = ...,
        visibility: _Wanted = ...,
        irradiance: _Wanted = ...,
        total_irradiance: _Wanted = ...,
        normals: Optional[npt.ArrayLike] = ...,
        meshes: Optional[npt.ArrayLike] = ...,
        triangles: Optional[npt.ArrayLike] = ...,
        lift: Optional[float] = ...,
        first: int = ...,
        frame: Optional[int] = ...,
        workspace: Optional[Workspace] = ...,
        progress: _Progress = ...,
        serial: bool = ...,
    ) -> Result:
        """Shapes: masks [light, receiver, word] uint64, bit i of word i // 64 set where sample i is hidden (or uint8
        bytes); visibility [light, receiver] float32; irradiance [light, receiver, 3]; total_irradiance [receiver, 3].
        [light] is left out for a single Light; [receiver] is [height, width] for a G-buffer. `lift` is the distance by
        which receivers with normals are lifted off their surface, in half-widths of the local frame; None: as far as
        rounding asks for."""
    def masks(
        self,
        scene: Scene,
        receivers: Union[npt.ArrayLike, GBuffer],
        lights: _Lights,
        *,
        out: Optional[npt.NDArray[Any]] = ...,
        **keywords: Any,
    ) -> _Masks: ...
    def visibility(
        self,
        scene: Scene,
        receivers: Union[npt.ArrayLike, GBuffer],
        lights: _Lights,
        *,
        out: Optional[_Floats] = ...,
        **keywords: Any,
    ) -> _Floats: ...
    def irradiance(
        self,
        scene: Scene,
        receivers: Union[npt.ArrayLike, GBuffer],
        lights: _Lights,
        *,
        out: Optional[_Floats] = ...,
        **keywords: Any,
    ) -> _Floats: ...

def unpack_masks(masks: npt.NDArray[np.uint64], sample_count: int) -> npt.NDArray[np.bool_]:
    """Booleans: the last axis becomes light samples, True where a sample is hidden."""
