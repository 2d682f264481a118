#!/usr/bin/env python3
"""How far is the visibility of N samples from that of the whole light, for each sample pattern?

  bench/sampling_error.py HALFSHADE [--scenes builtin:columns builtin:demo] [--size 128x128] [--counts 16 64 256]

Every number is the root mean square error of V over all receivers of a picture, against the mean of four renders with
4096 stratified samples and different seeds (16,384 samples per receiver). Seeded patterns are averaged (in the mean
square) over --seeds seeds other than those of the reference. All visibility is exact, so what remains is the error of
sampling alone. Prints a Markdown table, the reference's own error estimated from the spread of its four parts, and with
--json writes all numbers. Needs numpy.
"""

import argparse
import json
import pathlib
import subprocess
import tempfile

import numpy as np

REFERENCE_SEEDS = range(1000, 1004)
PATTERNS = {  # name in the table: options, has seeds
    "uniform": (["--pattern", "uniform"], False),
    "rows": (["--pattern", "rows"], False),
    "stratified": (["--pattern", "stratified"], True),
    "low-discrepancy": (["--pattern", "low-discrepancy"], True),
    "poisson-disk": (["--pattern", "poisson-disk"], True),
    "rows, 16 interleaved sets": (["--pattern", "rows", "--interleave"], False),
    "stratified, 16 interleaved sets": (["--pattern", "stratified", "--interleave"], True),
    "low-discrepancy, 16 interleaved sets": (["--pattern", "low-discrepancy", "--interleave"], True),
    "poisson-disk, 16 interleaved sets": (["--pattern", "poisson-disk", "--interleave"], True),
}


def visibility(program, scene, size, samples, seed, options):
    """V of every pixel (0 where no receiver is) and which pixels are receivers."""
    with tempfile.TemporaryDirectory(prefix="halfshade-sampling-") as directory:
        subprocess.run([program, "render", scene, "--size", size, "--light-samples", str(samples), "--seed", str(seed),
                        "--quiet", "--dump", directory, *options], check=True, stdout=subprocess.DEVNULL)
        dump = pathlib.Path(directory)
        about = json.loads((dump / "dump.json").read_text())
        blocked = np.unpackbits(np.load(dump / "masks.npy"), axis=1, bitorder="little").sum(axis=1)
        pixels = np.load(dump / "receiver_pixels.npy")
    values = np.zeros(about["width"] * about["height"])
    is_receiver = np.zeros(values.size, bool)
    values[pixels] = 1.0 - blocked / about["counts"]["samples"]
    is_receiver[pixels] = True
    return values, is_receiver


def reference(program, scene, size):
    parts = [visibility(program, scene, size, 4096, seed, PATTERNS["stratified"][0]) for seed in REFERENCE_SEEDS]
    values = np.array([v for v, _ in parts])
    receivers = np.any([r for _, r in parts], axis=0)
    own_error = np.sqrt(np.mean(values[:, receivers].var(axis=0, ddof=1)) / len(parts))
    return values.mean(axis=0), receivers, own_error


def measure(arguments, scene):
    truth, receivers, own_error = reference(arguments.halfshade, scene, arguments.size)
    rows = {}
    for name, (options, seeded) in PATTERNS.items():
        for count in arguments.counts:
            squares = []
            for seed in range(arguments.seeds if seeded else 1):
                values, _ = visibility(arguments.halfshade, scene, arguments.size, count, seed, options)
                squares.append(np.mean((values - truth)[receivers] ** 2))
            rows.setdefault(name, []).append(float(np.sqrt(np.mean(squares))))
    return {"scene": scene, "receivers": int(receivers.sum()), "reference_error": float(own_error), "rmse": rows}


def print_table(arguments, results):
    heads = [f"{r['scene'].removeprefix('builtin:')} {count}" for r in results for count in arguments.counts]
    print("| pattern | " + " | ".join(heads) + " |")
    print("|---" * (len(heads) + 1) + "|")
    for name in PATTERNS:
        print(f"| {name} | " + " | ".join(f"{x:.5f}" for r in results for x in r["rmse"][name]) + " |")
    for r in results:
        print(f"\n{r['scene']}: {r['receivers']} receivers, the reference's own error is {r['reference_error']:.5f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("halfshade")
    parser.add_argument("--scenes", nargs="+", default=["builtin:columns", "builtin:demo"])
    parser.add_argument("--size", default="128x128")
    parser.add_argument("--counts", nargs="+", type=int, default=[16, 64, 256])
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--json")
    arguments = parser.parse_args()
    results = [measure(arguments, scene) for scene in arguments.scenes]
    print_table(arguments, results)
    if arguments.json:
        pathlib.Path(arguments.json).write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
