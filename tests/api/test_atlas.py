#!/usr/bin/env python3
"""halfshade atlas and its report: what must hold and what must break, the page in a browser if there is one.

Usage: test_atlas.py HALFSHADE [unittest arguments]. Standard library only; a headless chromium on PATH adds a check, which
CI must have.
"""

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

PROGRAM = os.path.abspath(sys.argv.pop(1)) if len(sys.argv) > 1 else "halfshade"
SOURCES = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(SOURCES / "tests/tools"))
import browser  # noqa: E402

OK, USAGE, OUTPUT = 0, 2, 5
EXACT = {"exact", "afsm", "hpc", "gears", "stsv"}
# Largest error of V that these answers must have at least: a scene that breaks nobody proves nothing.
BREAK = {
    "wire": {"exact": 0.04, "exact, 16 samples": 0.15, "shadow-map": 0.09},
    "both_sides": {"shadow-map": 0.3, "pcss": 0.3, "textbook: volumes from the centre": 0.3},
    "winding": {"textbook: back faces only": 0.5, "shadow-map": 0.3},
    "double_cover": {"textbook: added coverage": 0.4, "shadow-map": 0.4},
    "hidden_layer": {"accumulation bits": 0.5, "accumulation sum": 0.5, "pcss": 0.5},
    "overlap": {"accumulation sum": 0.3, "shadow-map": 0.4},
    "few_lexels": {"accumulation sum": 0.9},
    "light_in_triangle": {"shadow-map": 0.2},
    "behind_light": {"textbook: box on a far plane": 0.1},
    "fence": {"exact": 0.2, "shadow-map": 0.4},
    "t_junctions": {"raytrace fast": 0.05},
    "far_origin": {"textbook: float rays": 0.2},
    "hot_cell": {},  # costs time and memory, see below
    "crowd": {"shadow-map": 0.3},
    "needle_light": {"pcss": 0.2, "accumulation bits": 0.2},
    "point_light": {"pcf": 0.3},
    "table": {"afsm-lut, 8 steps": 0.01, "shadow-map": 0.4},
    "bias": {"shadow-map, bias 0": 0.5, "shadow-map, bias 16": 0.3},
    "moving_light": {"shadow-map": 0.4},
    "moving_camera": {"shadow-map": 0.4},
}


def run(*arguments, program=PROGRAM):
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=300, check=False)


