#!/usr/bin/env python3
"""The manual page of the command line, from its own help: man_page.py PROGRAM VERSION PAGE.1.gz"""

import contextlib
import gzip
import io
import re
import subprocess
import sys

ITEM = re.compile(r"^  (\S.*?)(?:  +(\S.*))?$")


def help_of(program, *verb):
    return subprocess.run([program, *verb, "--help"], check=True, capture_output=True, text=True).stdout


def escaped(text):
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return "\\&" + text if text[:1] in (".", "'") else text


class Help:
    """One help text: synopsis, what it does, and its lists of (name, lines of text) by heading; the rest is `footer`."""

    def __init__(self, text):
        lines = text.splitlines()
        usage = next(i for i, line in enumerate(lines) if line.startswith("Usage: "))
        self.about = " ".join(lines[:usage]).strip()
        self.synopsis = lines[usage][len("Usage: ") :]
        self.lists, self.footer = {}, []
        current = None
        for line in lines[usage + 1 :]:
            if not line:
                current = None
            elif re.match(r"^\S.*:$", line) and current is None:
                current = self.lists.setdefault(line[:-1], [])
            elif current is None:
                self.footer.append(line)
            elif re.match(r"^   ", line) and current:
                current[-1][1].append(line.strip())
            else:
                name, text = ITEM.match(line).groups()
                current.append((name, [text] if text else []))


def print_items(items):
    for name, lines in items:
        print(".TP\n.B " + escaped(name))
        print("\n.br\n".join(escaped(line) for line in lines))


def main(program, version):
    top = Help(help_of(program))
    print(f'.TH HALFSHADE 1 "" "halfshade {version}" "User Commands"')
    print(".SH NAME\nhalfshade \\- exact soft shadows from area lights")
    print(".SH SYNOPSIS\n.B " + escaped("halfshade VERB [OPTIONS] [ARGUMENTS]"))
    print(".SH DESCRIPTION\n" + escaped(top.about))
    print("\n".join(escaped(line) for line in top.footer))
    print(".SH OPTIONS")
    print_items(top.lists["Options"])
    for verb, lines in top.lists["Subcommands"]:
        page = Help(help_of(program, verb))
        print(".SH " + escaped(verb.upper()) + "\n.B " + escaped(page.synopsis) + "\n.PP\n" + escaped(page.about) + ".")
        for items in page.lists.values():
            print_items(item for item in items if not item[0].startswith("-h,"))
    print(".SH SEE ALSO\nThe sources' README.md and docs/.")


program, version, path = sys.argv[1:]
page = io.StringIO()
with contextlib.redirect_stdout(page):
    main(program, version)
with open(path, "wb") as file:  # without name and time: equal pages are equal files
    file.write(gzip.compress(page.getvalue().encode(), 9, mtime=0))
