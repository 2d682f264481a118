#!/usr/bin/env python3
"""Packs what `halfshade atlas` wrote into one HTML file that opens from disk without a network.

Usage: atlas_report.py ATLAS.json -o REPORT.html
       atlas_report.py ATLAS.json --markdown        the tables of docs/atlas.md on standard output

The section itself is bench/atlas_section.html, which chart_report.py puts into its page as well. Standard library only.
"""

import argparse
import html
import json
import pathlib

from report_parts import Pictures, data_uri, fill, for_script

HERE = pathlib.Path(__file__).parent
EXACT = ("exact", "afsm", "hpc", "gears", "stsv")


def section(atlas_file):
    """The HTML fragment with all its data."""
    text = atlas_file.read_bytes()
    atlas = json.loads(text)
    pictures = Pictures(atlas_file.parent)
    for entry in atlas["entries"]:
        for shown in (entry, *entry["contenders"]):
            for kind, name in (("image", "picture"), ("error_image", "error_picture")):
                if kind in shown:
                    shown[name] = pictures.number(shown[kind])
    return fill((HERE / "atlas_section.html").read_text(encoding="utf-8"), {
        "atlas_uri": data_uri(text, "application/json"),
        "atlas_command": html.escape(atlas["command"]),
        "atlas": for_script(atlas),
        "atlas_pictures": for_script(pictures.uris),
    })


def pack(atlas_file):
    atlas = json.loads(atlas_file.read_bytes())
    about = {name: atlas[name] for name in ("command", "version", "machine", "settings")}
    return fill((HERE / "atlas_report.html").read_text(encoding="utf-8"), {
        "section": section(atlas_file),
        "machine": html.escape(json.dumps(about, indent=1)),
    })


def short(value):
    return "0" if value == 0 else f"{value:.3g}"


def error_cell(answers):
    """Largest error of V, and wrong bits where there are masks, of the worst of `answers`."""
    worst = max(answers, key=lambda a: a["max"])
    bits = sum(a.get("wrong_bits", 0) for a in answers)
    return short(worst["max"]) + (f" ({bits})" if any("wrong_bits" in a for a in answers) else "")


def flicker_cell(answers):
    """Share of flips without a reason, and flicker F, each the largest."""
    share = max(a["unreasoned_flips"] / a["flips_asked"] for a in answers)
    return f'{short(100 * share)} %, {short(1000 * max(a["flicker"] for a in answers))}'


def ratio_cell(answers):
    """Time and memory over those of the easy scene, each the largest."""
    times = [a["ms"] / a["ms_of_easy"] for a in answers if "ms_of_easy" in a]
    memory = [a["bytes"] / a["bytes_of_easy"] for a in answers if "bytes_of_easy" in a]
    return ", ".join(f"{max(ratios):.3g}" for ratios in (times, memory) if ratios)


def single(names):
    return [(name, lambda a, name=name: a["id"] == name) for name in names]


def table(entries, columns, cell):
    """One line per entry that has anything to say. A column is a name and which answers it takes."""
    lines = ["| scene | " + " | ".join(name for name, _ in columns) + " |", "|---" * (len(columns) + 1) + "|"]
    for entry in entries:
        taken = [[a for a in entry["contenders"] if takes(a) and "refused" not in a] for _, takes in columns]
        if any(taken):
            cells = [cell(answers) if answers else "" for answers in taken]
            lines.append(f'| {entry["title"]} | ' + " | ".join(cells) + " |")
    return lines


def markdown(atlas):
    """Errors of all entries; flips and flicker of those that move; time and memory of those with an easy form."""
    exact = [("exact methods", lambda a: a["id"] in EXACT)]
    others = single(("raytrace robust", "raytrace fast", "afsm-lut", "shadow-maps", "pcss", "pcf", "shadow-map",
                     "accumulation bits", "accumulation bits, 8 layers", "accumulation sum"))
    textbook = [("textbook form", lambda a: a["method"] == "textbook")]
    moving = [e for e in atlas["entries"] if e["temporal"]]
    hot = [e for e in atlas["entries"] if any("ms_of_easy" in a for a in e["contenders"])]
    tables = [table(atlas["entries"], exact + others + textbook, error_cell)]
    if moving:
        tables.append(table(moving, exact + others, flicker_cell))
    if hot:
        tables.append(table(hot, single(EXACT) + others, ratio_cell))
    return "\n\n".join("\n".join(lines) for lines in tables)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("atlas", type=pathlib.Path)
    output = parser.add_mutually_exclusive_group(required=True)
    output.add_argument("-o", "--output", type=pathlib.Path)
    output.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    if options.markdown:
        print(markdown(json.loads(options.atlas.read_bytes())))
        return
    page = pack(options.atlas)
    options.output.write_text(page, encoding="utf-8")
    print(f"written    {options.output} ({len(page) / 1e6:.1f} MB)")


if __name__ == "__main__":
    main()