class Atlas(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory(prefix="halfshade-atlas-")
        cls.directory = pathlib.Path(cls.scratch.name) / "atlas"
        result = run("atlas", "--quick", "--quiet", "-o", cls.directory)
        assert result.returncode == OK, result.stdout + result.stderr
        cls.atlas = json.loads((cls.directory / "atlas.json").read_text(encoding="utf-8"))
        cls.entries = {entry["id"]: entry for entry in cls.atlas["entries"]}
        cls.report = cls.directory / "report.html"
        result = run(SOURCES / "bench/atlas_report.py", cls.directory / "atlas.json", "-o", cls.report,
                     program=sys.executable)
        assert result.returncode == OK, result.stderr

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def answers(self, entry):
        return {answer["id"]: answer for answer in self.entries[entry]["contenders"]}

    def test_every_entry_has_pictures_and_every_method(self):
        self.assertEqual(self.atlas["schema"], "halfshade.atlas/1")
        self.assertEqual(set(self.entries), set(BREAK) | {"terminator"})
        for name in BREAK:
            answers = self.answers(name)
            self.assertLessEqual(EXACT, set(answers))
            for answer in (self.entries[name], *answers.values()):
                with self.subTest(entry=name, answer=answer["id"]):
                    self.assertNotIn("refused", answer)
                    self.assertTrue((self.directory / answer["image"]).read_bytes().startswith(b"\x89PNG"))

    def test_exact_methods_have_no_wrong_bit_and_no_flip_without_a_reason(self):
        for entry in self.atlas["entries"]:
            for answer in entry["contenders"]:
                if not answer["promises_exactness"]:
                    continue
                with self.subTest(entry=entry["id"], answer=answer["id"]):
                    self.assertGreater(answer["bits"], 0)
                    self.assertEqual(answer["wrong_bits"], 0)
                    if answer["pattern"] == "uniform" and entry["id"] not in ("wire", "fence"):
                        self.assertEqual(answer["max"], 0)
                    if entry["temporal"]:
                        self.assertEqual(answer["unreasoned_flips"], 0)
                        self.assertEqual(answer["flicker"], entry["flicker"])

    def test_the_scenes_break_whom_they_are_meant_to_break(self):
        for name, least in BREAK.items():
            for who, error in least.items():
                if who.startswith("raytrace") and who not in self.answers(name):
                    continue  # built without Embree
                with self.subTest(entry=name, answer=who):
                    self.assertGreaterEqual(self.answers(name)[who]["max"], error)

    def test_errors_that_are_known_beforehand(self):
        wire = self.answers("wire")
        self.assertLessEqual(wire["exact"]["max"], 1 / 16 + 1e-7)  # one of 16 columns
        self.assertLessEqual(wire["exact, pattern rows"]["max"], wire["exact"]["max"] / 2)
        self.assertLess(self.answers("fence")["stsv, filtered"]["max"], 0.1)
        self.assertGreater(self.answers("overlap")["accumulation sum, K = 5"]["details"]
                           ["shadow-accumulation.largest_sum"], 1.5)
        self.assertGreater(self.answers("overlap")["accumulation sum, K = 32, as printed"]["details"]
                           ["shadow-accumulation.largest_sum"], 1.5)
        layers = self.answers("hidden_layer")
        self.assertLess(layers["accumulation bits, 8 layers"]["mean"], 0.5 * layers["accumulation bits"]["mean"])
        gears = self.answers("hot_cell")["gears"]["details"]
        triangles = self.entries["hot_cell"]["parameters"]["triangles"]
        self.assertGreater(gears["gears.assignments"], 10 * triangles)  # each triangle concerns far more than its cell
        self.assertLessEqual(gears["gears.pairs_in_flight_max"], 1 << 22)
        bias = self.answers("bias")
        self.assertLess(bias["shadow-map, bias 0"]["mean"], -0.1)  # acne is dark

    def test_flicker_is_what_the_curves_say(self):
        light, camera = self.entries["moving_light"], self.entries["moving_camera"]
        self.assertGreater(light["flicker"], 0)
        self.assertEqual(camera["flicker"], 0)  # nothing moves but the camera
        self.assertEqual(sum(camera["flips_per_frame"]), 0)
        for entry in (light, camera):
            self.assertEqual(len(entry["flips_per_frame"]), entry["parameters"]["frames"] - 1)
            for answer in entry["contenders"]:
                self.assertLessEqual(answer["unreasoned_flips"], sum(answer["flips_per_frame"]))
        pcss = self.answers("moving_camera")["pcss"]
        self.assertGreater(pcss["unreasoned_flips"], 0)
        self.assertGreater(pcss["flicker"], 0)

    def test_the_terminator_is_black_where_bent_normals_make_it(self):
        plain, shadowed, bent = self.entries["terminator"]["contenders"]
        self.assertGreater(plain["lit_facing_away"], 0)
        self.assertEqual(bent["lit_facing_away"], 0)
        self.assertLess(shadowed["lit_facing_away"], 0.5 * plain["lit_facing_away"])  # parts of the light, not its centre

    def test_chosen_entries_and_mistakes(self):
        directory = self.directory.parent / "chosen"
        result = run("atlas", "winding", "--quick", "--quiet", "-o", directory)
        self.assertEqual(result.returncode, OK, result.stderr)
        entries = json.loads((directory / "atlas.json").read_text(encoding="utf-8"))["entries"]
        self.assertEqual([entry["id"] for entry in entries], ["winding"])
        result = run("atlas", "magic", "-o", self.directory.parent / "none")
        self.assertEqual(result.returncode, USAGE)
        self.assertIn("terminator, wire, both_sides", result.stderr)
        self.assertFalse((self.directory.parent / "none").exists())
        blocked = self.directory.parent / "file"
        blocked.write_text("")
        self.assertEqual(run("atlas", "winding", "--quick", "-o", blocked).returncode, OUTPUT)

    def test_the_tables_for_the_documentation(self):
        result = run(SOURCES / "bench/atlas_report.py", self.directory / "atlas.json", "--markdown",
                     program=sys.executable)
        self.assertEqual(result.returncode, OK, result.stderr)
        errors, moving, hot = (text.splitlines() for text in result.stdout.split("\n\n"))
        for lines, entries in ((errors, set(BREAK)), (moving, {"moving_light", "moving_camera"}), (hot, {"hot_cell", "crowd"})):
            self.assertEqual([line.split(" | ")[0] for line in lines[2:]],
                             ["| " + e["title"] for e in self.atlas["entries"] if e["id"] in entries])
            self.assertTrue(all(line.count("|") == lines[0].count("|") for line in lines))
        pcss = self.answers("moving_camera")["pcss"]
        share = 100 * pcss["unreasoned_flips"] / pcss["flips_asked"]
        self.assertIn(f' {share:.3g} %, {1000 * pcss["flicker"]:.3g} ', moving[3])
        self.assertIn("| 0 %, 0 |", moving[3])
        gears = self.answers("hot_cell")["gears"]
        self.assertIn(f' {gears["ms"] / gears["ms_of_easy"]:.3g}, {gears["bytes"] / gears["bytes_of_easy"]:.3g} ', hot[2])

    def test_the_sheet_for_the_documentation(self):
        if subprocess.run([sys.executable, "-c", "import matplotlib"], capture_output=True, check=False).returncode != 0:
            self.skipTest("no matplotlib")
        if "raytrace robust" not in self.answers("wire"):
            self.skipTest("built without Embree")
        sheet = self.directory.parent / "sheet.png"
        result = run(SOURCES / "bench/plot_atlas.py", self.directory / "atlas.json", "-o", sheet, "--dpi", 20,
                     program=sys.executable)
        self.assertEqual(result.returncode, OK, result.stderr)
        self.assertTrue(sheet.read_bytes().startswith(b"\x89PNG"))

    def test_the_report_needs_no_network_and_holds_every_picture(self):
        page = self.report.read_text(encoding="utf-8")
        self.assertNotRegex(page, r"https?://")
        self.assertNotRegex(page, r'(src|href)="(?!data:|\$\{)')
        embedded = json.loads(re.search(r'id="atlas">(.*?)</script>', page, re.S).group(1))
        pictures = json.loads(re.search(r'id="atlasPictures">(.*?)</script>', page, re.S).group(1))
        for entry in embedded["entries"]:
            for answer in (entry, *entry["contenders"]):
                self.assertEqual(browser.png_of(pictures[answer["picture"]]),
                                 (self.directory / answer["image"]).read_bytes())

    def test_the_report_works_in_a_browser(self):
        browser.require(self)
        seen = browser.look(self.report, """
          const table = document.getElementById("atlasTable"), metric = document.getElementById("atlasMetric");
          seen.rows = table.querySelectorAll("tr").length;
          seen.texts = [];
          for (let i = 0; i < metric.options.length; ++i) {
            metric.value = i; metric.onchange();
            seen.texts.push([...table.querySelectorAll("td.cell")].map(c => c.textContent).join(""));
          }
          seen.articles = document.querySelectorAll("#atlasEntries article").length;
          const images = [...document.querySelectorAll("#atlasEntries img")];
          await Promise.all(images.map(i => i.decode()));
          seen.images = images.filter(i => i.naturalWidth > 0).length;
          seen.figures = document.querySelectorAll("#atlasEntries figure").length;
          seen.numbers = [...document.querySelectorAll("#atlasEntries figcaption")].filter(f => /off by up to [0-9.e-]+/.test(f.textContent)).length;
          seen.lines = document.querySelectorAll("#atlas-moving_light polyline").length;
          const key = document.querySelector("#atlas-fence .key"), line = document.querySelector("#atlas-fence polyline");
          key.click();
          seen.hidden = line.style.display;
        """)
        answers = sum(len(entry["contenders"]) for entry in self.atlas["entries"])
        self.assertEqual(seen["errors"], [])
        self.assertEqual(seen["rows"], 1 + len(self.entries))
        self.assertEqual(len(set(seen["texts"])), len(seen["texts"]))
        self.assertEqual(seen["articles"], len(self.entries))
        self.assertEqual(seen["figures"], answers + len(self.entries))
        self.assertGreaterEqual(seen["images"], 2 * answers + len(self.entries))
        self.assertEqual(seen["numbers"], answers)
        self.assertEqual(seen["lines"], len(self.entries["moving_light"]["contenders"]))
        self.assertEqual(seen["hidden"], "none")


if __name__ == "__main__":
    unittest.main()
