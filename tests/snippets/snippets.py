#!/usr/bin/env python3
"""Fenced snippets of the documentation, compiled or run. Standard library only.

    snippets.py cpp OUT.cpp PAGE...          one function per page, all its ```cpp blocks in one scope; main() calls them
    snippets.py c OUT.c PAGE...              the same for ```c
    snippets.py sh PROGRAM SOURCE PAGE...    ```sh blocks of a page, one after the other, in a scratch directory of its own
    snippets.py python MODULES PAGE...       ```python blocks of a page as one program, likewise; MODULES goes on its path

A page's blocks share their variables and files, as a reader would have it. Blocks of other languages (```text, ```json) are
left alone, blocks without a language are an error: somebody has to decide. Exit code 77 where there is nothing to do.
"""

import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile

KNOWN = {"cpp", "c", "sh", "python", "text", "json", "cmake"}
SECONDS = 300  # for all blocks of a page together


def blocks(page, language):
    """(first line number, text) of every block in `language`."""
    found, start, inside = [], 0, None
    lines = pathlib.Path(page).read_text(encoding="utf-8").split("\n")
    for number, line in enumerate(lines, 1):
        fence = re.match(r"\s*```(.*)$", line)
        if not fence:
            continue
        if inside is None:
            inside, start = fence.group(1).strip(), number
            if inside not in KNOWN:
                sys.exit(f"{page}:{number}: a block needs one of the languages {', '.join(sorted(KNOWN))}, not '{inside}'")
        else:
            if inside == language:
                found.append((start + 1, "\n".join(lines[start:number - 1]) + "\n"))
            inside = None
    if inside is not None:
        sys.exit(f"{page}:{start}: the block does not end")
    return found


def translate(language, target, pages):
    includes, functions, calls = [], [], []
    for page in pages:
        text = blocks(page, language)
        if not text:
            continue
        name = "page_" + re.sub(r"\W", "_", pathlib.Path(page).stem)
        body = []
        for first, block in text:
            kept = []
            for line in block.split("\n"):
                include = re.match(r"\s*#include\s.*", line)
                if include and include.group(0) not in includes:
                    includes.append(include.group(0))
                kept.append("" if include else line)
            body.append(f'#line {first} "{page}"\n' + "\n".join(kept))
        functions.append(f"static void {name}(void) {{\n" + "".join(body) + "}\n")
        calls.append(f'  puts("{page}");\n  {name}();\n')
    start = "#include <stdio.h>\n" + "\n".join(includes) + "\n"
    text = start + "\n".join(functions) + "\nint main(void) {\n" + "".join(calls) + "  return 0;\n}\n"
    target = pathlib.Path(target)
    if not target.exists() or target.read_text(encoding="utf-8") != text:
        target.write_text(text, encoding="utf-8")


def run_page(page, text, command, environment, source):
    """In an empty directory that has the few files which pages speak of."""
    with tempfile.TemporaryDirectory(prefix="halfshade-snippets-") as scratch:
        fixtures = pathlib.Path(__file__).resolve().parent / "files"
        shutil.copytree(fixtures, scratch, dirs_exist_ok=True)
        shutil.copytree(pathlib.Path(source) / "docs" / "views", pathlib.Path(scratch) / "docs" / "views")
        process = subprocess.Popen(command, cwd=scratch, env=environment, text=True, start_new_session=True,
                                   stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        try:
            output, _ = process.communicate(text, timeout=SECONDS)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)  # whatever the blocks started as well
            output, _ = process.communicate()
    print(f"== {page}\n{output}", end="")
    if process.returncode != 0:
        print(f"{page}: exit code {process.returncode}; the blocks were\n{text}")
    return process.returncode == 0


def run_shell(program, source, pages):
    program = pathlib.Path(program).resolve()
    environment = dict(os.environ, PATH=f"{program.parent}{os.pathsep}{os.environ['PATH']}")
    done = [run_page(page, "set -e\n" + "\n".join(f"# {page}:{first}\n{text}" for first, text in blocks(page, "sh")),
                     ["bash", "-e"], environment, source) for page in pages if blocks(page, "sh")]
    return done


def run_python(modules, pages):
    environment = dict(os.environ, PYTHONPATH=modules)
    if subprocess.run([sys.executable, "-c", "import halfshade, numpy"], env=environment, stderr=subprocess.DEVNULL,
                      check=False).returncode != 0:
        print("the Python module is not there: skipped")
        return []
    source = pathlib.Path(__file__).resolve().parents[2]
    return [run_page(page, "".join(text for _, text in blocks(page, "python")), [sys.executable, "-"], environment, source)
            for page in pages if blocks(page, "python")]


def main(what, *arguments):
    if what in ("cpp", "c"):
        translate(what, arguments[0], arguments[1:])
        return 0
    done = run_shell(arguments[0], arguments[1], arguments[2:]) if what == "sh" else run_python(arguments[0], arguments[1:])
    if not done:
        return 77
    return 0 if all(done) else 1


if __name__ == "__main__":
    if len(sys.argv) < 4 or sys.argv[1] not in ("cpp", "c", "sh", "python"):
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
