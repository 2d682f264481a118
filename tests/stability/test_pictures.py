#!/usr/bin/env python3
"""Named stability cases that need whole pictures. Standard library only.

S06  scenes far from the origin, as text
S22  the warning about features finer than the light's samples
S25  a swarm at the light within bounded memory
S29  pixels do not depend on instruction set, threads or the order of triangles

Usage: test_pictures.py HALFSHADE CASE [--long]
"""

import copy
import hashlib
import json
import os
import pathlib
import random
import re
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

PROGRAM, CASE, LONG = os.path.abspath(sys.argv[1]), sys.argv[2], "--long" in sys.argv
SANITIZED = "HALFSHADE_SANITIZED" in os.environ
VIEW = {"camera": {"eye": [0, 6, 9], "target": [0, 0.5, 0], "up": [0, 1, 0], "fov_y_deg": 40},
        "lights": [{"name": "frame", "type": "rectangle", "center": [0, 4, 0], "u": [2, 0, 0], "v": [0, 0, 2]}]}


def run(*arguments):
    """(exit code, standard output, standard error, peak MiB)"""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as errors:
        process = subprocess.Popen([PROGRAM, *map(str, arguments)], stdout=out, stderr=errors)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        errors.seek(0)
        return process.returncode, out.read().decode(), errors.read().decode(), usage.ru_maxrss / 1024


def moved(point, offset):
    return tuple(a + b for a, b in zip(point, offset))


class Scene:
    """Triangles as an OBJ file beside a view file."""

    def __init__(self):
        self.triangles = []

    def quad(self, a, b, c, d):
        self.triangles += [(a, b, c), (a, c, d)]

    def box(self, low, high):
        corner = [tuple((high if i >> k & 1 else low)[k] for k in range(3)) for i in range(8)]
        for face in ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)):
            self.quad(*(corner[i] for i in face))

    def floor(self):
        self.quad((-5, 0, -5), (-5, 0, 5), (5, 0, 5), (5, 0, -5))

    def write(self, path, order=0, offset=(0, 0, 0)):
        """Faces in the order of a random number generator; 0 leaves them. Vertices stay."""
        lines, faces = [], []
        for i, corners in enumerate(self.triangles):
            lines += ["v %r %r %r\n" % moved(corner, offset) for corner in corners]
            faces.append(f"f {3 * i + 1} {3 * i + 2} {3 * i + 3}\n")
        if order > 0:
            random.Random(order).shuffle(faces)
        path.write_text("".join(lines + faces))
        view = copy.deepcopy(VIEW)
        for holder, name in ((view["camera"], "eye"), (view["camera"], "target"), (view["lights"][0], "center")):
            holder[name] = moved(holder[name], offset)
        path.with_suffix(".view.json").write_text(json.dumps(view))
        return path


class Case(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory(prefix="halfshade-stability-")
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)

    def render(self, *arguments):
        code, out, errors, peak = run("render", *arguments, "--quiet")
        self.assertEqual(code, 0, errors)
        return out, errors, peak


class S06(Case):
    def test_an_obj_file_far_from_the_origin_gives_the_same_masks(self):
        numbers, scene = random.Random(6), Scene()
        scene.floor()
        for _ in range(1000):
            center = [numbers.uniform(-4, 3.5) for _ in range(3)]
            scene.triangles.append(tuple(
                tuple(round((c + numbers.uniform(-0.7, 0.7)) * 1024) / 1024 for c in center) for _ in range(3)))
        hashes = set()
        for offset in (0.0, 1e2, 1e3, 1e4, 1e5, 1e6):
            path = scene.write(self.directory / "far.obj", offset=(offset, -offset, 2 * offset))
            out, _, _ = self.render(path, "--size", "64x48", "--probes", 0, "--json", "-")
            hashes.add(json.loads(out)["lights"][0]["mask_hash"])
        self.assertEqual(len(hashes), 1)


class S22(Case):
    def test_a_wire_finer_than_the_samples_is_warned_of_and_wider_ones_are_not(self):
        for width in (0.01, 0.05, 0.0625, 0.1):
            scene = Scene()
            scene.floor()
            scene.quad((-width / 2, 2, -4.5), (width / 2, 2, -4.5), (width / 2, 2, 4.5), (-width / 2, 2, 4.5))
            path = scene.write(self.directory / "wire.obj")
            with self.subTest(width=width):
                _, errors, _ = self.render(path, "--size", "96x96", "--pattern", "uniform", "--probes", 256)
                warned = "warning: light 'frame'" in errors and "narrower than the distance between its 256" in errors
                self.assertEqual(warned, 2 * width < 0.125, errors)
                self.assertEqual(self.render(path, "--size", "16x16", "--probes", 0)[1], "")


