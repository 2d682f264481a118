#!/usr/bin/env python3
"""Draws the CSV of solar_shading: hours of sun, the ground at five times of the day, and the day of each kind of surface.

    plot_solar.py solar_shading.csv solar_shading.png
"""
import csv
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np


def read(name):
    with open(name, newline="") as file:
        rows = list(csv.reader(file))
    hours = np.array([float(h) for h in rows[0][5:]])
    place = np.array([[float(v) for v in row[:3]] for row in rows[1:]])
    kind = np.array([row[3] for row in rows[1:]])
    sun_hours = np.array([float(row[4]) for row in rows[1:]])
    lit = np.array([[float(v) for v in row[5:]] for row in rows[1:]])
    return hours, place, kind, sun_hours, lit


def draw_map(axes, place, values, largest, title):
    """Places from above, north up."""
    order = np.argsort(place[:, 1])
    picture = axes.scatter(place[order, 0], -place[order, 2], c=values[order], s=3.5, marker="s", linewidths=0,
                           cmap="inferno", vmin=0, vmax=largest)
    axes.set_aspect("equal")
    axes.set_xticks([]), axes.set_yticks([])
    axes.set_title(title, fontsize=9)
    return picture


def main(source, target):
    hours, place, kind, sun_hours, lit = read(source)
    if hours.size == 0:
        sys.exit("plot_solar: the sun does not rise in " + source)
    from_above = (kind == "ground") | (kind == "roof")
    figure = plt.figure(figsize=(11, 7.5), layout="constrained")
    grid = figure.add_gridspec(2, 5, height_ratios=[2, 1])
    picture = draw_map(figure.add_subplot(grid[0, :3]), place[from_above], sun_hours[from_above], sun_hours.max(),
                       "hours of sun, ground and roofs (north is up)")
    figure.colorbar(picture, label="hours", shrink=0.8)

    day = figure.add_subplot(grid[0, 3:])
    for name in ("ground", "roof", "east", "south", "west", "north"):
        if np.any(kind == name):
            day.plot(hours, lit[kind == name].mean(axis=0), label=name)
    day.set(xlabel="solar time", ylabel="mean lit fraction of the sun's disk", ylim=(0, 1.02))
    day.legend(fontsize=8)

    for column, share in enumerate((0.08, 0.25, 0.5, 0.75, 0.92)):
        step = round(share * (hours.size - 1))
        minutes = round(hours[step] * 60)
        draw_map(figure.add_subplot(grid[1, column]), place[from_above], lit[from_above, step], 1.0,
                 f"lit at {minutes // 60}:{minutes % 60:02d}")
    figure.savefig(target, dpi=110)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2])
