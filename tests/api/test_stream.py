"""render --stream: the masks of the whole scene, within the forecast, from built-in scenes and OBJ files.

Usage: test_stream.py PROGRAM
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

PROGRAM = os.path.abspath(sys.argv.pop(1)) if len(sys.argv) > 1 else "halfshade"
OK, USAGE, LIMIT, OUTPUT = 0, 2, 4, 5
SIZE = ("--size", "64x48", "--light-samples", 64, "--sets", 8, "--quiet")


def blinds(path):
    """A floor under slats of two materials; vertices are written long before the faces that use them."""
    vertices, faces = ["v -4 0 -4", "v -4 0 4", "v 4 0 4", "v 4 0 -4"], ["f 1 2 3 4"]
    for i in range(300):
        x, n = -3 + i * 0.02, len(vertices)
        vertices += [f"v {x} 1 -1", f"v {x + 0.01} 1.1 -1", f"v {x + 0.01} 1.1 1", f"v {x} 1 1"]
        faces += [f"usemtl m{i % 2}", f"f {n + 1} {n + 2} {n + 3} {n + 4}"]
    vertices.append("v 9 9 9")  # used by no face, yet part of the scene's box
    path.write_text("\n".join(vertices + faces) + "\n")


class Stream(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory(prefix="halfshade-stream-")
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)

    def render(self, *arguments, code=OK):
        result = subprocess.run([PROGRAM, "render", *map(str, arguments)], capture_output=True, text=True, timeout=120,
                                check=False)
        self.assertEqual(result.returncode, code, f"{arguments}\n{result.stdout}{result.stderr}")
        return result

    def statistics(self, *arguments, size=SIZE):
        return json.loads(self.render(*arguments, *size, "--json", "-").stdout)

    def check_equal(self, scene, *arguments):
        whole = self.statistics(scene, "--method", "exact", "-o", self.directory / "whole.png")
        streamed = self.statistics(scene, "--stream", "-o", self.directory / "streamed.png", *arguments)
        self.assertEqual([light["mask_hash"] for light in whole["lights"]],
                         [light["mask_hash"] for light in streamed["lights"]])
        self.assertEqual(streamed["scene"]["triangles"], whole["scene"]["triangles"])
        subprocess.run([PROGRAM, "compare", self.directory / "whole.png", self.directory / "streamed.png"], check=True,
                       stdout=subprocess.DEVNULL)
        return streamed

    def test_a_built_in_scene_made_in_pieces_gives_the_same_masks_and_picture(self):
        streamed = self.check_equal("builtin:grass:400", "--piece", 333)
        if "HALFSHADE_SANITIZED" not in os.environ:  # sanitizers keep freed memory
            self.assertLess(streamed["peak_rss_bytes"], streamed["forecast_bytes"])

    def test_a_scene_with_alpha_maps_gives_the_same_masks_and_picture(self):
        self.check_equal("builtin:demo:8", "--piece", 1000)

    def test_an_obj_gives_the_same_masks_and_picture(self):
        blinds(self.directory / "blinds.obj")
        self.check_equal(self.directory / "blinds.obj")

    def test_less_memory_means_more_parts_of_the_receivers_and_the_same_masks(self):
        large = ("--light-samples", 4096, "--size", "160x120", "--quiet")
        free = self.statistics("builtin:grass:400", "--stream", size=large)
        mib = int(free["forecast_bytes"] / 2**20) - 10
        tight = self.statistics("builtin:grass:400", "--stream", "--max-memory", mib, size=large)
        self.assertEqual(free["receiver_parts"], 1)
        self.assertGreater(tight["receiver_parts"], 1)
        self.assertEqual(free["lights"][0]["mask_hash"], tight["lights"][0]["mask_hash"])
        self.assertLessEqual(tight["forecast_bytes"], mib * 2**20)

    def test_a_limit_that_cannot_be_kept_is_refused_with_what_would_be_needed(self):
        message = self.render("builtin:grass:400", "--stream", "--max-memory", 20, code=LIMIT).stderr
        self.assertIn("--max-memory 20: at least", message)

    def test_what_needs_the_whole_scene_is_refused(self):
        for arguments in (("--method", "afsm"), ("--shading", "bent"), ("--verify", 1), ("--dump", "dump")):
            self.render("builtin:grass:400", "--stream", *arguments, code=USAGE)

    def test_no_bucket_file_is_left_behind_and_a_missing_directory_is_an_output_error(self):
        buckets = self.directory / "buckets"
        buckets.mkdir()
        self.statistics("builtin:grass:400", "--stream", "--stream-dir", buckets)
        self.assertEqual(os.listdir(buckets), [])
        self.render("builtin:grass:400", "--stream", "--stream-dir", buckets / "none", code=OUTPUT)


if __name__ == "__main__":
    unittest.main()
