#!/usr/bin/env python3
"""The command line as a user meets it: exit codes, messages, files, signals, equal bits. Standard library only.

Usage: test_cli.py HALFSHADE [unittest arguments]
"""

import array
import ast
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "tools"))
import two_at_a_time  # noqa: E402

PROGRAM = os.path.abspath(sys.argv.pop(1)) if len(sys.argv) > 1 else "halfshade"
OK, DIFFERENT, USAGE, BAD_INPUT, LIMIT, OUTPUT = range(6)


def small(*arguments, size="48x32", samples=64):
    return ("render", "builtin:columns", "--size", size, "--light-samples", samples, "--quiet", *arguments)


def run(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False)


def read_npy(path):
    """(values as a flat array, shape)"""
    content = path.read_bytes()
    length = int.from_bytes(content[8:10], "little")
    header = ast.literal_eval(content[10:10 + length].decode())
    values = array.array({"<u4": "I", "|u1": "B"}[header["descr"]], content[10 + length:])
    return values, header["shape"]


def masks_of_pixels(dump):
    """{pixel: mask bytes} of a dump with one sample per pixel."""
    pixels, _ = read_npy(dump / "receiver_pixels.npy")
    masks, (_, width) = read_npy(dump / "masks.npy")
    return {pixel: bytes(masks[i * width:(i + 1) * width]) for i, pixel in enumerate(pixels)}


class CommandLine(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory(prefix="halfshade-cli-")
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)

    def expect(self, code, *arguments):
        result = run(*arguments)
        self.assertEqual(result.returncode, code, f"{arguments}\n{result.stdout}{result.stderr}")
        return result

    def expect_failure(self, code, *arguments):
        """Failures explain themselves on standard error and leave standard output empty."""
        result = self.expect(code, *arguments)
        self.assertEqual(result.stdout, "")
        self.assertNotEqual(result.stderr.strip(), "")
        return result.stderr

    def mask_hash(self, *arguments):
        out = self.expect(OK, *small("--json", "-", *arguments)).stdout
        return json.loads(out)["lights"][0]["mask_hash"]

    def dump(self, name, *arguments, **changes):
        self.expect(OK, *small("--sets", 4, "--dump", self.directory / name, *arguments, **changes))
        return self.directory / name


class Usage(CommandLine):
    def test_an_unknown_verb_is_a_usage_error(self):
        self.expect_failure(USAGE, "paint")

    def test_no_verb_is_a_usage_error(self):
        self.expect_failure(USAGE)

    def test_help_and_version_go_to_standard_output(self):
        for arguments in (["--help"], ["render", "--help"], ["--version"]):
            self.assertNotEqual(self.expect(OK, *arguments).stdout, "")

    def test_an_unknown_option_is_a_usage_error(self):
        self.assertIn("--colour", self.expect_failure(USAGE, "render", "--colour", "red"))

    def test_a_wrong_size_is_a_usage_error(self):
        for size in ("64", "64x", "0x64", "64x64x64", "99999x1", "-1x64", "64 x 64", ""):
            with self.subTest(size=size):
                self.assertIn("--size", self.expect_failure(USAGE, "render", "--size", size))

    def test_a_wrong_crop_is_a_usage_error(self):
        for crop in ("0,64,0", "10,10,0,5", "0,65,0,64", "20,10,0,5", "0,8,0,8,", "a,b,c,d"):
            with self.subTest(crop=crop):
                self.assertIn("--crop", self.expect_failure(USAGE, "render", "--size", "64x64", "--crop", crop))

    def test_an_unknown_method_is_a_usage_error_that_lists_the_methods(self):
        message = self.expect_failure(USAGE, "render", "--method", "magic")
        self.assertIn("magic", message)
        self.assertIn("afsm", message)
        self.assertIn("oracle", message)

    def test_an_unknown_pattern_or_simd_target_is_a_usage_error(self):
        self.assertIn("rows", self.expect_failure(USAGE, "render", "--pattern", "zigzag"))
        self.assertIn("is not one of", self.expect_failure(USAGE, "render", "--simd", "MMX"))

    def test_light_samples_out_of_range_are_a_usage_error(self):
        for count in (0, 4097):
            with self.subTest(count=count):
                self.assertIn("1..4096", self.expect_failure(USAGE, *small(samples=count)))

    def test_an_unknown_builtin_scene_is_a_usage_error_that_lists_the_scenes(self):
        self.assertIn("columns", self.expect_failure(USAGE, "render", "builtin:moon"))

    def test_an_unknown_picture_ending_is_a_usage_error(self):
        self.assertIn(".exr", self.expect_failure(USAGE, *small("-o", self.directory / "picture.bmp")))


