"""What the plots and HTML reports share: the Pareto front, pictures and data inside the page. Standard library only."""

import base64
import json


def pareto_front(points):
    """Points of a chart that no other beats in time or RMSE without losing in the other, by time. Of equal ones the first.
    The same in chart_report.html, for any error."""
    front = []
    for point in sorted(points, key=lambda p: (p["shadow_ms"], p["against_reference"]["rmse"])):
        if not front or point["against_reference"]["rmse"] < front[-1]["against_reference"]["rmse"]:
            front.append(point)
    return front


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


def fill(page, parts):
    """Replaces {{name}} by its content; content is not looked at again."""
    first, *rest = page.split("{{")
    return first + "".join(parts[name] + text for name, text in (part.split("}}", 1) for part in rest))
