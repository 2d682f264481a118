#!/usr/bin/env python3
"""What does dividing a render cost? Processor time and wall time of 1, 2, 4 and 8 parts, two jobs of one thread each at a
time, and of merging them, against one run with two threads. Standard library only.

Usage: farm_cost.py HALFSHADE [SCENE and options of halfshade render]
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import time

JOBS = 2


def finished(command):
    """(processor seconds, wall seconds) of a command."""
    start = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"{command} ended with {process.returncode}")
    return usage.ru_utime + usage.ru_stime, time.monotonic() - start


def all_finished(commands):
    """The same for several commands, JOBS at a time."""
    start, waiting, running, processor = time.monotonic(), list(commands), {}, 0.0
    while waiting or running:
        while waiting and len(running) < JOBS:
            process = subprocess.Popen(waiting.pop(0), stdout=subprocess.DEVNULL)
            running[process.pid] = process
        pid, status, usage = os.wait3(0)
        process = running.pop(pid)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode != 0:
            sys.exit(f"{process.args} ended with {process.returncode}")
        processor += usage.ru_utime + usage.ru_stime
    return processor, time.monotonic() - start


def main():
    program, scene = os.path.abspath(sys.argv[1]), sys.argv[2:] or ["builtin:demo", "--size", "1024x1024"]
    render = [program, "render", *scene, "--quiet"]
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        whole = scratch / "whole.png"
        one_processor, one_wall = finished([*render, "--threads", str(JOBS), "-o", whole])
        print(f"{' '.join(scene)}: one run, {JOBS} threads: {one_processor:.2f} s processor, {one_wall:.2f} s wall\n")
        print("| split | parts | processor s | of one run | wall s | of one run | merge, wall s |\n|---|---|---|---|---|---|---|")
        for split in ("crop", "samples", "blockers"):
            for count in (1, 2, 4, 8):
                parts = [scratch / f"{split}{count}-{i}" for i in range(1, count + 1)]
                processor, wall = all_finished([*render, "--threads", "1", "--split", split, "--part", f"{i}/{count}",
                                                "-o", part] for i, part in enumerate(parts, 1))
                merged = scratch / "merged.png"
                _, merge_wall = finished([program, "merge", *parts, "-o", merged])
                if merged.read_bytes() != whole.read_bytes():
                    sys.exit(f"{split}, {count} parts: not the bytes of one run")
                print(f"| `{split}` | {count} | {processor:.2f} | {processor / one_processor:.2f} | {wall:.2f} | "
                      f"{wall / one_wall:.2f} | {merge_wall:.2f} |", flush=True)


if __name__ == "__main__":
    main()
