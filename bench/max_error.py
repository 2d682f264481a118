#!/usr/bin/env python3
"""What does `--max-error` save, and is the error kept on every receiver?

  bench/max_error.py HALFSHADE SCENE... [--size 96x96] [--goals 1/64 1/256] [--repeat 3] [--json FILE]

Runs `halfshade recommend SCENE --max-error E --json` for every scene and goal: all settings interleaved in one process,
medians of --repeat runs, errors over all receivers against 16,384 low-discrepancy samples. Prints a Markdown table: the
time of `--max-error E` as a multiple of 256 fixed samples (method exact, rows), the errors of both, the cheapest fixed
number of samples (method exact, either pattern) that is as accurate as `--max-error` was (largest error, or the goal if
that is larger) and the time it takes, and how many receivers are above the goal. Exit code 1 if any is. Without scenes:
all built-in ones.
"""

import argparse
import json
import pathlib
import subprocess
import sys


def recommend(program, scene, size, goal, repeat):
    run = subprocess.run([program, "recommend", scene, "--size", size, "--max-error", goal, "--repeat", str(repeat),
                          "--json", "--quiet"], capture_output=True, text=True)
    if run.returncode not in (0, 1):
        sys.exit(f"{scene}: {run.stderr.strip()}")
    return json.loads(run.stdout)


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
    wanted = max(adaptive["max"], report["max_error"])
    equal = [p for name, p in points.items() if name.startswith("--method exact") and p["max"] <= wanted]
    cheapest = min(equal, key=lambda p: p["shadow_ms"], default=None)
    return {"scene": pathlib.PurePath(scene).stem, "light": light["name"], "goal": goal,
            "receivers": light["receivers"], "ms": adaptive["shadow_ms"], "ms_256": base["shadow_ms"],
            "max": adaptive["max"], "rmse": adaptive["rmse"], "max_256": base["max"], "rmse_256": base["rmse"],
            "above": round(adaptive["share_above"] * light["receivers"]),
            "fixed": None if cheapest is None else cheapest["setting"].removeprefix("--method exact --pattern "),
            "fixed_ms": None if cheapest is None else cheapest["shadow_ms"],
            "most_ms": max((p["shadow_ms"] for n, p in points.items() if n.startswith("--method exact")
                            and n.endswith(" 4096")), default=None)}


def print_table(rows):
    print("| scene | goal | receivers | above goal | max error | RMSE | time / time of 256 | max error of 256 | "
          "equal fixed setting | its time / ours |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for r in rows:
        fixed, factor = r["fixed"], ""
        if fixed is None:
            fixed, factor = "none up to 4096", "" if r["most_ms"] is None else f"> {r['most_ms'] / r['ms']:.2f}"
        else:
            fixed, factor = fixed.replace(" --light-samples", ""), f"{r['fixed_ms'] / r['ms']:.2f}"
        print(f"| {r['scene']} | {r['goal']} | {r['receivers']} | {r['above']} | {r['max']:.5f} | {r['rmse']:.5f} | "
              f"{r['ms'] / r['ms_256']:.2f} | {r['max_256']:.4f} | {fixed} | {factor} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("halfshade")
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--size", default="96x96")
    parser.add_argument("--goals", nargs="+", default=["1/64", "1/256"])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json")
    arguments = parser.parse_args()
    rows = []
    for scene in arguments.scenes or builtin_scenes(arguments.halfshade):
        for goal in arguments.goals:
            report = recommend(arguments.halfshade, scene, arguments.size, goal, arguments.repeat)
            rows += filter(None, (row(scene, goal, report, light) for light in report["lights"]))
            print(f"{scene} {goal}", file=sys.stderr)
    print_table(rows)
    if arguments.json:
        pathlib.Path(arguments.json).write_text(json.dumps(rows, indent=1) + "\n")
    return 1 if any(r["above"] for r in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
