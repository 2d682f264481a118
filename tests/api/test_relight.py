#!/usr/bin/env python3
"""Emission images and `halfshade relight` as a user meets them. Standard library only.

Usage: test_relight.py HALFSHADE [unittest arguments]
"""

import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

PROGRAM = os.path.abspath(sys.argv.pop(1)) if len(sys.argv) > 1 else "halfshade"
OK, DIFFERENT, USAGE, BAD_INPUT = range(4)

VIEW = {"camera": {"eye": [0, 3, 7], "target": [0, 1, 0]},
        "lights": [{"name": "window", "type": "rectangle", "center": [-4, 5, 1], "u": [0, 0, 3], "v": [1, -2, 0],
                    "two_sided": True, "emission": "window.png"},
                   {"name": "lamp", "type": "sphere", "center": [4, 4, 2], "radius": 0.4, "emission": [0.2, 0.3, 0.4]}]}


def write_png(path, rows):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    header = struct.pack(">IIBBBBB", len(rows[0]), len(rows), 8, 2, 0, 0, 0)
    data = b"".join(b"\0" + bytes(v for pixel in row for v in pixel) for row in rows)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(data)) +
                     chunk(b"IEND", b""))


def picture(f, width=24, height=16):
    return [[f(x, y) for x in range(width)] for y in range(height)]


ORIGINAL = picture(lambda x, y: (x * 10, 255 - y * 15, 40 if x < y else 220))
OTHER = picture(lambda x, y: (255 if x < 12 else 0, 30, 255 if y < 8 else 0))


class Relight(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory(prefix="halfshade-relight-")
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)
        write_png(self.directory / "window.png", ORIGINAL)
        (self.directory / "a.json").write_text(json.dumps(VIEW))

    def run_program(self, code, *arguments):
        result = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=120,
                                cwd=self.directory, check=False)
        self.assertEqual(result.returncode, code, f"{arguments}\n{result.stdout}{result.stderr}")
        return result

    def render(self, *arguments, code=OK):
        return self.run_program(code, "render", "builtin:columns", "--view", "a.json", "--size", "64x48",
                                "--light-samples", 100, "--quiet", *arguments)

    def expect_equal(self, a, b):
        # One code of 8 bits: the sums differ in their last float bits, and a value may lie on a rounding border.
        self.run_program(OK, "compare", a, b, "--max-error", 0.0041)

    def test_the_original_image_gives_back_the_render_for_crops_sets_and_subsamples(self):
        for options in ((), ("--sets", 5, "--pattern", "stratified"), ("--spp", 4, "--crop", "10,50,8,40"),
                        ("--interleave", "--pattern", "low-discrepancy")):
            with self.subTest(options=options):
                self.render(*options, "-o", "render.png", "--dump", "dump")
                self.run_program(OK, "relight", "dump/window", "--emission", "window.png", "-o", "relit.png")
                self.expect_equal("render.png", "relit.png")

    def test_another_image_gives_the_picture_that_rendering_with_it_gives_and_the_masks_stay(self):
        first = self.render("--dump", "dump")
        self.run_program(OK, "relight", "dump/window", "--emission", "window.png", "-o", "original.png")
        write_png(self.directory / "window.png", OTHER)
        second = self.render("-o", "render.png")
        hashes = [[line for line in run.stdout.splitlines() if "mask hash" in line] for run in (first, second)]
        self.assertEqual(*hashes)
        self.run_program(OK, "relight", "dump/window", "--emission", "window.png", "-o", "relit.png")
        self.expect_equal("render.png", "relit.png")
        self.run_program(DIFFERENT, "compare", "original.png", "relit.png", "--max-error", 0.1)

    def test_a_dump_without_lighting_and_wrong_images_are_refused(self):
        self.render("--dump", "dump")
        (self.directory / "bad.png").write_bytes(b"no picture")
        self.run_program(BAD_INPUT, "relight", "dump/window", "--emission", "bad.png", "-o", "relit.png")
        self.run_program(BAD_INPUT, "relight", "dump/window", "--emission", "missing.png", "-o", "relit.png")
        (self.directory / "dump/window/light_st.npy").unlink()
        result = self.run_program(BAD_INPUT, "relight", "dump/window", "--emission", "window.png", "-o", "relit.png")
        self.assertIn("light_st.npy is missing", result.stderr)
        self.run_program(USAGE, "relight", "dump/window", "--emission", "window.png", "-o", "relit.gif")
        self.assertFalse((self.directory / "relit.png").exists())

    def test_an_image_outside_the_views_directory_or_on_a_disk_is_refused(self):
        inner = self.directory / "inner"
        inner.mkdir()
        for light, expected in (({**VIEW["lights"][0], "emission": "../window.png"}, "outside the scene's directory"),
                                ({**VIEW["lights"][1], "emission": "../window.png"}, "/lights/0/emission")):
            (inner / "b.json").write_text(json.dumps({**VIEW, "lights": [light]}))
            result = self.run_program(BAD_INPUT, "render", "builtin:columns", "--view", "inner/b.json", "--quiet")
            self.assertIn(expected, result.stderr)


if __name__ == "__main__":
    unittest.main()