class S25(Case):
    def swarm(self, count):
        """Tiny triangles at most 1/100 below the light."""
        numbers, scene = random.Random(25), Scene()
        scene.floor()
        for _ in range(count):
            x, y, z = numbers.uniform(-1, 1), 4 - numbers.uniform(0.002, 0.01), numbers.uniform(-1, 1)
            scene.triangles.append(tuple(
                tuple(center + 1e-3 * numbers.uniform(-1, 1) for center in (x, y, z)) for _ in range(3)))
        return scene.write(self.directory / "swarm.obj")

    def test_a_swarm_at_the_light_stays_within_512_mib_and_has_no_wrong_bit(self):
        path = self.swarm(100000 if LONG else 10000)
        if LONG:  # the scene alone takes more: what the method adds counts
            budget, share = 512 + 64 + self.render(path, "--size", "16x16", "--light-samples", 1)[2], "0.02"
        else:
            budget, share = 512 + 64, "0.2"
        for coarse in ("on", "off"):
            with self.subTest(coarse=coarse):
                out, _, peak = self.render(path, "--size", "128x128", "--light-samples", 16, "--method", "gears", "--set",
                                           "gears.grid=128", "--set", f"gears.coarse={coarse}", "--verify", share,
                                           "--probes", 0)
                self.assertRegex(out, r"verify +[1-9]\d* receivers, \d+ bits, 0 wrong")
                if not SANITIZED:
                    self.assertLessEqual(peak, budget)
                print(f"S25: coarse={coarse}: peak {peak:.0f} MiB")


def png_pixels(path):
    content, at, data = path.read_bytes(), 8, b""
    while at < len(content):
        (length,), kind = struct.unpack(">I", content[at:at + 4]), content[at + 4:at + 8]
        if kind in (b"IHDR", b"IDAT"):
            data += content[at + 8:at + 8 + length] if kind == b"IDAT" else b""
        at += 12 + length
    return zlib.decompress(data)


def exr_pixels(path):
    """The chunks behind header and offset table, as they stand: the header alone knows the command line."""
    content, at, window = path.read_bytes(), 8, None
    while content[at] != 0:
        name, kind, rest = content[at:].split(b"\0", 2)
        at = len(content) - len(rest)
        (size,) = struct.unpack("<i", content[at:at + 4])
        if name == b"dataWindow":
            window = struct.unpack("<4i", content[at + 4:at + 20])
        at += 4 + size
    (first,) = struct.unpack("<q", content[at + 1:at + 9])
    assert window is not None and at < first < len(content)
    return content[first:]


class S29(Case):
    METHODS = ("exact", "afsm", "hpc", "gears", "stsv")

    def scene(self):
        numbers, scene = random.Random(29), Scene()
        scene.floor()
        scene.box((-2, 0.5, -2), (-1, 1, 2))
        scene.box((0.5, 0.25, -1), (1.5, 1.5, 0))
        for _ in range(200):
            center = [numbers.uniform(-3, 3), numbers.uniform(0.3, 3.5), numbers.uniform(-3, 3)]
            scene.triangles.append(tuple(tuple(c + numbers.uniform(-0.4, 0.4) for c in center) for _ in range(3)))
        return scene

    def settings(self):
        """(instruction set, threads, order, method); `--long`: all of them, else each takes its turn."""
        names = run("render", "--simd", "?")[2]
        targets = re.search(r"is not one of: (.*)", names).group(1).split(", ")
        threads, everything = sorted({1, 2, 3, os.cpu_count() or 1}), []
        for i, target in enumerate(targets):
            for t, count in enumerate(threads):
                for order in range(3):
                    if LONG or (t == i % len(threads) and order == i % 3):
                        everything.append((target, count, order, self.METHODS[(i + t + order) % 5]))
        return everything

    def test_masks_png_and_exr_are_the_same_for_every_instruction_set_threads_and_order(self):
        scene = self.scene()
        paths = [scene.write(self.directory / f"order{k}.obj", k) for k in range(3)]
        masks, png, exr = set(), set(), {}
        settings = self.settings()
        for target, threads, order, method in settings:
            hashes = []
            for ending, pixels in (("png", png_pixels), ("exr", exr_pixels)):
                picture = self.directory / f"picture.{ending}"
                out, _, _ = self.render(paths[order], "--size", "64x48", "--light-samples", 64, "--threads", threads, "--simd",
                                        target, "--method", method, "--shading", "bent", "--json", "-", "-o", picture)
                hashes.append(hashlib.sha256(pixels(picture)).hexdigest())
            masks.add(json.loads(out)["lights"][0]["mask_hash"])
            png.add(hashes[0])
            exr.setdefault(order, set()).add(hashes[1])  # numbers of triangles are among its layers
        self.assertEqual(len(masks), 1)
        self.assertEqual(len(png), 1)
        self.assertEqual([len(hashes) for hashes in exr.values()], [1] * len(exr))
        self.assertGreater(len(settings), 1)
        print(f"S29: {len(settings)} settings, sha256 of the PNG's pixels {png.pop()}")


if __name__ == "__main__":
    suite = unittest.defaultTestLoader.loadTestsFromTestCase({"S06": S06, "S22": S22, "S25": S25, "S29": S29}[CASE])
    sys.exit(not unittest.TextTestRunner(verbosity=2).run(suite).wasSuccessful())
