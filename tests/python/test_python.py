"""The Python module: values, memory, errors, threads and Ctrl-C. Run with PYTHONPATH at the module."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import unittest

import numpy as np

import halfshade as hs

HALF_PLANE = np.array([(-64, 2, -64), (0, 2, -64), (0, 2, 64), (-64, 2, 64)], np.float32)
TRIANGLES = np.array([(0, 1, 2), (0, 2, 3)], np.uint32)
RECEIVERS = np.array([(-32, 0, 0), (0, 0, 0), (32, 0, 0)], np.float64)


def square(**keywords):
    return hs.Light.rectangle((0, 4, 0), (2, 0, 0), (0, 0, 2), **keywords)


def half_plane_scene(positions=HALF_PLANE, triangles=TRIANGLES):
    scene = hs.Scene()
    scene.add_mesh(positions, triangles)
    scene.commit()
    return scene


def slow_scene():
    """Enough work for the oracle to be stopped in the middle."""
    random = np.random.default_rng(1)
    centers = random.uniform(-1, 1, (2000, 1, 3)) + (0, 1.5, 0)
    scene = hs.Scene()
    scene.add_mesh((centers + random.uniform(-0.05, 0.05, (2000, 3, 3))).reshape(-1, 3))
    scene.extend(square())
    scene.commit()
    return scene, random.uniform(-1, 1, (200000, 3)) * (1, 0.01, 1)


def memory_of(array):
    return array.__array_interface__["data"][0]


class Values(unittest.TestCase):
    def setUp(self):
        self.scene = half_plane_scene()
        self.solver = hs.Solver(pattern="uniform")

    def test_half_of_the_light_is_hidden(self):
        result = self.solver.solve(self.scene, RECEIVERS, square(), masks=True, visibility=True)
        self.assertEqual(result.visibility.tolist(), [0.0, 0.5, 1.0])
        self.assertEqual(result.masks.shape, (3, 4))
        self.assertIsNone(result.irradiance)
        hidden = hs.unpack_masks(result.masks, 256)
        self.assertEqual(hidden.shape, (3, 256))
        self.assertEqual(hidden.sum(axis=1).tolist(), [256, 128, 0])
        np.testing.assert_array_equal(hs.unpack_masks(result.masks.view(np.uint8), 256), hidden)
        for wrong in (-1, 257):  # NumPy would cut off or make up samples
            with self.assertRaisesRegex(hs.UsageError, "256 bits"):
                hs.unpack_masks(result.masks, wrong)

    def test_several_lights(self):
        lights = [square(), hs.Light.point((40, 4, 0)), hs.Light.sphere((-24, 4, 0), 0.5)]
        visibility = self.solver.visibility(self.scene, RECEIVERS, lights)
        self.assertEqual(visibility.shape, (3, 3))
        self.assertEqual(visibility[1].tolist(), [1.0, 1.0, 1.0])
        self.assertEqual(visibility[2].tolist(), [0.0, 0.0, 1.0])

    def test_methods_agree(self):
        expected = self.solver.masks(self.scene, RECEIVERS, square())
        for method, options in (("afsm", {"afsm.fit": False}), ("hpc", {"hpc.leaf": 4}), ("oracle", {})):
            solver = hs.Solver(pattern="uniform", method=method, options=options)
            np.testing.assert_array_equal(solver.masks(self.scene, RECEIVERS, square()), expected)
        np.testing.assert_array_equal(self.solver.masks(self.scene, RECEIVERS, square(), serial=True), expected)

    def test_all_lights(self):
        corners = [(-1, 4, -1), (1, 4, -1), (1, 4, 1), (-1, 4, 1)]
        for light in (
            hs.Light.disk((0, 4, 0), (0, -1, 0), 1),
            hs.Light.ellipsoid((0, 4, 0), ((1, 0, 0), (0, 0.5, 0), (0, 0, 1))),
            hs.Light.polygon(corners),
            hs.Light.samples(corners),
            square(emission_image=np.ones((2, 2, 3))),
        ):
            visibility = self.solver.visibility(self.scene, RECEIVERS, light)
            self.assertEqual((visibility[0], visibility[2]), (0.0, 1.0))
            self.assertAlmostEqual(float(visibility[1]), 0.5, delta=0.1)

    def test_the_sun(self):
        sun = hs.Light.sun((0, -1, 0), (-64, 0, -64), (64, 2, 64), angular_diameter_deg=2)
        self.scene.extend(sun)
        self.scene.commit()
        visibility = self.solver.visibility(self.scene, RECEIVERS, sun)
        self.assertEqual((visibility[0], visibility[2]), (0.0, 1.0))
        self.assertAlmostEqual(float(visibility[1]), 0.5, delta=0.05)
        with self.assertRaisesRegex(hs.BadInputError, "60"):
            hs.Light.sun((0, -1, 0), (0, 0, 0), (1, 1, 1), angular_diameter_deg=61)

    def test_lift(self):
        # On the plate's underside with its normal: only what lifts through the plate sees the light.
        below, normal = np.array([(-32, 1.999, 0)]), np.array([(0, 1, 0)])
        lifts = (None, 0, 1e-3)  # of 128
        seen = [self.solver.visibility(self.scene, below, square(), normals=normal, lift=lift)[0] for lift in lifts]
        self.assertEqual(seen[:2], [0.0, 0.0])
        self.assertGreater(seen[2], 0.0)
        with self.assertRaisesRegex(hs.UsageError, "lift"):
            self.solver.visibility(self.scene, below, square(), normals=normal, lift=-0.5)

    def test_irradiance(self):
        normals = np.tile(np.float32([0, 1, 0]), (3, 1))
        result = self.solver.solve(
            self.scene, RECEIVERS, [square(), square(emission=(0, 1, 0))], normals=normals, irradiance=True,
            total_irradiance=True,
        )
        self.assertEqual(result.irradiance.shape, (2, 3, 3))
        np.testing.assert_allclose(result.total_irradiance, result.irradiance.sum(axis=0), rtol=1e-6)
        # Half of a 2 x 2 square at distance 4, seen straight on: less than area / 2 / distance^2.
        self.assertTrue(0.1 < result.irradiance[0, 1, 0] < 0.125)

    def test_alpha_maps(self):
        scene = hs.Scene()
        alpha = np.zeros((2, 4), np.uint8)[:, ::2]
        alpha[:, 1] = 255
        number = scene.add_alpha_map(alpha)
        uvs = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
        plate = np.array([(-1, 2, -1), (1, 2, -1), (1, 2, 1), (-1, 2, 1)], np.float32)
        scene.add_mesh(plate, TRIANGLES, uvs=uvs, alpha_map=number)
        scene.extend(square())
        scene.extend(np.array([(-1, 0, 0), (1, 0, 0)], float))
        scene.commit()
        visibility = hs.Solver().visibility(scene, np.array([(-0.5, 1.99, 0), (0.5, 1.99, 0)]), square())
        self.assertEqual(visibility.tolist(), [1.0, 0.0])

    def test_own_triangles_do_not_block(self):
        # On the plate itself, rounded to either side: its own triangle is left out.
        on_plate = np.array([(-1 / 3, 2, 0.1)])
        masks = self.solver.masks(self.scene, on_plate, square(), meshes=[0], triangles=[1])
        self.assertFalse(masks.any())

    def test_scene_changes(self):
        self.scene.set_transform(0, [[1, 0, 0, -8], [0, 1, 0, 0], [0, 0, 1, 0]])
        self.assertFalse(self.scene.committed)
        with self.assertRaises(hs.UsageError):
            self.solver.visibility(self.scene, RECEIVERS, square())
        self.scene.commit()
        self.assertEqual(self.solver.visibility(self.scene, RECEIVERS, square()).tolist(), [0.0, 1.0, 1.0])
        self.assertEqual(self.scene.stats["meshes"], 1)
        self.assertEqual(self.scene.reach.shape, (2, 3))
        self.scene.remove_mesh(0)
        self.scene.extend(square())
        self.scene.extend(RECEIVERS)
        self.scene.commit()
        self.assertTrue((self.solver.visibility(self.scene, RECEIVERS, square()) == 1).all())

    def test_gbuffer(self):
        self.scene.add_mesh(HALF_PLANE * (1, 0, 1) - (0, 1, 0), TRIANGLES, albedo=(0.1, 0.2, 0.3))
        self.scene.commit()
        gbuffer = self.scene.rasterize(32, 16, eye=(-8, 1, 12), target=(-8, 0, 0))
        self.assertEqual(gbuffer.triangle.shape, (16, 32))
        self.assertEqual(gbuffer.position.shape, (16, 32, 3))
        self.assertFalse(gbuffer.depth.flags.writeable)
        self.assertEqual(memory_of(gbuffer.albedo), memory_of(gbuffer.albedo))
        mesh, triangle = self.scene.triangle_of(int(gbuffer.triangle[15, 16]))
        self.assertEqual(mesh, 1)
        self.assertIn(triangle, (0, 1))
        np.testing.assert_allclose(gbuffer.albedo[15, 16], (0.1, 0.2, 0.3), rtol=1e-6)
        result = self.solver.solve(self.scene, gbuffer, [square()], visibility=True)
        self.assertEqual(result.visibility.shape, (1, 16, 32))
        world = self.scene.to_world(gbuffer.position)
        self.assertEqual(world.shape, (16, 32, 3))
        shown = gbuffer.triangle != hs.NONE
        meshes, triangles = np.array([self.scene.triangle_of(int(t)) for t in gbuffer.triangle[shown]]).T
        single = self.solver.visibility(
            self.scene,
            world[shown],
            square(),
            normals=gbuffer.geometric_normal[shown],
            meshes=meshes,
            triangles=triangles,
        )
        np.testing.assert_array_equal(single, result.visibility[0][shown])
        self.assertLess(single.min(), single.max())
        for wrong in ({"lift": 0.5}, {"first": 1}, {"normals": world}):
            with self.assertRaisesRegex(hs.UsageError, "go with points"):
                self.solver.visibility(self.scene, gbuffer, square(), **wrong)
        # A moved light needs no new picture, a moved mesh does.
        self.solver.visibility(self.scene, gbuffer, hs.Light.point((1, 4, 0)))
        self.scene.set_transform(0, [[1, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 0]])
        self.scene.commit()
        with self.assertRaisesRegex(hs.UsageError, "older than a commit"):
            self.solver.visibility(self.scene, gbuffer, square())
        with self.assertRaisesRegex(hs.UsageError, "another scene"):
            self.solver.visibility(half_plane_scene(), gbuffer, square())
        self.assertEqual(self.scene.to_world((0, 0, 0)).shape, (3,))
        for wrong in (1.0, [(1, 2)], "points"):
            with self.assertRaisesRegex(hs.UsageError, "points"):
                self.scene.to_world(wrong)
        kept = gbuffer.depth
        del gbuffer
        self.assertTrue(np.isfinite(kept).all())


    def test_emission_that_is_no_light_is_refused(self):
        image = np.ones((2, 2, 3))
        image[1, 0, 2] = np.nan
        for wrong in (square(emission=(np.nan, 1, 1)), square(emission=(1, -1, 1)), square(emission_image=image)):
            for _ in range(2):  # of a light whose samples are kept as well
                with self.assertRaisesRegex(hs.BadInputError, "negative or not finite"):
                    self.solver.irradiance(self.scene, RECEIVERS, wrong, normals=np.tile((0.0, 1.0, 0.0), (3, 1)))

    def test_classes_say_what_they_are(self):
        for what in (hs.Light, hs.Scene, hs.GBuffer, hs.Workspace, hs.Solver, hs.Result, hs.Error, hs.UsageError):
            self.assertTrue(what.__doc__, what)


class Memory(unittest.TestCase):
    def setUp(self):
        self.scene = half_plane_scene()
        self.solver = hs.Solver(pattern="uniform")

    def test_results_go_where_they_are_wanted(self):
        visibility = np.full(3, -1, np.float32)
        words = np.full((3, 4), 7, np.uint64)
        result = self.solver.solve(self.scene, RECEIVERS, square(), visibility=visibility, masks=words)
        self.assertIs(result.visibility, visibility)
        self.assertIs(result.masks, words)
        self.assertEqual(visibility.tolist(), [0.0, 0.5, 1.0])
        as_bytes = np.empty((3, 32), np.uint8)
        self.assertIs(self.solver.masks(self.scene, RECEIVERS, square(), out=as_bytes), as_bytes)
        np.testing.assert_array_equal(as_bytes, words.view(np.uint8))

    def test_wrong_memory_is_refused_and_left_alone(self):
        for wrong in (
            np.full(4, 7, np.float32),
            np.full(3, 7, np.float64),
            np.full(6, 7, np.float32)[::2],
            np.full((3, 1), 7, np.float32),
        ):
            with self.assertRaises(hs.UsageError):
                self.solver.visibility(self.scene, RECEIVERS, square(), out=wrong)
            self.assertTrue((wrong == 7).all())
        read_only = np.zeros(3, np.float32)
        read_only.flags.writeable = False
        with self.assertRaisesRegex(hs.UsageError, "read-only"):
            self.solver.visibility(self.scene, RECEIVERS, square(), out=read_only)

    def test_arrays_are_read_as_they_are(self):
        expected = [0.0, 0.5, 1.0]
        wide = np.zeros((3, 8), np.float32)
        wide[:, 2:5] = RECEIVERS
        record = np.zeros(3, [("tag", "u1"), ("p", "f8", 3)])  # unaligned
        record["p"] = RECEIVERS
        for receivers in (
            RECEIVERS,
            RECEIVERS.astype(np.float32),
            wide[:, 2:5],
            record["p"],
            np.repeat(RECEIVERS, 2, axis=0)[::2],
            RECEIVERS[::-1][::-1],
            np.asfortranarray(RECEIVERS),
            RECEIVERS.astype(int),
            RECEIVERS.astype(">f8"),
            RECEIVERS.tolist(),
        ):
            self.assertEqual(self.solver.visibility(self.scene, receivers, square()).tolist(), expected)
        backwards = self.solver.visibility(self.scene, RECEIVERS[::-1], square())
        self.assertEqual(backwards.tolist(), expected[::-1])
        repeated = self.solver.visibility(self.scene, np.broadcast_to(RECEIVERS[1], (5, 3)), square())
        self.assertEqual(repeated.tolist(), [0.5] * 5)
        for triangles in (TRIANGLES.astype(np.int64), TRIANGLES.astype(np.int32), TRIANGLES.tolist()):
            scene = half_plane_scene(triangles=triangles)
            self.assertEqual(self.solver.visibility(scene, RECEIVERS, square()).tolist(), expected)

    def test_no_copy_is_made(self):
        # Reversed arrays are copied, others are not: with 48 MB of receivers the peaks of memory tell.
        program = """if True:
            import resource, sys
            import numpy as np
            import halfshade as hs
            scene = hs.Scene()
            scene.add_mesh(np.float32([(-1, 2, -1), (1, 2, -1), (1, 2, 1)]))
            scene.commit()
            receivers = np.full((2_000_000, 3), np.nan)[:: int(sys.argv[1])]
            try:
                hs.Solver().visibility(scene, receivers, hs.Light.point((0, 4, 0)), serial=True)
            except hs.BadInputError:
                print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024)
            """

        def peak(step):
            command = [sys.executable, "-c", program, str(step)]
            return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)

        self.assertGreater(peak(-1) - peak(1), 40)

    def test_empty(self):
        empty = np.zeros((0, 3))
        result = self.solver.solve(self.scene, empty, square(), visibility=True, masks=True)
        self.assertEqual((result.visibility.shape, result.masks.shape), ((0,), (0, 4)))


class Errors(unittest.TestCase):
    def test_classes(self):
        self.assertTrue(issubclass(hs.UsageError, ValueError) and issubclass(hs.UsageError, hs.Error))
        self.assertTrue(issubclass(hs.BadInputError, ValueError) and issubclass(hs.Error, RuntimeError))
        error = hs.LimitError("too much")
        self.assertEqual(str(pickle.loads(pickle.dumps(error))), "too much")

    def test_wrong_arguments(self):
        scene = hs.Scene()
        cases = (
            (hs.UsageError, "shape", lambda: scene.add_mesh(np.zeros((4, 2)))),
            (hs.UsageError, "shape", lambda: scene.add_mesh(HALF_PLANE, TRIANGLES[:, :2])),
            (hs.UsageError, "below 0", lambda: scene.add_mesh(HALF_PLANE, [[0, 1, -2]])),
            (hs.UsageError, "not integers", lambda: scene.add_mesh(HALF_PLANE, [[0.5, 1, 2]])),
            (hs.BadInputError, "4", lambda: scene.add_mesh(HALF_PLANE, [[0, 1, 4]])),
            (hs.BadInputError, "", lambda: scene.add_mesh(HALF_PLANE * np.float32("nan"), TRIANGLES)),
            (hs.UsageError, "uint8", lambda: scene.add_alpha_map(np.zeros((2, 2)))),
            (hs.UsageError, "last row", lambda: scene.add_mesh(HALF_PLANE, transform=2 * np.eye(4))),
            (hs.UsageError, "4096", lambda: hs.Solver(light_sample_count=0)),
            (hs.UsageError, "magic", lambda: hs.Solver(method="magic")),
            (hs.UsageError, "hpc.leaf", lambda: hs.Solver(options={"hpc.leaf": 0})),
            (TypeError, "", lambda: hs.Solver(samples=4)),
            (TypeError, "", lambda: scene.add_mesh()),
            (hs.UsageError, "three numbers", lambda: hs.Light.point((1, 2))),
            (hs.UsageError, "", lambda: scene.remove_mesh(7)),
        )
        for error, text, call in cases:
            with self.assertRaisesRegex(error, text):
                call()


class Stopping(unittest.TestCase):
    def setUp(self):
        self.scene, self.receivers = slow_scene()
        self.solver = hs.Solver(method="oracle")

    def test_progress_cancels(self):
        asked = []

        def progress(done):
            asked.append(done)
            return len(asked) < 3

        with self.assertRaises(hs.CancelledError):
            self.solver.visibility(self.scene, self.receivers, square(), progress=progress)
        self.assertEqual(len(asked), 3)
        self.assertTrue(all(0 <= done <= 1 for done in asked) and asked == sorted(asked))
        self.assertEqual(self.solver.visibility(self.scene, self.receivers[:10], square()).shape, (10,))

    def test_errors_in_progress_come_through(self):
        def progress(done):
            raise KeyError("mine")

        with self.assertRaisesRegex(KeyError, "mine"):
            self.solver.visibility(self.scene, self.receivers, square(), progress=progress)

    def test_ctrl_c(self):
        killer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
        killer.start()
        start = time.monotonic()
        with self.assertRaises(KeyboardInterrupt):
            self.solver.visibility(self.scene, self.receivers, square())
        took = time.monotonic() - start
        self.assertGreaterEqual(took, 0.29)
        self.assertLess(took, 5.0)  # asked every 20 ms; the whole call takes many times as long
        killer.join()

    def test_other_threads_run_meanwhile(self):
        counted = 0
        stopped = threading.Event()

        def solve():
            with self.assertRaises(hs.CancelledError):
                self.solver.visibility(self.scene, self.receivers, square(), progress=lambda done: not stopped.is_set())

        thread = threading.Thread(target=solve)
        thread.start()
        end = time.monotonic() + 0.5
        while time.monotonic() < end and thread.is_alive():
            counted += 1
        self.assertTrue(thread.is_alive())
        self.assertGreater(counted, 1000)
        # What C++ forbids during a solve is refused; what it allows works.
        with self.assertRaisesRegex(hs.UsageError, "in use"):
            self.scene.remove_mesh(0)
        self.assertEqual(self.solver.visibility(self.scene, self.receivers[:10], square()).shape, (10,))
        workspace = hs.Workspace()
        self.assertEqual(self.solver.visibility(self.scene, self.receivers[:3], square(), workspace=workspace).size, 3)
        self.assertEqual(workspace.stats["receivers"], 3)
        stopped.set()
        thread.join()


if __name__ == "__main__":
    unittest.main()
