#!/usr/bin/env python3
"""`render --max-error` and `halfshade recommend` as a user meets them. Standard library only.

Usage: test_max_error.py HALFSHADE [unittest arguments]
"""

import json
import os
import pathlib
import shlex
import subprocess
import sys
import tempfile
import unittest

PROGRAM = os.path.abspath(sys.argv.pop(1)) if len(sys.argv) > 1 else "halfshade"
SOURCES = pathlib.Path(__file__).resolve().parents[2]
OK, DIFFERENT, USAGE = range(3)


def halfshade(*arguments):
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)


def stats_of(scene, goal, *options):
    run = halfshade("render", scene, "--max-error", goal, "--json", "-", "--quiet", *options)
    assert run.returncode == OK, run.stderr
    return json.loads(run.stdout)["lights"]


class MaxError(unittest.TestCase):
    def test_the_goal_is_kept_on_every_receiver_of_built_in_scenes(self):
        for scene, goal in (("builtin:demo", "1/64"), ("builtin:columns", "1/256"), ("builtin:bars", "0.4%"),
                            ("builtin:fence", "0.01"), ("builtin:hairball:60", "1/64"), ("builtin:room", "1/64")):
            with self.subTest(scene=scene):
                for light in stats_of(scene, goal, "--size", "40x40", "--verify", "100"):
                    self.assertGreater(light["verify"]["receivers"], 0)
                    self.assertEqual(light["verify"]["violations"], 0)
                    self.assertEqual(light["verify"]["wrong_proofs"], 0)
                    found = light["max_error"]
                    self.assertEqual(sum(level["samples"] for level in found["levels"]), found["samples_asked"])
                    if found["exhausted"] == 0:
                        self.assertLessEqual(found["bound_kept"], found["goal"] * 1.000001)

    def test_lights_of_all_kinds(self):
        for view in ("disk", "sphere", "polygon", "ellipsoid", "two"):
            file = SOURCES / "docs/views" / f"{view}.view.json"
            with self.subTest(view=view):
                for light in stats_of("builtin:bars", "1/32", "--view", str(file), "--size", "24x24", "--verify", "100"):
                    self.assertEqual(light["verify"]["violations"], 0)

    def test_a_picture_is_written_and_a_smaller_goal_takes_more_samples(self):
        with tempfile.TemporaryDirectory() as directory:
            picture = os.path.join(directory, "a.exr")
            coarse = stats_of("builtin:sphere", "1/32", "--size", "32x32", "-o", picture)
            self.assertTrue(os.path.getsize(picture) > 0)
        fine = stats_of("builtin:sphere", "1/512", "--size", "32x32")
        self.assertLess(coarse[0]["max_error"]["samples_asked"], fine[0]["max_error"]["samples_asked"])

    def test_bad_goals_and_what_does_not_go_together_are_usage_errors(self):
        for goal in ("", "x", "1/0", "0", "1/2", "1/5000", "0.004x", "50%", "nan", "1/256/2", "/4", "1e-300"):
            with self.subTest(goal=goal):
                run = halfshade("render", "builtin:sphere", "--size", "8x8", "--max-error", goal)
                self.assertEqual(run.returncode, USAGE)
                self.assertNotEqual(run.stderr, "")
        for extra in (["--method", "afsm"], ["--light-samples", "64"], ["--dump", "d"], ["--stream"], ["--sets", "4"]):
            with self.subTest(extra=extra):
                run = halfshade("render", "builtin:sphere", "--size", "8x8", "--max-error", "1/64", *extra)
                self.assertEqual(run.returncode, USAGE)
        run = halfshade("render", "builtin:glass:8", "--size", "8x8", "--max-error", "1/64")
        self.assertEqual(run.returncode, USAGE)
        self.assertIn("translucent", run.stderr)