class Input(CommandLine):
    def test_a_missing_file_is_bad_input(self):
        path = self.directory / "nothing.obj"
        for verb in ("render", "info"):
            self.assertIn(str(path), self.expect_failure(BAD_INPUT, verb, path))

    def test_a_wrong_face_is_bad_input_with_file_and_line(self):
        path = self.directory / "wrong.obj"
        path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 9\n")
        self.assertIn(f"{path}:5", self.expect_failure(BAD_INPUT, "render", path))

    def test_a_missing_or_wrong_view_is_bad_input(self):
        view = self.directory / "wrong.view.json"
        self.expect_failure(BAD_INPUT, *small("--view", view))
        view.write_text('{"camera": ')
        self.assertIn(str(view), self.expect_failure(BAD_INPUT, *small("--view", view)))

    def test_a_dump_that_is_none_is_bad_input(self):
        self.expect_failure(BAD_INPUT, "verify", self.directory)
        self.expect_failure(BAD_INPUT, "compare", self.directory, self.directory)

    def test_a_truncated_array_of_a_dump_is_bad_input_that_names_it(self):
        masks = self.dump("dump") / "masks.npy"
        masks.write_bytes(masks.read_bytes()[:-1])
        self.assertIn("masks.npy", self.expect_failure(BAD_INPUT, "verify", self.directory / "dump"))


class Output(CommandLine):
    def test_an_output_that_cannot_be_written_is_an_output_error(self):
        (self.directory / "file").write_text("")
        below_a_file = self.directory / "file" / "x"
        for option, path in (("-o", self.directory / "missing" / "a.png"), ("-o", f"{below_a_file}.exr"),
                             ("--json", self.directory / "missing" / "a.json"), ("--dump", below_a_file)):
            with self.subTest(option=option, path=path):
                self.assertIn(str(path), self.expect(OUTPUT, *small(option, path)).stderr)

    def test_json_on_standard_output_is_all_there_is(self):
        result = self.expect(OK, *small("--json", "-", "-o", self.directory / "a.png"))
        stats = json.loads(result.stdout)
        self.assertEqual(stats["schema"], "halfshade.stats/1")
        self.assertRegex(stats["lights"][0]["mask_hash"], "^[0-9a-f]{32}$")

    def test_json_in_a_file_leaves_the_summary_on_standard_output(self):
        path = self.directory / "stats.json"
        summary = self.expect(OK, *small("--json", path)).stdout
        self.assertIn(json.loads(path.read_text())["lights"][0]["mask_hash"], summary)

    def test_the_same_command_writes_the_same_bytes(self):
        for ending, magic in (("png", b"\x89PNG\r\n\x1a\n"), ("exr", b"\x76\x2f\x31\x01")):
            path = self.directory / f"picture.{ending}"
            contents = []
            for wait in (1.1, 0):  # a time stamp in the file would differ
                self.expect(OK, *small("-o", path))
                contents.append(path.read_bytes())
                time.sleep(wait)
            self.assertTrue(contents[0].startswith(magic), ending)
            self.assertEqual(contents[0], contents[1], ending)
        self.assertEqual(sorted(os.listdir(self.directory)), ["picture.exr", "picture.png"])


