#!/usr/bin/env python3
"""halfshade chart, its plots and its report: contents, going on after a stop, the page in a browser if there is one.

Usage: test_chart.py HALFSHADE [unittest arguments]. Standard library only; a headless chromium on PATH adds a check, which
CI must have.
"""

import base64
import csv
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import xml.etree.ElementTree

PROGRAM = os.path.abspath(sys.argv.pop(1)) if len(sys.argv) > 1 else "halfshade"
SOURCES = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(SOURCES / "tests/tools"))
sys.path.insert(0, str(SOURCES / "bench"))
import browser  # noqa: E402
import report_parts  # noqa: E402

OK, USAGE, BAD_INPUT = 0, 2, 3
POINTS = ("builtin:columns", "--size", "64x64", "--methods", "exact,pcf", "--samples", "4,16", "--sweep",
          "map.resolution=64,256", "--time-limit", 60, "--quiet")
SMALL = (*POINTS, "--repeat", 2)
COUNT = 2 + 1 + 2  # exact with two numbers of samples; pcf by default and with two resolutions

# Time and error of points, with ties in either and in both.
TIES = [(3.0, 0.2), (1.0, 0.5), (1.0, 0.4), (2.0, 0.4), (2.0, 0.3), (2.0, 0.3), (4.0, 0.2), (5.0, 0.0), (6.0, 0.0), (0.5, 0.9)]
# Acts on the loaded page like a user and notes what it saw.
ACTIONS = """
const read = canvas => {  // from a copy, so that the page's own canvases stay as they are
  const copy = document.createElement("canvas");
  copy.width = canvas.width; copy.height = canvas.height;
  const context = copy.getContext("2d", {willReadFrequently: true});
  context.drawImage(canvas, 0, 0);
  return context;
};
const pixel = (canvas, u) => [...read(canvas).getImageData(canvas.width * u, canvas.height / 4, 1, 1).data].slice(0, 3);
const brightness = canvas => read(canvas).getImageData(0, 0, canvas.width, canvas.height).data.reduce((a, b) => a + b, 0);
const act = (canvas, type, u, v, more) => {
  const box = canvas.getBoundingClientRect();
  canvas.dispatchEvent(new PointerEvent(type, {clientX: box.left + u * box.width, clientY: box.top + v * box.height, pointerId: 1, bubbles: true, ...more}));
};
const third = document.getElementById("canvasC");
third.setPointerCapture = () => {};
await drawSlots();
seen.points = document.querySelectorAll(".point").length;
seen.canvas = brightness(third);
seen.line = document.querySelectorAll("#profile polyline").length;
act(third, "pointerdown", 0.5, 0.5); act(third, "pointermove", 0.9, 0.5); act(third, "pointerup", 0.9, 0.5);
await drawSlots();
seen.wipe = state.wipe;
seen.wiped = pixel(third, 0.9);
const canvases = ["canvasA", "canvasB", "canvasC"].map(id => document.getElementById(id));
seen.zoom = [];
seen.zoomed = [];
for (const canvas of canvases) {  // the wheel over any of them zooms all
  const before = canvases.map(brightness), box = canvas.getBoundingClientRect();
  canvas.dispatchEvent(new WheelEvent("wheel", {deltaY: -1, clientX: box.left + 5, clientY: box.top + 5}));
  await drawSlots();
  seen.zoom.push(state.zoom);
  seen.zoomed.push(canvases.map(brightness).filter((b, i) => b !== before[i]).length);
}
document.getElementById("mode").value = "difference";
await drawSlots();
seen.difference = document.getElementById("shown").textContent;
document.getElementById("mode").value = "flicker";
state.flicker = false; await drawSlots();
const shownA = brightness(third);
state.flicker = true; await drawSlots();
seen.flickers = shownA === brightness(document.getElementById("canvasA")) && shownA !== brightness(third);
document.querySelector(".point").dispatchEvent(new MouseEvent("mousemove", {bubbles: true}));
seen.tip = document.querySelector("#tip img").src.slice(0, 22);
// Pictures made of four grey columns: A brighter in the first, darker in the last.
const columns = greys => {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = greys.length;
  const context = canvas.getContext("2d");
  greys.forEach((g, x) => { context.fillStyle = `rgb(${g},${g},${g})`; context.fillRect(x, 0, 1, greys.length); });
  const values = Uint8Array.from({length: greys.length ** 2}, (_, i) => greys[i % greys.length]);
  return {canvas, values, width: greys.length, height: greys.length};
};
decoded.set(numberOf(state.a), columns([150, 100, 100, 50]));
decoded.set(numberOf(state.b), columns([100, 100, 100, 100]));
state.zoom = 1; state.x = state.y = 0; state.row = null;
document.getElementById("mode").value = "difference"; document.getElementById("range").value = "0.0625";
await drawSlots();
seen.legend = [0.125, 0.375, 0.875].map(u => pixel(third, u));
document.getElementById("mode").value = "wipe"; state.wipe = 0.9;
await drawSlots();
seen.sides = [0.125, 0.8, 0.95].map(u => pixel(third, u));
// The front of the chart, and of points with equal times and errors.
seen.front = paretoFront(measured()).map(p => p.id);
seen.ties = paretoFront(TIES.map(([ms, rmse], i) => ({i, shadow_ms: ms, against_reference: {rmse}}))).map(p => p.i);
seen.atlas = document.querySelectorAll("#atlasEntries article").length;
"""