class Recommend(unittest.TestCase):
    def test_the_cheapest_setting_that_keeps_the_goal_is_named(self):
        run = halfshade("recommend", "builtin:columns:2", "--max-error", "1/32", "--size", "32x32", "--repeat", "1",
                        "--json", "--quiet")
        self.assertIn(run.returncode, (OK, DIFFERENT), run.stderr)
        report = json.loads(run.stdout)
        self.assertEqual(report["schema"], "halfshade.recommend/1")
        light, = report["lights"]
        keeping = [p for p in light["points"] if p.get("keeps_goal")]
        self.assertTrue(keeping)
        self.assertEqual(report["recommended"]["setting"], min(keeping, key=lambda p: p["shadow_ms"])["setting"])
        self.assertTrue(all(p["max"] <= 1 / 32 for p in keeping))
        self.assertIn("--max-error 1/32", {p["setting"] for p in light["points"]})

    def test_the_printed_line_keeps_the_goal_under_all_lights_with_all_options(self):
        given = ["--view", str(SOURCES / "docs/views/two.view.json"), "--size", "32x32", "--crop", "2,30,0,32", "--seed", "3"]
        run = halfshade("recommend", "builtin:columns:2", *given, "--max-error", "1/32", "--repeat", "1", "--quiet")
        self.assertEqual(run.returncode, OK, run.stderr)
        line, = (text for text in run.stdout.splitlines() if text.startswith("recommended: "))
        command = shlex.split(line.removeprefix("recommended: "))
        self.assertEqual(command[:len(given) + 3], ["halfshade", "render", "builtin:columns:2", *given])
        with tempfile.TemporaryDirectory() as directory:
            ours, reference = (os.path.join(directory, name) for name in ("ours.exr", "reference.exr"))
            self.assertEqual(halfshade(*command[1:], "-o", ours, "--quiet").returncode, OK)
            goal = ["--max-error", "1/512"]
            self.assertEqual(halfshade("render", "builtin:columns:2", *given, *goal, "-o", reference, "--quiet").returncode, OK)
            # Visibility of each light is among the values.
            compared = halfshade("compare", ours, reference, "--max-error", str(1 / 32 + 1 / 512))
        self.assertEqual(compared.returncode, OK, compared.stdout + compared.stderr)

    def test_one_setting_is_named_that_is_cheapest_for_all_lights_together(self):
        run = halfshade("recommend", "builtin:columns:2", "--view", str(SOURCES / "docs/views/two.view.json"), "--max-error",
                        "1/32", "--size", "32x32", "--repeat", "1", "--json", "--quiet")
        self.assertEqual(run.returncode, OK, run.stderr)
        report = json.loads(run.stdout)
        self.assertEqual(len(report["lights"]), 2)
        sums = {}
        for points in zip(*(light["points"] for light in report["lights"])):
            if all(p.get("keeps_goal") for p in points):
                sums[points[0]["setting"]] = sum(p["shadow_ms"] for p in points)
        setting = min(sums, key=sums.get)
        self.assertEqual(report["recommended"]["setting"], setting)
        self.assertAlmostEqual(report["recommended"]["shadow_ms"], sums[setting])

    def test_what_render_refuses_is_not_recommended(self):
        run = halfshade("recommend", "builtin:glass:8", "--max-error", "1/32", "--size", "24x24", "--repeat", "1", "--json",
                        "--quiet")
        self.assertIn(run.returncode, (OK, DIFFERENT), run.stderr)
        adaptive, = (p for p in json.loads(run.stdout)["lights"][0]["points"] if p["setting"] == "--max-error 1/32")
        self.assertIn("translucent", adaptive["reason"])
        self.assertNotIn("keeps_goal", adaptive)

    def test_bad_options(self):
        self.assertEqual(halfshade("recommend", "builtin:sphere", "--max-error", "2").returncode, USAGE)
        self.assertEqual(halfshade("recommend", "builtin:sphere", "--repeat", "0").returncode, USAGE)
        for chosen in (["--method", "afsm"], ["--pattern", "uniform"], ["--light-samples", "64"], ["--sets", "4"]):
            with self.subTest(chosen=chosen):
                self.assertEqual(halfshade("recommend", "builtin:sphere", *chosen).returncode, USAGE)


class Shortcuts(unittest.TestCase):
    def test_shortcuts_are_listed_with_their_gain(self):
        run = halfshade("render", "builtin:sphere", "--size", "24x24", "--measure-shortcuts", "--json", "-", "--quiet")
        self.assertEqual(run.returncode, OK, run.stderr)
        shortcuts = {s["name"]: s for s in json.loads(run.stdout)["lights"][0]["shortcuts"]}
        self.assertTrue(shortcuts["back-face-only casters"]["on"])
        self.assertGreater(shortcuts["back-face-only casters"]["gain"], 0)
        self.assertTrue(shortcuts["no alpha path"]["on"])
        plain = halfshade("render", "builtin:sphere", "--size", "24x24", "--stats", "--quiet").stdout
        self.assertIn("--measure-shortcuts adds what each gains", plain)
        measured = halfshade("render", "builtin:sphere", "--size", "24x24", "--measure-shortcuts", "--quiet").stdout
        self.assertNotIn("--measure-shortcuts", measured)
        fence = halfshade("render", "builtin:fence", "--size", "24x24", "--stats", "--json", "-", "--quiet")
        shortcuts = {s["name"]: s for s in json.loads(fence.stdout)["lights"][0]["shortcuts"]}
        self.assertFalse(shortcuts["no alpha path"]["on"])
        self.assertNotIn("gain", shortcuts["no alpha path"])


if __name__ == "__main__":
    unittest.main()
