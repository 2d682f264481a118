#!/usr/bin/env python3
"""What does `--max-error` save, and is the error kept on every receiver?

  bench/max_error.py HALFSHADE SCENE... [--size 96x96] [--goals 1/64 1/256] [--repeat 3] [--timeout 240]
                     [--json FILE]

A goal `equal` is the largest error of 256 fixed samples on the scene, measured first: then both are equally accurate.

Runs `halfshade recommend SCENE --max-error E --json` for every scene and goal: all settings interleaved in one process,
medians of --repeat runs, errors over all receivers against 16,384 to 262,144 low-discrepancy samples. Times are
processor time of one thread, with the build of the tree, because other programs hardly change it. Prints a Markdown
table: the time of `--max-error E`, that of 256 fixed samples (method exact, rows), the largest errors of both,
and two fixed settings to compare with (method exact, either pattern): the cheapest that is as accurate as `--max-error`
turned out, and the cheapest that keeps the goal on this view, known by hindsight, each with its time as a multiple of
ours; how many receivers are above the goal. Exit code 1 if any is. Without scenes: all built-in ones.
"""

import argparse
import json
import pathlib
import subprocess
import sys


def recommend(program, scene, size, goal, repeat, seconds):
    """None where it takes longer than `seconds`."""
    try:
        run = subprocess.run([program, "recommend", scene, "--size", size, "--max-error", goal, "--repeat", str(repeat),
                              "--threads", "1", "--json", "--quiet"], capture_output=True, text=True, timeout=seconds)
    except subprocess.TimeoutExpired:
        return None
    if run.returncode not in (0, 1):
        sys.exit(f"{scene}: {run.stderr.strip()}")
    return json.loads(run.stdout)


def error_of_256(program, scene, size, seconds):
    """The largest, of all lights, as a goal; None where it takes longer than `seconds`."""
    report = recommend(program, scene, size, "1/16", 1, seconds)
    if report is None:
        return None
    bases = [points_of(light).get("--method exact --pattern rows --light-samples 256") for light in report["lights"]]
    return f"{min(0.25, max(b['max'] for b in bases if b is not None)):.5f}"


def builtin_scenes(program):
    text = subprocess.run([program, "info"], check=True, capture_output=True, text=True).stdout
    return ["builtin:" + line.split()[0] for line in text.splitlines() if line[:2] == "  " and line[2:3] not in ("", " ")]


def points_of(light):
    return {p["setting"]: p for p in light["points"] if "reason" not in p}


def row(scene, goal, report, light):
    points = points_of(light)
    adaptive = points.get(f"--max-error {goal}")
    base = points.get("--method exact --pattern rows --light-samples 256")
    if adaptive is None or base is None:
        return None
    def cheapest(wanted):
        fixed = [p for name, p in points.items() if name.startswith("--method exact") and p["max"] <= wanted]
        best = min(fixed, key=lambda p: p["cpu_ms"], default=None)
        if best is None:
            return None
        return [best["setting"].removeprefix("--method exact --pattern ").replace(" --light-samples", ""), best["cpu_ms"]]

    return {"scene": pathlib.PurePath(scene).stem, "light": light["name"], "goal": goal,
            "receivers": light["receivers"], "ms": adaptive["cpu_ms"], "ms_256": base["cpu_ms"],
            "max": adaptive["max"], "rmse": adaptive["rmse"], "max_256": base["max"], "rmse_256": base["rmse"],
            "above": round(adaptive["share_above"] * light["receivers"]),
            "as_accurate": cheapest(adaptive["max"]), "keeps_goal": cheapest(report["max_error"])}


def fixed_cell(fixed, ms):
    return "none" if fixed is None else f"{fixed[0]}: {fixed[1] / ms:.2f}"


def print_table(rows):
    print("| scene | goal | receivers | above | largest error | ms | ms of 256 | error of 256 | as accurate: time / ours | "
          "keeps the goal: time / ours |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for r in rows:
        print(f"| {r['scene']} | {r['goal']} | {r['receivers']} | {r['above']} | {r['max']:.5f} | "
              f"{r['ms']:.4g} | {r['ms_256']:.4g} | {r['max_256']:.4f} | {fixed_cell(r['as_accurate'], r['ms'])} | "
              f"{fixed_cell(r['keeps_goal'], r['ms'])} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("halfshade")
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--size", default="96x96")
    parser.add_argument("--goals", nargs="+", default=["1/64", "1/256"])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--timeout", type=float, default=240.0, help="seconds for a scene and goal")
    parser.add_argument("--json")
    arguments = parser.parse_args()
    rows = []
    for scene in arguments.scenes or builtin_scenes(arguments.halfshade):
        for goal in arguments.goals:
            if goal == "equal":
                goal = error_of_256(arguments.halfshade, scene, arguments.size, arguments.timeout)
            report = goal and recommend(arguments.halfshade, scene, arguments.size, goal, arguments.repeat,
                                        arguments.timeout)
            if report is None:
                print(f"{scene} {goal}: not done within {arguments.timeout} s", file=sys.stderr)
                continue
            rows += filter(None, (row(scene, goal, report, light) for light in report["lights"]))
            print(f"{scene} {goal}", file=sys.stderr)
    print_table(rows)
    if arguments.json:
        pathlib.Path(arguments.json).write_text(json.dumps(rows, indent=1) + "\n")
    return 1 if any(r["above"] for r in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