class EqualBits(CommandLine):
    def test_masks_do_not_depend_on_the_number_of_threads(self):
        self.assertEqual(self.mask_hash("--threads", 1), self.mask_hash("--threads", 2))

    def test_masks_do_not_depend_on_the_instruction_set(self):
        targets = re.search("is not one of: (.*)", run("render", "--simd", "?").stderr).group(1).split(", ")
        hashes = {target: self.mask_hash("--simd", target) for target in targets}
        self.assertGreater(len(targets), 0)
        self.assertEqual(len(set(hashes.values())), 1, hashes)

    def test_the_method_agrees_with_the_oracle(self):
        self.assertEqual(self.mask_hash(), self.mask_hash("--method", "oracle"))
        self.expect(OK, *small("--verify", 100))

    def test_a_sun_gets_its_place_from_the_scene_in_memory_and_streamed(self):
        view = self.directory / "sun.json"
        view.write_text(json.dumps({"camera": {"eye": [0, 3, 7], "target": [0, 1, 0]}, "lights": [
            {"name": "sun", "type": "sun", "direction": [-0.4, -1, -0.3], "angular_diameter_deg": 2}]}))
        whole = self.expect(OK, *small("--view", view, "--method", "hpc", "--verify", 100)).stdout
        streamed = self.expect(OK, *small("--view", view, "--stream")).stdout
        hashes = [[line for line in text.splitlines() if "mask hash" in line] for text in (whole, streamed)]
        self.assertTrue(hashes[0])
        self.assertEqual(*hashes)

    def test_a_crop_has_the_masks_of_the_full_picture(self):
        full = masks_of_pixels(self.dump("full"))
        x0, x1, y0, y1 = 11, 39, 9, 27
        crop = masks_of_pixels(self.dump("crop", "--crop", f"{x0},{x1},{y0},{y1}"))
        inside = {p: m for p, m in full.items() if x0 <= p % 48 < x1 and y0 <= p // 48 < y1}
        self.assertGreater(len(inside), 100)
        self.assertEqual(crop, inside)


class Comparing(CommandLine):
    def changed_copy(self, dump):
        copy = self.directory / "changed"
        shutil.copytree(dump, copy)
        content = bytearray((copy / "masks.npy").read_bytes())
        content[-1] ^= 0x10
        (copy / "masks.npy").write_bytes(content)
        return copy

    def test_verify_accepts_a_dump_and_finds_one_changed_byte(self):
        dump = self.dump("dump")
        self.assertIn(" 0 wrong", self.expect(OK, "verify", dump).stdout)
        self.assertIn(" 1 wrong", self.expect(DIFFERENT, "verify", self.changed_copy(dump)).stdout)

    def test_verify_reads_alpha_textures(self):
        dump = self.directory / "fence"
        self.expect(OK, "render", "builtin:fence", "--size", "48x32", "--light-samples", 16, "--quiet", "--dump", dump)
        self.assertTrue((dump / "alpha_0.npy").exists())
        self.expect(OK, "verify", dump)

    def test_compare_tells_equal_dumps_from_different_ones(self):
        dump = self.dump("dump")
        self.expect(OK, "compare", dump, dump)
        self.expect(DIFFERENT, "compare", dump, self.changed_copy(dump))

    def test_compare_tells_equal_pictures_from_different_ones(self):
        a, b = self.directory / "a.png", self.directory / "b.png"
        self.expect(OK, *small("-o", a))
        self.expect(OK, *small("-o", b, samples=1))
        self.expect(OK, "compare", a, a)
        self.assertIn("FLIP         mean 0.00000", run("compare", a, a).stdout)
        difference, flip_map = self.directory / "difference.png", self.directory / "flip.png"
        self.expect(DIFFERENT, "compare", a, b, "--difference", difference, "--flip-map", flip_map)
        self.assertTrue(difference.exists())
        self.assertTrue(flip_map.read_bytes().startswith(b"\x89PNG"))
        flip = float(re.search(r"FLIP +mean ([0-9.]+)", run("compare", a, b).stdout).group(1))
        self.assertTrue(0 < flip < 0.5, flip)
        self.expect(OK, "compare", a, b, "--max-error", 1)

    def test_compare_refuses_what_cannot_be_compared(self):
        a, b = self.directory / "a.png", self.directory / "b.png"
        self.expect(OK, *small("-o", a))
        self.expect(OK, *small("-o", b, size="32x32"))
        self.expect_failure(BAD_INPUT, "compare", a, b)
        self.expect_failure(BAD_INPUT, "compare", self.dump("dump"), self.dump("other", samples=16))


class ApproximateMethods(CommandLine):
    def render(self, method, *arguments):
        result = run("render", "builtin:sphere:12", "--size", "40x30", "--light-samples", 16, "--quiet", "--method", method,
                     "--verify", 20, "--json", self.directory / "stats.json", *arguments)
        return result, json.loads((self.directory / "stats.json").read_text()) if result.returncode == OK else None

    def test_they_say_what_they_assume_and_how_wrong_they_are(self):
        for method in ("shadow-map", "pcf", "pcss", "shadow-accumulation", "shadow-maps"):
            with self.subTest(method=method):
                result, stats = self.render(method, "--set", "map.resolution=256")
                self.assertEqual(result.returncode, OK, result.stderr)
                assumes = re.search(r"^assumes +(\S.*)$", result.stdout, re.MULTILINE).group(1)
                light = stats["lights"][0]
                self.assertEqual(light["assumes"], assumes)
                self.assertEqual(stats["method"]["options"]["map.resolution"], "256")
                self.assertRegex(result.stdout, r"[+-]0\.\d+ \(mean")
                self.assertLessEqual(abs(light["verify"]["visibility_mean_error"]),
                                     light["verify"]["visibility_rms_error"])
                self.assertGreater(light["verify"]["visibility_rms_error"], 0.0)

    def test_rays_are_traced_or_refused(self):
        result, stats = self.render("raytrace", "--set", "raytrace.mode=fast")
        if result.returncode == OK:
            self.assertLess(stats["lights"][0]["verify"]["visibility_rms_error"], 0.01)
            self.assertIn("fast", stats["lights"][0]["assumes"])
        else:
            self.assertEqual(result.returncode, USAGE)
            self.assertIn("built without Embree", result.stderr)

    def test_options_out_of_range_are_named(self):
        result, _ = self.render("pcss", "--set", "pcss.search=0")
        self.assertEqual(result.returncode, USAGE)
        self.assertIn("pcss.search", result.stderr)


class Signals(CommandLine):
    def wait_for_handler(self, process, number):
        """Until the program catches the signal; before, it just dies of it. Linux only, elsewhere a second must do."""
        status = pathlib.Path(f"/proc/{process.pid}/status")
        if not status.exists():
            time.sleep(1.0)
            return
        caught = 0
        while not caught >> (number - 1) & 1 and process.poll() is None:
            time.sleep(0.01)
            caught = int(re.search(r"SigCgt:\s*([0-9a-f]+)", status.read_text()).group(1), 16)

    def stop(self, number, seconds):
        """Exit code and the seconds between the signal and the end, of a render that would take minutes."""
        command = [PROGRAM, "render", "builtin:hairball", "--size", "256x256", "--method", "oracle", "--quiet",
                   "-o", "picture.png", "--json", "stats.json", "--dump", "dump"]
        with subprocess.Popen(command, cwd=self.directory, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            self.wait_for_handler(process, number)
            time.sleep(seconds)
            self.assertIsNone(process.poll(), "the render ended before the signal")
            start = time.monotonic()
            process.send_signal(number)
            try:
                code = process.wait(timeout=30)
            except subprocess.TimeoutExpired:
                process.kill()
                raise
            return code, time.monotonic() - start

    def test_a_signal_stops_a_long_render_soon_and_leaves_no_file(self):
        for number, seconds in ((signal.SIGINT, 0.5), (signal.SIGINT, 1.7), (signal.SIGTERM, 0.9)):
            with self.subTest(signal=number, after=seconds):
                code, latency = self.stop(number, seconds)
                self.assertEqual(code, 128 + number)
                self.assertLess(latency, 1.0)
                self.assertEqual(os.listdir(self.directory), [])


if __name__ == "__main__":
    two_at_a_time.main()
