#!/usr/bin/env python3
"""The chart of `halfshade chart`: error against time on logarithmic axes, one panel per scene and light.

Usage: plot_chart.py CHART.json -o NAME     writes NAME.svg and NAME.png
       options: --scenes builtin:demo ...   only these; --dpi N for the PNG
"""

import argparse
import json
import math
import pathlib

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

from report_parts import pareto_front  # noqa: E402

COLORS = {  # the same in chart_report.html
    "exact": "#000000", "afsm": "#1f77b4", "afsm-lut": "#17becf", "hpc": "#2ca02c", "gears": "#ff7f0e",
    "stsv": "#9467bd", "shadow-accumulation": "#8c564b", "shadow-map": "#7f7f7f", "pcf": "#bcbd22", "pcss": "#e377c2",
    "shadow-maps": "#d62728", "raytrace": "#4b0082", "oracle": "#444444"}
FLOOR = 1e-5  # errors below are drawn here: a logarithmic axis has no 0


def error_of(point):
    return max(point["against_reference"]["rmse"], FLOOR)


def draw_method(axes, method, points):
    """Light samples joined by a line; other parameters as single, lighter points."""
    color = COLORS.get(method, "#444444")
    by_samples = sorted((p for p in points if p["parameter"] == "light_samples"), key=lambda p: p["light_samples"])
    axes.plot([p["shadow_ms"] for p in by_samples], [error_of(p) for p in by_samples], "o-", color=color,
              markersize=3.5, linewidth=1, label=method)
    others = [p for p in points if p["parameter"] != "light_samples"]
    axes.plot([p["shadow_ms"] for p in others], [error_of(p) for p in others], "x", color=color, markersize=3.5,
              alpha=0.6)


def draw_front(axes, points):
    """Only its points have labels: all of them together cover each other."""
    front = pareto_front(points)
    axes.step([p["shadow_ms"] for p in front], [error_of(p) for p in front], where="post", color="0.75", linewidth=4,
              zorder=0)
    for point in front:
        axes.annotate(f'{point["method"]} {point["label"]}', (point["shadow_ms"], error_of(point)), fontsize=5.5,
                      xytext=(4, 3), textcoords="offset points", color=COLORS.get(point["method"], "#444444"))


def draw_panel(axes, subject, points):
    by_method = {}
    for point in points:
        by_method.setdefault(point["method"], []).append(point)
    for method, of_method in by_method.items():
        draw_method(axes, method, of_method)
    draw_front(axes, points)
    axes.axhline(max(subject["reference"]["own_rmse"], FLOOR), color="0.6", linestyle=":", linewidth=1)
    light = "" if subject["light"] in ("light", "key") else f', {subject["light"]}'
    axes.set(xscale="log", yscale="log", title=pathlib.Path(subject["scene"]).stem.removeprefix("builtin:") + light)
    axes.grid(True, which="major", color="0.92", linewidth=0.6)


def measured(chart, subject):
    return [p for p in chart["points"] if p["status"] == "measured" and p["scene"] == subject["scene"]
            and p["light"] == subject["light"]]


def draw(chart, subjects):
    columns = min(len(subjects), 3)
    rows = math.ceil(len(subjects) / columns)
    # The last row is room for the legend.
    figure, panels = pyplot.subplots(rows + 1, columns, figsize=(4.2 * columns + 0.4, 3.6 * rows + 1.4), squeeze=False,
                                     layout="constrained", height_ratios=[3.6] * rows + [0.75])
    for axes in panels.flat[len(subjects):]:
        axes.remove()
    for axes, subject in zip(panels.flat, subjects):
        draw_panel(axes, subject, measured(chart, subject))
    for axes in panels[rows - 1, :]:
        axes.set_xlabel("shadow_ms (median), without what a static scene keeps", fontsize=8)
    for axes in panels[:rows, 0]:
        axes.set_ylabel("RMSE of V against the reference", fontsize=8)
    handles = {}
    for axes in panels.flat[:len(subjects)]:
        handles.update({label: handle for handle, label in zip(*axes.get_legend_handles_labels())})
    figure.legend(handles.values(), handles.keys(), loc="lower center", ncols=min(len(handles), 6),
                  fontsize=7.5, title="lines: light samples; crosses: other parameters; grey: Pareto front; "
                                      "dotted: the reference's own error", title_fontsize=7.5)
    return figure


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("chart", type=pathlib.Path)
    parser.add_argument("-o", "--output", required=True, type=pathlib.Path, help="name without ending")
    parser.add_argument("--scenes", nargs="+", help="only these")
    parser.add_argument("--dpi", type=int, default=120)
    options = parser.parse_args()
    chart = json.loads(options.chart.read_text(encoding="utf-8"))
    subjects = [s for s in chart["subjects"] if not options.scenes or s["scene"] in options.scenes]
    subjects = [s for s in subjects if measured(chart, s)]
    if not subjects:
        parser.error("the chart has no measured points of these scenes")
    matplotlib.rcParams["svg.hashsalt"] = "halfshade"  # equal input, equal bytes
    matplotlib.rcParams["svg.fonttype"] = "none"  # text stays text
    figure = draw(chart, subjects)
    for ending, metadata in ((".svg", {"Date": None}), (".png", None)):
        path = options.output.with_name(options.output.name + ending)
        figure.savefig(path, dpi=options.dpi, metadata=metadata)
        print(f"written    {path}")


if __name__ == "__main__":
    main()
