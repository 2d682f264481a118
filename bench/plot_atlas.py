#!/usr/bin/env python3
"""A sheet of pictures of `halfshade atlas`: one row per entry, the truth and then some answers with their errors.

Usage: plot_atlas.py ATLAS.json -o SHEET.png [--rows "both_sides:exact,shadow-map" "fence:exact,stsv, filtered" ...]
       without --rows: the sheet of docs/atlas.md
"""

import argparse
import json
import pathlib

import matplotlib

matplotlib.use("Agg")
import numpy  # noqa: E402
from matplotlib import pyplot  # noqa: E402


ROWS = (
    "wire:exact,exact, pattern rows,shadow-map",
    "both_sides:exact,pcss,textbook: volumes from the centre",
    "winding:exact,pcf,textbook: back faces only",
    "overlap:exact,pcss,accumulation sum",
    "light_in_triangle:exact,raytrace robust,shadow-map",
    "behind_light:exact,shadow-map,textbook: box on a far plane",
    "fence:exact,exact, pattern rows,stsv, filtered",
    "t_junctions:exact,raytrace robust,raytrace fast",
    "far_origin:exact,raytrace fast,textbook: float rays",
    "hot_cell:exact,gears,afsm-lut",
    "needle_light:exact,pcss,accumulation bits",
    "point_light:exact,shadow-map,pcf",
    "bias:exact,shadow-map,shadow-map, bias 0",
    "moving_light:exact,shadow-maps,pcss",
    "moving_camera:exact,shadow-maps,pcss",
    "terminator:smooth normals, no shadows,smooth normals, exact shadows,bent normals, exact shadows")


def answers_of(entry, text):
    """Ids may hold commas: the longest that fits comes first."""
    known = sorted((a["id"] for a in entry["contenders"]), key=len, reverse=True)
    found = []
    while text:
        name = next((k for k in known if text == k or text.startswith(k + ",")), None)
        if name is None:
            raise SystemExit(f'plot_atlas.py: {entry["id"]} has no answer "{text}"; there are: {"; ".join(known)}')
        found.append(next(a for a in entry["contenders"] if a["id"] == name))
        text = text[len(name) + 1:]
    return found


def caption(entry, answer):
    name = answer["id"].removeprefix("textbook: ")
    if entry["temporal"]:
        share = answer["unreasoned_flips"] / answer["flips_asked"]
        return f'{name}\n{100 * share:.2g} % flip, F {answer["flicker"]:.1e}'
    if "lit_facing_away" in answer:
        return name.replace(", ", ",\n") + f'\n{100 * answer["lit_facing_away"]:.2g} % lit facing away'
    if "ms_of_easy" in answer:
        return f'{name}, off by {answer["max"]:.2g}\n' + f'{answer["ms"] / answer["ms_of_easy"]:.2g} times as long'
    bits = f', {answer["wrong_bits"]} bits' if "wrong_bits" in answer else ""
    return f'{name}\noff by {answer["max"]:.2g}{bits}'


def change_without_reason(entry, answer, directory):
    """How far the second difference in time is from the truth's, white to red at 1/64 of V: the largest of each 4 x 4
    pixels, since single pixels would be lost on the sheet."""
    own, truth = (pyplot.imread(directory / shown["error_image"])[:, :, 1] for shown in (answer, entry))
    rows, columns = (length // 4 for length in own.shape)
    apart = numpy.abs(own - truth)[:4 * rows, :4 * columns].reshape(rows, 4, columns, 4).max(axis=(1, 3))
    pale = 1 - numpy.minimum(1, apart * entry["error_range"] * 64)
    return numpy.stack([numpy.ones_like(pale), pale, pale], axis=2)


def show(axes, image, title):
    axes.imshow(image, cmap="gray", vmin=0, vmax=1, interpolation="nearest", aspect="auto")
    axes.set_title(title, fontsize=6, pad=2)
    axes.set_axis_on()
    axes.set(xticks=[], yticks=[])
    for spine in axes.spines.values():
        spine.set(color="0.7", linewidth=0.5)


def draw(atlas, rows, directory):
    by_id = {entry["id"]: entry for entry in atlas["entries"]}
    lines = []
    for row in rows:
        name, _, answers = row.partition(":")
        lines.append((by_id[name], answers_of(by_id[name], answers)))
    columns = 1 + 2 * max(len(answers) for _, answers in lines)
    figure, panels = pyplot.subplots(len(lines), columns, figsize=(1.12 * columns, 1.38 * len(lines)), squeeze=False,
                                     layout="constrained")
    for axes in panels.flat:
        axes.set_axis_off()
    for (entry, answers), axes in zip(lines, panels):
        show(axes[0], pyplot.imread(directory / entry["image"]), f'{entry["id"]}\ntruth')
        for k, answer in enumerate(answers):
            show(axes[1 + 2 * k], pyplot.imread(directory / answer["image"]), caption(entry, answer))
            if entry["temporal"]:
                show(axes[2 + 2 * k], change_without_reason(entry, answer, directory), "change, not the truth's")
            else:
                show(axes[2 + 2 * k], pyplot.imread(directory / answer["error_image"]), "error")
    return figure


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("atlas", type=pathlib.Path)
    parser.add_argument("-o", "--output", required=True, type=pathlib.Path)
    parser.add_argument("--rows", default=ROWS, nargs="+", help="ENTRY:ANSWER,ANSWER,...")
    parser.add_argument("--dpi", type=int, default=130)
    options = parser.parse_args()
    atlas = json.loads(options.atlas.read_text(encoding="utf-8"))
    draw(atlas, options.rows, options.atlas.parent).savefig(options.output, dpi=options.dpi)
    print(f"written    {options.output}")


if __name__ == "__main__":
    main()
