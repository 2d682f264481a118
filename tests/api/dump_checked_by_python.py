#!/usr/bin/env python3
"""Renders small scenes with --dump and hands the dumps to the independent checker: all bits right, a changed bit found.

Usage: dump_checked_by_python.py HALFSHADE CHECK_DUMP
"""

import pathlib
import subprocess
import sys
import tempfile

RECEIVERS = 200
SKIP = 77  # what the checker returns without numpy


def render(program, scene, directory):
    subprocess.run([program, "render", scene, "--size", "64x64", "--light-samples", "64", "--sets", "2",
                    "--dump", directory, "--quiet"], check=True, stdout=subprocess.DEVNULL)


def run_checker(checker, directory, receivers):
    run = subprocess.run([sys.executable, checker, directory, "--receivers", str(receivers)],
                         stdout=subprocess.PIPE, text=True, check=False)
    print(run.stdout, end="", flush=True)
    return run.returncode, run.stdout


def flip_every_mask(directory):
    """One bit of each receiver, so that whichever the checker chooses, it must object."""
    path = directory / "masks.npy"
    content = bytearray(path.read_bytes())
    bytes_per_receiver = 64 // 8
    header = (len(content) - 128) % bytes_per_receiver + 128  # 128 bytes, or a later multiple of 64
    for i in range(header, len(content), bytes_per_receiver):
        content[i] ^= 1
    path.write_bytes(content)


def main():
    program, checker = sys.argv[1:]
    with tempfile.TemporaryDirectory() as scratch:
        for scene in ("builtin:fence", "builtin:columns"):
            directory = pathlib.Path(scratch) / scene.partition(":")[2]
            render(program, scene, directory)
            print(f"== {scene}", flush=True)
            code, _ = run_checker(checker, directory, RECEIVERS)
            if code != 0:
                return code
            flip_every_mask(directory)
            print("== the same with changed bits, which the checker must find", flush=True)
            code, text = run_checker(checker, directory, 3)
            if code != 1 or "3 bits in 3 receivers" not in text:
                return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
