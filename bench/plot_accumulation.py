#!/usr/bin/env python3
"""Error of `halfshade accumulate --json` against the number of frames, on logarithmic axes.

Usage: plot_accumulation.py RUN.json [MORE.json ...] -o FIGURE.png|FIGURE.svg
"""

import argparse
import json
import pathlib

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402


def plot_run(axes, path):
    """RMSE as a line, the largest error as dots of the same colour."""
    run = json.loads(path.read_text(encoding="utf-8"))
    frames = [frame["frame"] + 1 for frame in run["frames"]]
    name = f'{run["scene"]["name"]}, {run["method"]["light_samples"]} {run["method"]["pattern"]}'
    if run["slope"] is not None:
        name += f', slope {run["slope"]:.2f}'
    line, = axes.plot(frames, [frame["rmse"] for frame in run["frames"]], label=name)
    axes.plot(frames, [frame["max"] for frame in run["frames"]], ".", color=line.get_color(), markersize=3)
    return frames, run["frames"][0]["rmse"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", type=pathlib.Path)
    parser.add_argument("-o", "--output", required=True, type=pathlib.Path)
    options = parser.parse_args()
    figure, axes = pyplot.subplots(figsize=(6.4, 4.4), layout="constrained")
    for path in options.runs:
        frames, first = plot_run(axes, path)
    for exponent, style in ((-0.5, ":"), (-1.0, "--")):
        axes.plot(frames, [first * n ** exponent for n in frames], style, color="0.5", label=f"frames^{exponent:g}")
    axes.set(xscale="log", yscale="log", xlabel="frames", ylabel="error of visibility: RMSE (lines), largest (dots)")
    axes.legend(fontsize="small")
    figure.savefig(options.output, metadata={"Date": None} if options.output.suffix == ".svg" else None)


if __name__ == "__main__":
    main()
