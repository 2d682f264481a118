#!/usr/bin/env python3
"""render --part and merge from outside: parts come to the bytes of one run, and what does not fit is refused.
Standard library only.

Usage: test_parts.py HALFSHADE [unittest arguments]
"""

import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "tools"))
import two_at_a_time  # noqa: E402

PROGRAM = os.path.abspath(sys.argv.pop(1)) if len(sys.argv) > 1 else "halfshade"
OK, DIFFERENT, USAGE, BAD_INPUT, LIMIT, OUTPUT = range(6)

TWO_LIGHTS = {"camera": {"eye": [9, 6, 9], "target": [0, 1, 0], "up": [0, 1, 0], "fov_y_deg": 45},
              "lights": [{"name": "area", "type": "rectangle", "center": [3, 8, 2], "u": [2, 0, 0], "v": [0, 0, 2],
                          "two_sided": True},
                         {"name": "spot", "type": "point", "position": [-4, 9, 1]}]}
BALL = {"camera": TWO_LIGHTS["camera"],
        "lights": [{"name": "ball", "type": "sphere", "center": [3, 8, 2], "radius": 1.0, "emission": [1, 0.8, 0.5]}]}


def files_of(directory):
    return {str(path.relative_to(directory)): path.read_bytes() for path in sorted(directory.rglob("*")) if path.is_file()}


class Parts(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory(prefix="halfshade-parts-")
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)
        (self.directory / "two.view.json").write_text(json.dumps(TWO_LIGHTS))
        (self.directory / "ball.view.json").write_text(json.dumps(BALL))

    def run_program(self, *arguments):
        return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=300, check=False)

    def expect(self, code, *arguments):
        result = self.run_program(*arguments)
        self.assertEqual(result.returncode, code, f"{arguments}\n{result.stdout}{result.stderr}")
        return result

    def parts(self, name, split, count, *arguments):
        directories = [self.directory / f"{name}-{split}-{count}-{i}" for i in range(1, count + 1)]
        for i, directory in enumerate(directories, 1):
            self.expect(OK, "render", *arguments, "-q", "--split", split, "--part", f"{i}/{count}", "-o", directory)
        return directories

    def check(self, name, splits, *arguments):
        """For each (split, n): EXR with all layers, mask hashes and dump of one run."""
        whole = self.directory / f"{name}.exr"
        out = self.expect(OK, "render", *arguments, "-q", "-o", whole, "--dump", self.directory / name, "--json", "-")
        hashes = [light["mask_hash"] for light in json.loads(out.stdout)["lights"]]
        for split, count in splits:
            with self.subTest(name=name, split=split, count=count):
                parts = self.parts(name, split, count, *arguments)
                merged, dump = self.directory / "merged.exr", self.directory / "merged"
                shutil.rmtree(dump, ignore_errors=True)
                out = self.expect(OK, "merge", *reversed(parts), "-o", merged, "--dump", dump, "--json", "-")
                self.assertEqual([light["mask_hash"] for light in json.loads(out.stdout)["lights"]], hashes)
                self.assertEqual(merged.read_bytes(), whole.read_bytes())
                self.assertEqual(files_of(dump), files_of(self.directory / name))


