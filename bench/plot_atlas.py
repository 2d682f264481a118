#!/usr/bin/env python3
"""A sheet of pictures of `halfshade atlas`: one row per entry, the truth and then some answers with their errors.

Usage: plot_atlas.py ATLAS.json -o SHEET.png --rows "both_sides:exact,shadow-map" "fence:exact,stsv, filtered" ...
"""

import argparse
import json
import pathlib

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402


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
    bits = f', {answer["wrong_bits"]} bits' if "wrong_bits" in answer else ""
    return f'{name}\noff by {answer["max"]:.2g}{bits}'


def show(axes, directory, image, title):
    axes.imshow(pyplot.imread(directory / image), cmap="gray", vmin=0, vmax=1, interpolation="nearest", aspect="auto")
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
        show(axes[0], directory, entry["image"], f'{entry["id"]}\ntruth')
        for k, answer in enumerate(answers):
            show(axes[1 + 2 * k], directory, answer["image"], caption(entry, answer))
            show(axes[2 + 2 * k], directory, answer["error_image"], "change" if entry["temporal"] else "error")
    return figure


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("atlas", type=pathlib.Path)
    parser.add_argument("-o", "--output", required=True, type=pathlib.Path)
    parser.add_argument("--rows", required=True, nargs="+", help="ENTRY:ANSWER,ANSWER,...")
    parser.add_argument("--dpi", type=int, default=130)
    options = parser.parse_args()
    atlas = json.loads(options.atlas.read_text(encoding="utf-8"))
    draw(atlas, options.rows, options.atlas.parent).savefig(options.output, dpi=options.dpi)
    print(f"written    {options.output}")


if __name__ == "__main__":
    main()
