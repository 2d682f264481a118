#!/usr/bin/env python3
"""halfshade accumulate from outside: files, resumed runs, refusals. Standard library only.

Usage: test_accumulate.py HALFSHADE [unittest arguments]
"""

import json
import os
import pathlib
import random
import signal
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM = os.path.abspath(sys.argv.pop(1)) if len(sys.argv) > 1 else "halfshade"
UNMEASURED = ("builtin:columns", "--size", "40x30", "--light-samples", "32", "--quiet")
SCENE = (*UNMEASURED, "--reference-samples", "512")
OK, DIFFERENT, USAGE, BAD_INPUT, LIMIT, OUTPUT = range(6)


def command(*arguments):
    return [PROGRAM, "accumulate", *map(str, arguments)]


class Accumulate(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory(prefix="halfshade-accumulate-")
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)

    def expect(self, code, *arguments):
        result = subprocess.run(command(*arguments), capture_output=True, text=True, timeout=120, check=False)
        self.assertEqual(result.returncode, code, f"{arguments}\n{result.stdout}{result.stderr}")
        return result

    def pattern(self, name):
        (self.directory / name).mkdir(exist_ok=True)
        return self.directory / name / "f_%03d.png"

    def files(self, name):
        return {path.name: path.read_bytes() for path in (self.directory / name).iterdir()}

    def accumulate(self, name, *arguments):
        self.expect(OK, *SCENE, "-o", self.pattern(name), *arguments)
        return self.files(name)

    def test_each_frame_is_written_under_its_number_beside_the_state(self):
        files = self.accumulate("a", "--frames", 3)
        self.assertEqual(sorted(files), ["f_%03d.png.state", "f_000.png", "f_001.png", "f_002.png"])
        self.assertNotEqual(files["f_000.png"], files["f_002.png"])

    def test_one_frame_shows_what_render_shows(self):
        self.accumulate("a", "--frames", 1)
        picture = self.directory / "render.png"
        subprocess.run([PROGRAM, "render", *SCENE[:5], "-q", "-o", str(picture)], check=True, capture_output=True)
        compared = subprocess.run([PROGRAM, "compare", str(picture), str(self.directory / "a" / "f_000.png")],
                                  capture_output=True, text=True, check=False)
        self.assertEqual(compared.returncode, OK, compared.stdout)

    def test_a_resumed_run_ends_with_the_bytes_of_an_uninterrupted_one(self):
        for extra in ((), ("--jitter-camera", "--spp", 4), ("--sets", 4)):
            with self.subTest(extra=extra):
                name = "-".join(map(str, extra)) or "plain"
                whole = self.accumulate(name + "whole", "--frames", 8, *extra)
                self.accumulate(name + "parts", "--frames", 3, *extra)
                self.assertEqual(self.accumulate(name + "parts", "--frames", 8, "--resume", *extra), whole)

    def test_runs_killed_at_any_time_go_on_to_the_same_bytes(self):
        whole = self.accumulate("whole", "--frames", 8, "--jitter-camera")
        generator = random.Random(41)
        start = time.monotonic()
        self.accumulate("timed", "--frames", 8, "--jitter-camera")
        duration = time.monotonic() - start
        for round_ in range(8):
            pattern = self.pattern(f"killed{round_}")
            arguments = command(*SCENE, "-o", pattern, "--frames", 8, "--jitter-camera", "--resume")
            for _ in range(3):
                process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                time.sleep(generator.random() * duration)
                process.send_signal(signal.SIGKILL)
                process.wait()
            self.expect(OK, *arguments[2:])
            files = self.files(f"killed{round_}")
            self.assertEqual({k: v for k, v in files.items() if not k.startswith(".halfshade-")}, whole)

    def test_the_number_of_threads_changes_no_byte(self):
        one = self.accumulate("one", "--frames", 3, "--jitter-camera", "--threads", 1)
        self.assertEqual(self.accumulate("two", "--frames", 3, "--jitter-camera", "--threads", 2), one)
        self.assertEqual(self.accumulate("seven", "--frames", 3, "--jitter-camera", "--threads", 7), one)

    def test_a_state_of_other_options_or_a_damaged_one_is_refused(self):
        self.accumulate("a", "--frames", 2)
        state = self.directory / "a" / "f_%03d.png.state"
        resume = (*SCENE, "-o", self.pattern("a"), "--frames", 3, "--resume")
        for other in (("--seed", 1), ("--pattern", "uniform"), ("--crop", "0,40,0,29"), ("--jitter-camera",)):
            self.assertIn("other options", self.expect(BAD_INPUT, *resume, *other).stderr)
        content = bytearray(state.read_bytes())
        content[-1] ^= 1
        for damaged in (bytes(content), content[:-1], content + b"\0", b"", b"\n", b"{}\n", b"[1]\nx"):
            state.write_bytes(damaged)
            self.assertIn(str(state), self.expect(BAD_INPUT, *resume).stderr)

    def test_wrong_options_are_usage_errors(self):
        for output in ("f.png", "f_%d_%d.png", "f_%s.png", "f_%.png", "f_%04d.gif", "f_%4d.png", "f_%%d.png", "%"):
            with self.subTest(output=output):
                self.assertIn(output, self.expect(USAGE, *SCENE, "-o", self.directory / output).stderr)
        for wrong in (("--frames", 0), ("--frames", 65537), ("--until-error", -1), ("--until-error", "nan"),
                      ("--until-error", 0.1, "--reference-samples", 0), ("--resume",),
                      ("--reference-samples", 1 << 30)):
            with self.subTest(wrong=wrong):
                self.expect(USAGE, *UNMEASURED, *wrong)

    def test_until_error_stops_at_the_first_frame_below_it(self):
        out = self.expect(OK, *SCENE, "--frames", 64, "--until-error", 0.01, "--json", "-").stdout
        errors = [frame["rmse"] for frame in json.loads(out)["frames"]]
        self.assertLess(errors[-1], 0.01)
        self.assertTrue(all(error >= 0.01 for error in errors[:-1]))
        self.assertLess(len(errors), 64)

    def test_the_json_tells_errors_times_and_the_slope(self):
        out = json.loads(self.expect(OK, *UNMEASURED, "--frames", 6, "--reference-samples", 16384, "--json", "-").stdout)
        self.assertEqual(out["schema"], "halfshade.accumulate/1")
        self.assertEqual([frame["frame"] for frame in out["frames"]], list(range(6)))
        self.assertTrue(all(frame["ms"] > 0 and 0 < frame["rmse"] <= frame["max"] <= 1 for frame in out["frames"]))
        self.assertLess(out["slope"], 0)
        self.assertEqual(out["reference"]["samples"], 16384)

    def test_without_a_reference_changes_are_printed(self):
        run = (*UNMEASURED, "--reference-samples", 0, "-o", self.pattern("a"), "--frames")
        out = self.expect(OK, *run, 4).stdout
        self.assertIn("change RMSE", out)
        self.assertNotIn("slope", out)
        whole = self.files("a")
        (self.directory / "a" / "f_%03d.png.state").unlink()
        self.expect(OK, *run, 2)
        self.expect(OK, *run, 4, "--resume")
        self.assertEqual(self.files("a"), whole)


if __name__ == "__main__":
    unittest.main()