class Equal(Parts):
    def test_an_opaque_scene(self):
        self.check("columns", [("crop", 1), ("crop", 3), ("samples", 5), ("blockers", 7)],
                   "builtin:columns", "--size", "60x41", "--light-samples", 100)

    def test_alpha_tested_blockers_and_sets(self):
        self.check("fence", [("crop", 4), ("samples", 3), ("blockers", 3)],
                   "builtin:fence", "--size", "48x33", "--light-samples", 64, "--sets", 3, "--spp", 4, "--seed", 5)

    def test_two_lights_of_which_one_has_a_single_sample(self):
        self.check("two", [("crop", 2), ("samples", 3), ("blockers", 2)], "builtin:columns", "--view",
                   self.directory / "two.view.json", "--size", "40x30", "--crop", "3,37,5,28", "--shading", "bent")

    def test_a_light_that_is_not_flat(self):
        self.check("ball", [("crop", 2), ("samples", 3), ("blockers", 2)], "builtin:columns", "--view",
                   self.directory / "ball.view.json", "--size", "40x30", "--light-samples", 70)

    def test_translucent_triangles(self):
        self.check("glass", [("crop", 3), ("samples", 2), ("blockers", 2)], "builtin:glass", "--size", "40x30",
                   "--light-samples", 32)

    def test_other_methods(self):
        # Parts of a picture are renders of a crop, which test_cli compares; so each method but one proves two splits.
        for method, splits in (("afsm", ("samples", "blockers")), ("hpc", ("samples", "blockers")),
                               ("gears", ("crop", "blockers")), ("stsv", ("crop", "samples", "blockers"))):
            self.check(method, [(split, 2) for split in splits], "builtin:fence", "--size", "32x24",
                       "--light-samples", 36, "--method", method)

    def test_more_parts_than_samples_or_triangles(self):
        (self.directory / "one.obj").write_text("v -1 0 -1\nv 1 0 -1\nv 0 0 1\nv -.2 1 -.2\nv .2 1 -.2\nv 0 1 .2\n"
                                                "f 1 3 2\nf 4 5 6\n")
        self.check("one", [("samples", 5), ("blockers", 3)], self.directory / "one.obj", "--size", "20x14",
                   "--light-samples", 4)

    def test_frames(self):
        for name, counts, arguments in (
                ("still", (1, 7), ("builtin:fence", "--sets", 2)),
                ("jitter", (3,), ("builtin:columns", "--jitter-camera", "--spp", 4)),
                ("two", (2,), ("builtin:columns", "--view", self.directory / "two.view.json"))):
            arguments = (*arguments, "--size", "40x30", "--light-samples", 16, "--frames", 7)
            pattern = self.directory / f"{name}_%d.exr"
            self.expect(OK, "accumulate", *arguments, "-q", "--reference-samples", 0, "-o", pattern)
            whole = (self.directory / f"{name}_6.exr").read_bytes()
            for count in counts:
                with self.subTest(name=name, count=count):
                    parts = self.parts(name, "frames", count, *arguments)
                    merged = self.directory / "merged.exr"
                    self.expect(OK, "merge", *reversed(parts), "-o", merged)
                    self.assertEqual(merged.read_bytes(), whole)

    def test_a_png_and_a_verified_merge(self):
        arguments = ("builtin:fence", "--size", "40x30", "--light-samples", 16)
        self.expect(OK, "render", *arguments, "-q", "-o", self.directory / "whole.png")
        parts = self.parts("png", "blockers", 3, *arguments)
        out = self.expect(OK, "merge", *parts, "-o", self.directory / "merged.png", "--verify", 100).stdout
        self.assertIn(" 0 wrong", out)
        self.assertEqual((self.directory / "merged.png").read_bytes(), (self.directory / "whole.png").read_bytes())

    def test_a_scene_that_has_moved(self):
        scene = self.directory / "here" / "a.obj"
        scene.parent.mkdir()
        scene.write_text("v -1 0 -1\nv 1 0 -1\nv 0 0 1\nv -.2 1 -.2\nv .2 1 -.2\nv 0 1 .2\nf 1 3 2\nf 4 5 6\n")
        parts = self.parts("moved", "samples", 2, scene, "--size", "20x14")
        scene.parent.rename(self.directory / "there")
        self.assertIn("a.obj", self.expect(BAD_INPUT, "merge", *parts).stderr)
        moved = self.directory / "there" / "a.obj"
        self.expect(OK, "merge", *parts, "--scene", moved)
        moved.write_text(moved.read_text().replace(".2 1", ".3 1"))
        self.assertIn("scene hash", self.expect(BAD_INPUT, "merge", *parts, "--scene", moved).stderr)