def run(*arguments, program=PROGRAM):
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=300, check=False)


def tied_points():
    return [{"id": i, "shadow_ms": ms, "against_reference": {"rmse": rmse}} for i, (ms, rmse) in enumerate(TIES)]


class ParetoFront(unittest.TestCase):
    def test_it_is_the_points_that_no_other_beats(self):
        def beats(a, b):
            return a != b and a[0] <= b[0] and a[1] <= b[1]
        expected = sorted({p for p in TIES if not any(beats(q, p) for q in TIES)})
        self.assertEqual([TIES[p["id"]] for p in report_parts.pareto_front(tied_points())], expected)
        self.assertEqual(len(expected), 5)
        self.assertEqual(report_parts.pareto_front([]), [])


class Chart(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory(prefix="halfshade-chart-")
        cls.directory = pathlib.Path(cls.scratch.name) / "chart"
        result = run("chart", *SMALL, "-o", cls.directory)
        assert result.returncode == OK, result.stderr
        cls.chart = cls.read()
        cls.report = cls.directory / "report.html"
        atlas = pathlib.Path(cls.scratch.name) / "atlas"
        result = run("atlas", "both_sides", "--quick", "--quiet", "-o", atlas)
        assert result.returncode == OK, result.stderr
        result = run(SOURCES / "bench/chart_report.py", cls.directory / "chart.json", "--atlas", atlas / "atlas.json", "-o",
                     cls.report, program=sys.executable)
        assert result.returncode == OK, result.stderr

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    @classmethod
    def read(cls):
        return json.loads((cls.directory / "chart.json").read_text(encoding="utf-8"))

    def test_every_point_has_times_errors_and_a_picture(self):
        self.assertEqual(self.chart["schema"], "halfshade.chart/1")
        self.assertEqual(len(self.chart["points"]), COUNT)
        for point in self.chart["points"]:
            with self.subTest(point=point["id"]):
                self.assertEqual(point["status"], "measured")
                self.assertEqual(len(point["times_ms"]), 2)
                self.assertLessEqual(point["shadow_ms_min"], point["shadow_ms"])
                self.assertGreater(point["shadow_ms_min"], 0)
                self.assertGreater(point["against_reference"]["max"], 0)
                self.assertLessEqual(point["against_reference"]["rmse"], point["against_reference"]["max"])
                self.assertTrue(0 < point["against_reference"]["flip"] < 1)
                self.assertTrue((self.directory / point["image"]).read_bytes().startswith(b"\x89PNG"))
        self.assertEqual(len({point["id"] for point in self.chart["points"]}), COUNT)

    def test_the_reference_has_16384_samples_and_the_exact_answer_agrees_with_the_oracle(self):
        subject, = self.chart["subjects"]
        self.assertEqual(subject["reference"]["samples"], 16384)
        self.assertLess(subject["reference"]["own_rmse"], 0.005)
        self.assertGreater(subject["exact_checked"]["bits"], 0)
        self.assertEqual(subject["exact_checked"]["wrong_bits"], 0)

    def test_exact_methods_have_no_wrong_bit_and_approximate_ones_err(self):
        for point in self.chart["points"]:
            with self.subTest(point=point["id"]):
                if point["promises_exactness"]:
                    self.assertEqual(point["against_exact"]["wrong_bits"], 0)
                    self.assertEqual(point["against_exact"]["max"], 0)
                else:
                    self.assertNotIn("wrong_bits", point["against_exact"])
                    self.assertGreater(point["against_exact"]["rmse"], 0)
                    self.assertNotEqual(point["assumes"], "")

    def test_more_samples_come_nearer_to_the_reference(self):
        rmse = {p["id"]: p["against_reference"]["rmse"] for p in self.chart["points"]}
        self.assertLess(rmse["exact n=16"], rmse["exact n=4"])

    def test_the_table_holds_the_same_numbers(self):
        with (self.directory / "chart.csv").open(newline="", encoding="utf-8") as file:
            rows = {row["id"]: row for row in csv.DictReader(file)}
        self.assertEqual(len(rows), COUNT)
        for point in self.chart["points"]:
            self.assertEqual(float(rows[point["id"]]["shadow_ms"]), point["shadow_ms"])
            self.assertEqual(float(rows[point["id"]]["rmse"]), point["against_reference"]["rmse"])
            self.assertEqual(float(rows[point["id"]]["flip"]), point["against_reference"]["flip"])

    def test_a_second_run_computes_nothing_and_changes_no_point(self):
        written = (self.directory / self.chart["points"][0]["image"]).stat().st_mtime_ns
        self.assertEqual(run("chart", *SMALL, "-o", self.directory).returncode, OK)
        again = self.read()
        self.assertEqual(again["points"], self.chart["points"])
        self.assertEqual(again["subjects"], self.chart["subjects"])
        self.assertEqual((self.directory / self.chart["points"][0]["image"]).stat().st_mtime_ns, written)

    def test_a_stopped_run_keeps_its_points_and_the_next_one_goes_on(self):
        directory = self.directory.parent / "stopped"
        arguments = ("chart", *POINTS, "--repeat", 1000, "-o", directory)
        process = subprocess.Popen([PROGRAM, *map(str, arguments)], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 120
        while not (directory / "chart.json").exists() and time.monotonic() < deadline:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(timeout=60), 128 + signal.SIGINT)
        kept = json.loads((directory / "chart.json").read_text(encoding="utf-8"))["points"]
        self.assertGreater(len(kept), 0)
        self.assertEqual(run("chart", *SMALL, "-o", directory).returncode, OK)
        resumed = json.loads((directory / "chart.json").read_text(encoding="utf-8"))
        self.assertEqual(len(resumed["subjects"]), 1)
        after = resumed["points"]
        self.assertEqual(len(after), COUNT)
        for old, new in zip(kept, after):
            self.assertEqual(old["times_ms"], new["times_ms"][:len(old["times_ms"])])

    def test_other_settings_are_refused_and_a_damaged_file_too(self):
        result = run("chart", *SMALL, "--seed", 1, "-o", self.directory)
        self.assertEqual(result.returncode, USAGE)
        self.assertIn("'seed' was 0, is 1", result.stderr)
        damaged = self.directory.parent / "damaged"
        damaged.mkdir()
        (damaged / "chart.json").write_text('{"schema": "halfshade.chart/1", "points"', encoding="utf-8")
        self.assertEqual(run("chart", *SMALL, "-o", damaged).returncode, BAD_INPUT)

    def test_unknown_methods_options_and_numbers_are_usage_errors(self):
        for arguments in (("--methods", "magic"), ("--sweep", "map.magic=1"), ("--sweep", "map.resolution"),
                          ("--sweep", "map.resolution=7"), ("--samples", "5000"), ("--time-limit", "0")):
            with self.subTest(arguments=arguments):
                result = run("chart", "builtin:columns", *arguments, "-o", self.directory.parent / "none")
                self.assertEqual(result.returncode, USAGE, result.stderr)
                self.assertFalse((self.directory.parent / "none").exists())

    def test_a_run_over_the_time_limit_ends_its_series_with_a_reason(self):
        directory = self.directory.parent / "limit"
        result = run("chart", "builtin:columns", "--size", "64x64", "--methods", "exact", "--samples", "4,16,64", "--sweep",
                     "none", "--time-limit", "1e-6", "--reference-samples", 16, "--quiet", "-o", directory)
        self.assertEqual(result.returncode, OK, result.stderr)
        points = json.loads((directory / "chart.json").read_text(encoding="utf-8"))["points"]
        self.assertEqual([point["id"] for point in points], ["exact n=4", "exact n=16", "exact n=64"])
        for point in points[1:]:
            self.assertEqual(point["status"], "skipped")
            self.assertIn("exact n=4 took more than 1e-06 s", point["reason"])

    def test_scenes_below_a_directory_come_with_the_default_scenes_only(self):
        scenes = self.directory.parent / "scenes"
        (scenes / "card").mkdir(parents=True)
        (scenes / "card/card.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n", encoding="utf-8")
        directory = self.directory.parent / "named"
        few = ("--size", "16x16", "--methods", "pcf", "--sweep", "none", "--repeat", 1, "--reference-samples", 16)
        result = run("chart", *few, "builtin:columns:2", "--shared-scenes", scenes, "-o", directory)
        self.assertEqual(result.returncode, OK, result.stderr)
        subjects = json.loads((directory / "chart.json").read_text(encoding="utf-8"))["subjects"]
        self.assertEqual([subject["scene"] for subject in subjects], ["builtin:columns:2"])
        result = run("chart", *few, "--shared-scenes", scenes / "none", "-o", self.directory.parent / "none")
        self.assertEqual(result.returncode, USAGE)

    def test_progress_says_how_long_it_will_take_while_the_reference_is_made_too(self):
        result = run("chart", "builtin:columns:2", "--size", "16x16", "--methods", "pcf", "--sweep", "none", "--repeat", 1,
                     "-o", self.directory.parent / "progress")
        self.assertEqual(result.returncode, OK, result.stderr)
        self.assertRegex(result.stderr, r"(?m)^chart: \d0 %, about (\d+ min )?\d+ s left, builtin:columns:2 reference \d+ of 16$")
        self.assertRegex(result.stderr, r"about .* left, builtin:columns:2 pcf")

    def test_points_that_a_point_light_makes_equal_are_measured_once(self):
        scene = self.directory.parent / "point.obj"
        scene.write_text("v -4 0 -4\nv -4 0 4\nv 4 0 4\nv -1 1 -1\nv -1 1 1\nv 1 1 1\nf 1 2 3\nf 4 5 6\n",
                         encoding="utf-8")
        scene.with_suffix(".view.json").write_text(json.dumps({
            "camera": {"eye": [0, 4, 9], "target": [0, 1, 0], "up": [0, 1, 0], "fov_y_deg": 40},
            "lights": [{"name": "lamp", "type": "point", "position": [2, 6, 1]}]}), encoding="utf-8")
        directory = self.directory.parent / "point"
        result = run("chart", "--methods", "exact,pcf", "--samples", "4,16", scene, "--size", "48x48", "--sweep",
                     "pcf:map.resolution=64", "--quiet", "-o", directory)
        self.assertEqual(result.returncode, OK, result.stderr)
        points = json.loads((directory / "chart.json").read_text(encoding="utf-8"))["points"]
        self.assertEqual([point["id"] for point in points], ["exact n=1", "pcf n=1", "pcf n=1 map.resolution=64"])

    def test_the_plots_name_every_method_and_the_points_of_the_front(self):
        if subprocess.run([sys.executable, "-c", "import matplotlib"], capture_output=True, check=False).returncode != 0:
            self.skipTest("no matplotlib")
        result = run(SOURCES / "bench/plot_chart.py", self.directory / "chart.json", "-o", self.directory / "plot",
                     program=sys.executable)
        self.assertEqual(result.returncode, OK, result.stderr)
        self.assertTrue((self.directory / "plot.png").read_bytes().startswith(b"\x89PNG"))
        drawing = xml.etree.ElementTree.parse(self.directory / "plot.svg")
        texts = ["".join(element.itertext()).strip() for element in drawing.iter() if element.tag.endswith("}text")]
        front = {f'{p["method"]} {p["label"]}' for p in report_parts.pareto_front(self.chart["points"])}
        self.assertLessEqual({"columns", "exact", "pcf", "exact 16"} | front, set(texts))
        others = {p["label"] for p in self.chart["points"]} | {f'{p["method"]} {p["label"]}' for p in self.chart["points"]}
        self.assertEqual((others - front) & set(texts), set())

    def test_the_report_needs_no_network_and_holds_data_and_pictures(self):
        page = self.report.read_text(encoding="utf-8")
        self.assertNotRegex(page, r"https?://")
        self.assertNotRegex(page, r'(src|href)="(?!data:|\$\{)')
        embedded = {name: json.loads(text) for name, text in
                    re.findall(r'<script type="application/json" id="(\w+)">(.*?)</script>', page, re.S)}
        self.assertEqual([p["id"] for p in embedded["chart"]["points"]], [p["id"] for p in self.chart["points"]])
        for point in embedded["chart"]["points"]:
            uri = embedded["pictures"][point["picture"]]
            self.assertEqual(browser.png_of(uri), (self.directory / point["image"]).read_bytes())
        download = re.search(r'href="data:application/json;base64,([^"]+)"', page).group(1)
        self.assertEqual(json.loads(base64.b64decode(download)), self.chart)
        download = re.search(r'href="data:text/csv;base64,([^"]+)"', page).group(1)
        self.assertEqual(base64.b64decode(download), (self.directory / "chart.csv").read_bytes())

    def test_the_report_works_in_a_browser(self):
        browser.require(self)
        seen = browser.look(self.report, f"const TIES = {json.dumps(TIES)};" + ACTIONS)
        self.assertEqual(seen["errors"], [])
        self.assertEqual(seen["points"], COUNT)
        self.assertGreater(seen["canvas"], 0)
        self.assertEqual(seen["line"], 3)
        self.assertAlmostEqual(seen["wipe"], 0.9, places=2)
        self.assertEqual(seen["wiped"], [0, 170, 0])
        self.assertEqual(seen["zoom"], [1.25, 1.25 ** 2, 1.25 ** 3])
        self.assertEqual(seen["zoomed"], [3, 3, 3])
        self.assertEqual(seen["legend"], [[255, 0, 0], [255, 255, 255], [0, 0, 255]])  # A lighter, equal, darker
        self.assertEqual(seen["sides"], [[150] * 3, [50] * 3, [100] * 3])  # A left of the line, B right of it
        self.assertEqual(seen["front"], [point["id"] for point in report_parts.pareto_front(self.chart["points"])])
        self.assertEqual(seen["ties"], [point["id"] for point in report_parts.pareto_front(tied_points())])
        self.assertEqual(seen["difference"], "A - B")
        self.assertTrue(seen["flickers"])
        self.assertEqual(seen["tip"], "data:image/png;base64,")
        self.assertEqual(seen["atlas"], 1)


if __name__ == "__main__":
    unittest.main()
