#!/usr/bin/env python3
"""Packs what `halfshade chart` wrote into one HTML file that opens from disk without a network.

Usage: chart_report.py CHART.json -o REPORT.html [--atlas ATLAS.json]

Data, pictures, style and script are inside; the page itself is bench/chart_report.html. Standard library only.
"""

import argparse
import html
import json
import pathlib

import atlas_report
from report_parts import Pictures, data_uri, fill, for_script

TEMPLATE = pathlib.Path(__file__).with_name("chart_report.html")


def pack(chart_file, atlas_file=None):
    text = chart_file.read_bytes()
    chart = json.loads(text)
    pictures = Pictures(chart_file.parent)
    for point in chart["points"]:
        if "image" in point:
            point["picture"] = pictures.number(point["image"])
    for subject in chart["subjects"]:
        subject["picture"] = pictures.number(subject["reference"]["image"])
    table = chart_file.with_suffix(".csv")
    return fill(TEMPLATE.read_text(encoding="utf-8"), {
        "json_uri": data_uri(text, "application/json"),
        "csv_uri": data_uri(table.read_bytes(), "text/csv") if table.exists() else "",
        "command": html.escape(chart["command"]),
        "chart": for_script(chart),
        "pictures": for_script(pictures.uris),
        "atlas": atlas_report.section(atlas_file) if atlas_file else "",
    })


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("chart", type=pathlib.Path)
    parser.add_argument("-o", "--output", required=True, type=pathlib.Path)
    parser.add_argument("--atlas", type=pathlib.Path, help="what halfshade atlas wrote: a section of the page")
    options = parser.parse_args()
    page = pack(options.chart, options.atlas)
    options.output.write_text(page, encoding="utf-8")
    print(f"written    {options.output} ({len(page) / 1e6:.1f} MB)")


if __name__ == "__main__":
    main()