class Refused(Parts):
    SCENE = ("builtin:columns", "--size", "32x24", "--light-samples", 16)

    def refuse(self, *arguments):
        output = self.directory / "out.png"
        message = self.expect(BAD_INPUT, "merge", *arguments, "-o", output).stderr
        self.assertFalse(output.exists())
        return message

    def test_gaps_and_overlaps(self):
        for split, missing, twice in (("crop", "rows 8..15", "rows 16..23"),
                                      ("frames", "frames 2..3", "frames 4..5"),
                                      ("samples", "light samples 4..7", "light samples 8..15"),
                                      ("blockers", "triangles ", "triangles ")):
            with self.subTest(split=split):
                parts = self.parts("a", split, 3, *self.SCENE, *(("--frames", 6) if split == "frames" else ()))
                message = self.refuse(parts[0], parts[2])
                self.assertIn(missing, message)
                self.assertIn("none of the 2 parts", message)
                message = self.refuse(*parts, parts[2])
                self.assertIn(twice, message)
                self.assertIn(f"both {parts[2]} and {parts[2]}", message)
                if split == "crop":
                    self.assertIn("both", self.refuse(parts[0], *self.parts("b", split, 2, *self.SCENE)))

    def test_parts_of_different_renders(self):
        first = self.parts("a", "crop", 2, *self.SCENE)[0]
        others = {"options": ("--seed", 3), "scene hash": (), "split": (), "view hash": (), "light samples hash": ()}
        view = self.directory / "v.view.json"
        view.write_text(json.dumps({**TWO_LIGHTS, "lights": [{**TWO_LIGHTS["lights"][0], "name": "sun"}]}))
        for what, extra in others.items():
            with self.subTest(what=what):
                scene = self.SCENE if what != "scene hash" else ("builtin:columns:3", *self.SCENE[1:])
                split = "crop" if what != "split" else "samples"
                second = self.parts(what.replace(" ", "-"), split, 2, *scene, *extra)[1]
                if what in ("view hash", "light samples hash"):
                    manifest = json.loads((second / "part.json").read_text())
                    if what == "view hash":
                        manifest["view_hash"] = "0" * 32
                    else:
                        manifest["lights"][0]["samples_hash"] = "0" * 32
                    (second / "part.json").write_text(json.dumps(manifest))
                message = self.refuse(first, second)
                self.assertIn(what, message)
                self.assertIn(str(second), message)

    def test_damaged_masks_and_counts(self):
        for split, name in (("crop", "masks_0.npy"), ("blockers", "masks_0.npy"), ("samples", "masks_0.npy"),
                            ("frames", "counts.state")):
            parts = self.parts("a", split, 2, *self.SCENE)
            file = parts[1] / name
            content = bytearray(file.read_bytes())
            content[-1] ^= 1
            for damaged in (bytes(content), *((bytes(content[:-1]), b"") if split in ("crop", "frames") else ())):
                with self.subTest(split=split, length=len(damaged)):
                    file.write_bytes(damaged)
                    self.assertIn(str(file), self.refuse(*parts))
            file.unlink()
            self.assertIn(str(file), self.refuse(*parts))

    def test_masks_of_other_receivers(self):
        parts = self.parts("a", "crop", 2, *self.SCENE)
        manifest = json.loads((parts[1] / "part.json").read_text())
        manifest["lights"][0]["receivers_hash"] = "0" * 32
        (parts[1] / "part.json").write_text(json.dumps(manifest))
        self.assertIn("receivers", self.refuse(*parts))

    def test_damaged_manifests(self):
        parts = self.parts("a", "samples", 2, *self.SCENE)
        file = parts[1] / "part.json"
        good = json.loads(file.read_text())
        light = good["lights"][0]
        wrong = [b"", b"{", b"[]", b"null", *(json.dumps({k: v for k, v in good.items() if k != key}).encode()
                                               for key in good)]
        for change in ({"range": [5, 2]}, {"range": [0, 99]}, {"range": "all"}, {"file": "../masks_0.npy"},
                       {"file": ""}, {"receivers": -1}, {"receivers": 1 << 40}, {"samples": 5}):
            wrong.append(json.dumps({**good, "lights": [{**light, **change}]}).encode())
        for change in ({"lights": []}, {"arguments": ["--nonsense"]}, {"arguments": "x"}, {"split": "half"},
                       {"schema": "halfshade.part/9"}):
            wrong.append(json.dumps({**good, **change}).encode())
        for content in wrong:
            with self.subTest(content=content[:200]):
                file.write_bytes(content)
                self.assertIn(str(parts[1]), self.refuse(*parts))
        both = []
        for part in parts:  # nonsense that all parts agree in
            manifest = json.loads((part / "part.json").read_text()) if part != parts[1] else good
            both.append(json.dumps({**manifest, "arguments": ["--nonsense"]}))
        for part, content in zip(parts, both):
            (part / "part.json").write_text(content)
        self.assertIn("--nonsense", self.refuse(*parts))

    def test_a_part_that_was_not_finished(self):
        parts = self.parts("a", "crop", 2, *self.SCENE)
        (parts[0] / "part.json").unlink()
        self.assertIn("not finished", self.refuse(*parts))
        self.assertIn("nothing-here", self.refuse(self.directory / "nothing-here"))

    def test_wrong_options_are_usage_errors(self):
        part = self.directory / "p"
        for extra in (("--part", "0/2"), ("--part", "3/2"), ("--part", "1"), ("--part", "1/2x"), ("--part", "a/b"),
                      ("--part", "1/2", "--split", "half"), ("--part", "1/2", "--method", "pcss"),
                      ("--part", "1/2", "--method", "afsm-lut"), ("--part", "1/2", "--resume"),
                      ("--part", "1/2", "--stream"), ("--part", "1/2", "--dump", part), ("--part", "1/25"),
                      ("--part", "25/25"), ("--part", "9/9", "--split", "frames", "--frames", 4),
                      ("--part", "1/2", "--split", "frames", "--frames", 0), ("--resume", "--method", "raytrace")):
            with self.subTest(extra=extra):
                self.expect(USAGE, "render", *self.SCENE, "-o", part, *extra)
                self.assertFalse((part / "part.json").exists())
        self.expect(USAGE, "render", *self.SCENE, "--part", "1/2")
        self.expect(USAGE, "merge")

    def test_a_part_that_cannot_be_written(self):
        (self.directory / "file").write_text("")
        message = self.expect(OUTPUT, "render", *self.SCENE, "--part", "1/2", "-o", self.directory / "file").stderr
        self.assertIn("file", message)


if __name__ == "__main__":
    two_at_a_time.main()
