#!/usr/bin/env python3
"""Packs what `halfshade chart` wrote into one HTML file that opens from disk without a network.

Usage: chart_report.py CHART.json -o REPORT.html

Data, pictures, style and script are inside; the page itself is bench/chart_report.html. Standard library only.
"""

import argparse
import base64
import html
import json
import pathlib

TEMPLATE = pathlib.Path(__file__).with_name("chart_report.html")


def data_uri(content, kind):
    return f"data:{kind};base64," + base64.b64encode(content).decode("ascii")


class Pictures:
    """Each different picture once: exact methods have the same for the same light samples."""

    def __init__(self, directory):
        self.directory = directory
        self.uris = []
        self.numbers = {}

    def number(self, name):
        content = (self.directory / name).read_bytes()
        if content not in self.numbers:
            self.numbers[content] = len(self.uris)
            self.uris.append(data_uri(content, "image/png"))
        return self.numbers[content]


def for_script(value):
    """JSON that cannot end the script element it stands in."""
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")


def pack(chart_file):
    text = chart_file.read_bytes()
    chart = json.loads(text)
    pictures = Pictures(chart_file.parent)
    for point in chart["points"]:
        if "image" in point:
            point["picture"] = pictures.number(point["image"])
    for subject in chart["subjects"]:
        subject["picture"] = pictures.number(subject["reference"]["image"])
    page = TEMPLATE.read_text(encoding="utf-8")
    table = chart_file.with_suffix(".csv")
    for mark, content in {
        "{{json_uri}}": data_uri(text, "application/json"),
        "{{csv_uri}}": data_uri(table.read_bytes(), "text/csv") if table.exists() else "",
        "{{command}}": html.escape(chart["command"]),
        "{{chart}}": for_script(chart),
        "{{pictures}}": for_script(pictures.uris),
    }.items():
        page = page.replace(mark, content)
    return page


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("chart", type=pathlib.Path)
    parser.add_argument("-o", "--output", required=True, type=pathlib.Path)
    options = parser.parse_args()
    page = pack(options.chart)
    options.output.write_text(page, encoding="utf-8")
    print(f"written    {options.output} ({len(page) / 1e6:.1f} MB)")


if __name__ == "__main__":
    main()
