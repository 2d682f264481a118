#!/usr/bin/env python3
"""The example programs in a quick form, each in a scratch directory. Standard library only; the plot needs matplotlib.

Usage: test_examples.py PROGRAM_DIRECTORY SOURCE_DIRECTORY [unittest arguments]
"""

import csv
import pathlib
import subprocess
import sys
import tempfile
import unittest

PROGRAMS = pathlib.Path(sys.argv.pop(1)).resolve() if len(sys.argv) > 2 else pathlib.Path(".")
SOURCE = pathlib.Path(sys.argv.pop(1)).resolve() if len(sys.argv) > 1 else pathlib.Path(".")


class Examples(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory(prefix="halfshade-examples-")
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)

    def run_program(self, name, *arguments, code=0):
        result = subprocess.run([PROGRAMS / f"example_{name}", *map(str, arguments)], cwd=self.directory, timeout=300,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        self.assertEqual(result.returncode, code, result.stdout)
        return result.stdout

    def test_minimal_draws_a_soft_shadow(self):
        rows = self.run_program("minimal").splitlines()
        self.assertEqual([len(row) for row in rows], [64] * 24)
        self.assertIn("@", rows[12])
        self.assertNotIn("@", rows[0])
        self.assertGreater(len(set("".join(rows))), 6, "a soft shadow has many shades")

    def test_accumulate_converges(self):
        self.assertIn("error ~ frames^-", self.run_program("accumulate"))

    def test_bits_do_not_depend_on_who_runs_the_loops(self):
        lines = [line for line in self.run_program("own_arena").splitlines() if "masks" in line]
        self.assertEqual(len(lines), 3)
        self.assertEqual(len({line.split()[-1] for line in lines}), 1)

    def test_a_z_buffer_of_ones_own_gives_a_picture(self):
        self.run_program("tiny_rasterizer_host", "a.ppm")
        data = (self.directory / "a.ppm").read_bytes()
        self.assertTrue(data.startswith(b"P6\n512 384\n255\n"))
        self.assertEqual(len(data), 15 + 3 * 512 * 384)
        self.assertGreater(len(set(data[15:])), 100)
        self.run_program("tiny_rasterizer_host", "no/such/directory/a.ppm", code=5)

    def test_embree_and_halfshade_agree_but_for_few_bits(self):
        if not (PROGRAMS / "example_embree_host").exists():
            self.skipTest("built without Embree")
        for scene in ("demo", SOURCE / "tests/examples/card.obj"):
            text = self.run_program("embree_host", scene, 96, "a.png")
            self.assertIn("rtcOccluded1M", text)
            self.assertIn("per million", text)
            self.assertEqual((self.directory / "a.png").read_bytes()[:4], b"\x89PNG")
        self.run_program("embree_host", "no-such-scene", code=3)

    def solar(self, *arguments):
        text = self.run_program("solar_shading", *arguments, "a.csv")
        with open(self.directory / "a.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        return text, rows

    def test_the_sun_shines_where_and_when_it_should(self):
        text, rows = self.solar(48, 80)  # equinox: about 12 hours of sun
        daylight = float(text.split("horizon for ")[1].split()[0])
        self.assertAlmostEqual(daylight, 12.0, delta=0.5)
        mean = {kind: sum(float(r["sun_hours"]) for r in rows if r["kind"] == kind) /
                sum(1 for r in rows if r["kind"] == kind) for kind in ("ground", "roof", "south", "north", "east", "west")}
        self.assertGreater(mean["roof"], 0.7 * daylight)
        self.assertLess(mean["north"], 0.5)  # the sun moves along the celestial equator, south of every wall
        self.assertGreater(mean["south"], mean["east"])
        self.assertGreater(mean["roof"], mean["ground"])
        self.assertTrue(all(0.0 <= float(r["sun_hours"]) <= daylight for r in rows))
        partly = sum(1 for r in rows for key in r if key[:1].isdigit() and 0.0 < float(r[key]) < 1.0)
        self.assertGreater(partly, 50, "nobody sees half a sun")
        for time, lit, dark in (("08.00", "east", "west"), ("16.00", "west", "east")):
            values = {kind: [float(r[time]) for r in rows if r["kind"] == kind] for kind in (lit, dark)}
            self.assertGreater(sum(values[lit]) / len(values[lit]), 0.25, time)
            self.assertEqual(max(values[dark]), 0.0, time)

    def test_polar_night_is_dark_and_the_plot_says_so(self):
        text, rows = self.solar(80, 355)
        self.assertIn(" 0 suns", text)
        self.assertTrue(all(float(r["sun_hours"]) == 0.0 for r in rows))

    def test_the_plot(self):
        python = next((p for p in ("/usr/bin/python3", sys.executable) if subprocess.run(
            [p, "-c", "import matplotlib, numpy"], stderr=subprocess.DEVNULL, check=False).returncode == 0), None)
        if python is None:
            self.skipTest("no python3 with matplotlib")
        self.solar(48, 172)
        subprocess.run([python, SOURCE / "examples/plot_solar.py", "a.csv", "a.png"], cwd=self.directory, check=True,
                       timeout=120)
        self.assertEqual((self.directory / "a.png").read_bytes()[:4], b"\x89PNG")


if __name__ == "__main__":
    unittest.main()
