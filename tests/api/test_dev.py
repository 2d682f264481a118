#!/usr/bin/env python3
"""./dev chart and ./dev atlas: what they start. Everything they call is a stand-in that notes its arguments, so that
nothing is built, installed or measured. Standard library only.

Usage: test_dev.py [unittest arguments]
"""

import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

SOURCES = pathlib.Path(__file__).resolve().parents[2]
# In the place of the program: notes its arguments, and writes chart.json or atlas.json as the real one does.
PROGRAM = """#!/bin/bash
echo "halfshade $*" >>"$NOTES"
[[ " $* " == *" --help "* ]] && exit
mkdir -p "${@: -1}" && touch "${@: -1}/$1.json"
"""
SCRIPT = """import os, pathlib, sys
with open(os.environ["NOTES"], "a") as notes:
    print(pathlib.Path(sys.argv[0]).name, *sys.argv[1:], file=notes)
if not pathlib.Path(sys.argv[1]).exists():
    sys.exit("there is no " + sys.argv[1])
"""


def write_program(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    path.chmod(0o755)


class Dev(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory(prefix="halfshade-dev-")
        self.addCleanup(self.scratch.cleanup)
        root = pathlib.Path(self.scratch.name)
        self.project, self.notes, self.tools = root / "project", root / "notes", root / "tools"
        (root / "shared/scenes").mkdir(parents=True)
        write_program(self.project / "build/examples/halfshade/halfshade", PROGRAM)
        (self.project / "build/build.ninja").touch()
        shutil.copy(SOURCES / "dev", self.project / "dev")
        for script in ("plot_chart.py", "chart_report.py", "atlas_report.py"):
            write_program(self.project / "bench" / script, SCRIPT)
        # No apt-get and no dpkg here: nothing can be installed.
        for tool in ("cmake", "ninja", "c++", "pkg-config", "git", "clang-format"):
            write_program(self.tools / tool, "#!/bin/bash\n")
        write_program(self.tools / "c++", "#!/bin/bash\ncat >/dev/null\n")  # it is given headers: none is missing
        write_program(self.tools / "python3", f'#!/bin/bash\n[[ $1 == -c ]] || exec "{sys.executable}" "$@"\n')
        for tool in ("bash", "dirname", "sed", "cat", "mkdir", "touch", "mktemp", "rm"):
            (self.tools / tool).symlink_to(shutil.which(tool))

    def dev(self, *arguments):
        """Lines that were noted."""
        run = subprocess.run([self.project / "dev", *arguments], capture_output=True, text=True, timeout=60, check=False,
                             env={"PATH": str(self.tools), "NOTES": str(self.notes)})
        self.assertEqual(run.returncode, 0, run.stderr)
        return self.notes.read_text(encoding="utf-8").splitlines()

    def test_help_is_all_that_happens_when_help_is_asked_for(self):
        for verb, option in (("chart", "--help"), ("chart", "-h"), ("atlas", "--help"), ("atlas", "-h")):
            with self.subTest(verb=verb, option=option):
                self.notes.write_text("")
                self.assertEqual(self.dev(verb, option), [f"halfshade {verb} --help"])
        self.notes.write_text("")
        self.assertEqual(self.dev("chart", "--quick", "--help"), ["halfshade chart --help"])

    def test_a_chart_is_measured_plotted_and_packed_with_an_atlas(self):
        self.assertEqual(self.dev("chart", "--size", "64x64", "builtin:demo"), [
            "halfshade chart --shared-scenes ../shared/scenes --size 64x64 builtin:demo -o out/chart",
            "plot_chart.py out/chart/chart.json -o out/chart/chart",
            "halfshade atlas --quick -o out/chart/atlas",
            "chart_report.py out/chart/chart.json --atlas out/chart/atlas/atlas.json -o out/chart/report.html"])

    def test_a_quick_chart_has_a_directory_of_its_own(self):
        for line in self.dev("chart", "--quick", "--repeat", "1"):
            self.assertNotIn("out/chart/", line)
            self.assertIn("out/chart-quick", line)

    def test_the_atlas_is_measured_and_packed(self):
        self.assertEqual(self.dev("atlas", "wire"), [
            "halfshade atlas wire -o out/atlas",
            "atlas_report.py out/atlas/atlas.json -o out/atlas/report.html"])


if __name__ == "__main__":
    unittest.main()
