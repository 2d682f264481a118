#!/usr/bin/env python3
"""Fenced snippets of the documentation, compiled or run. Standard library only.

    snippets.py labels SOURCE PAGE...        all pages of the documentation are given, and all their blocks have a known label
    snippets.py cpp OUT.cpp PAGE...          one function per page, all its ```cpp blocks in one scope; main() calls them
    snippets.py c OUT.c PAGE...              the same for ```c
    snippets.py python MODULES PAGE...       ```python blocks of a page as one program, in a scratch directory; MODULES goes
                                             on its path
    snippets.py sh DIRECTORY SOURCE PAGE...  ```sh blocks of a page, one after the other, likewise, with ./dev and bench/;
                                             DIRECTORY has our program. ```json blocks are view files: rendered
    snippets.py small PROGRAM,PROGRAM... SOURCE BUILD CTEST PAGE...
                                             ```sh small blocks: commands that take minutes or must be root's, with
                                             stand_ins/ in the place of the programs, which say how much they leave out
    snippets.py installed SOURCE BUILD PAGE...
                                             ```cmake blocks in a project of their own: configured, and built and run where
                                             they find an installed tree; ```sh installed blocks with that tree

A page's blocks of one label share their variables and files, as a reader would have it. ```text is no snippet; TEXT says
where there is any, so that nobody calls a command text. Exit code 77 where there is nothing to do.
"""

import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile

KNOWN = {"cpp", "c", "sh", "sh small", "sh installed", "python", "text", "json", "cmake"}
TEXT = {"docs/ARCHITECTURE.md": 1}  # a drawing
HERE = pathlib.Path(__file__).resolve().parent
SECONDS = 900  # for all blocks of a page together; on a machine that has more to do they take many times what they work


def blocks(page, language):
    """(first line number, text) of every block in `language`."""
    found, start, inside = [], 0, None
    lines = pathlib.Path(page).read_text(encoding="utf-8").split("\n")
    for number, line in enumerate(lines, 1):
        if re.match(r"\s*~~~", line):
            sys.exit(f"{page}:{number}: blocks begin with ```, so that they are found")
        fence = re.match(r"[\s>*-]*```(.*)$", line)
        if not fence:
            continue
        if inside is None:
            inside, start = fence.group(1).strip(), number
            if inside not in KNOWN:
                sys.exit(f"{page}:{number}: a block needs one of the labels {', '.join(sorted(KNOWN))}, not '{inside}'")
        else:
            if inside == language:
                found.append((start + 1, "\n".join(lines[start:number - 1]) + "\n"))
            inside = None
    if inside is not None:
        sys.exit(f"{page}:{start}: the block does not end")
    return found


def check_labels(source, pages):
    source = pathlib.Path(source)
    there = [source / "README.md", *sorted((source / "docs").rglob("*.md"))]
    missing = [str(page) for page in there if str(page.relative_to(source)) not in pages]
    if missing:
        sys.exit(f"no test runs what is in {', '.join(missing)}")
    for page in pages:
        found = len(blocks(source / page, "text"))
        if found != TEXT.get(page, 0):
            sys.exit(f"{page}: {found} ```text blocks, snippets.py knows of {TEXT.get(page, 0)}; are they no snippets?")
    count = sum(len(blocks(source / page, label)) for page in pages for label in KNOWN - {"text"})
    print(f"{count} snippets on {len(pages)} pages")


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


def write_project(scratch, source, programs):
    """What pages speak of: files of the reader's, and of the project what its commands need, as if it had been built."""
    scratch, source = pathlib.Path(scratch), pathlib.Path(source)
    shutil.copytree(HERE / "files", scratch, dirs_exist_ok=True)
    shutil.copy(scratch / "scene.obj", scratch / "room.obj")
    shutil.copy(source / "dev", scratch)
    shutil.copytree(source / "docs" / "views", scratch / "docs" / "views")
    shutil.copytree(source / "bench", scratch / "bench", ignore=shutil.ignore_patterns("*.cpp", "*.h", "papers", "__pycache__"))
    for directory in ("docs/images", "build/examples/halfshade", "DIRECTORY"):
        (scratch / directory).mkdir(parents=True)
    (scratch / "build/build.ninja").touch()
    (scratch / "build/CMakeCache.txt").write_text("CMAKE_INSTALL_PREFIX:PATH=/usr/local\n", encoding="utf-8")
    (scratch / "build/examples/halfshade/halfshade").symlink_to(programs / "halfshade")


def run_page(page, text, command, environment, source, programs):
    """In a directory of its own."""
    with tempfile.TemporaryDirectory(prefix="halfshade-snippets-") as scratch:
        write_project(scratch, source, programs)
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


def path_with(*directories):
    return os.pathsep.join([*map(str, directories), os.environ["PATH"]])


def shell_text(page, label):
    # Every line that ends a command must end it well, also in the middle of a block.
    return "\n".join(["set -euo pipefail", *(f"# {page}:{first}\n{text}" for first, text in blocks(page, label))])


def run_shell(programs, source, pages):
    environment = dict(os.environ, PATH=path_with(programs))
    render = "halfshade render builtin:columns --size 16x16 --light-samples 4 --quiet -o view.png --view"
    done = []
    for page in pages:
        text = shell_text(page, "sh")
        for first, view in blocks(page, "json"):
            text += f"\ncat >line{first}.view.json <<'END'\n{view}END\n{render} line{first}.view.json\n"
        if blocks(page, "sh") or blocks(page, "json"):
            done.append(run_page(page, text, ["bash"], environment, source, programs))
    return done


def plotting_python():
    """As ./dev finds it."""
    for candidate in ("/usr/bin/python3", "python3"):
        found = shutil.which(candidate)
        if found and subprocess.run([found, "-c", "import matplotlib, numpy"], stderr=subprocess.DEVNULL, check=False).returncode == 0:
            return found
    return None


def run_small(programs, source, build, ctest, pages):
    python = plotting_python()
    if python is None:
        print("no python3 can import numpy and matplotlib: skipped")
        return []
    with tempfile.TemporaryDirectory(prefix="halfshade-stand-ins-") as tools:
        tools = pathlib.Path(tools)
        for name in ("halfshade", "halfshade_paper_bench"):
            (tools / name).symlink_to(HERE / "stand_ins/halfshade")
        for name in ("cmake", "ctest", "cpack", "dpkg", "dpkg-query", "lintian", "apt"):
            (tools / name).symlink_to(HERE / "stand_ins/tool")
        # A link would take pyenv's and conda's interpreters out of their places.
        (tools / "python3").write_text(f'#!/bin/sh\nexec "{python}" "$@"\n', encoding="utf-8")
        (tools / "python3").chmod(0o755)
        linked = tools / "programs"
        linked.mkdir()
        for program in programs:
            (linked / program.name).symlink_to(program)
        environment = dict(os.environ, PATH=path_with(tools), HALFSHADE_PROGRAMS=str(linked), HALFSHADE_BUILD=build,
                           HALFSHADE_CTEST=ctest)
        return [run_page(page, shell_text(page, "sh small"), ["bash"], environment, source, tools) for page in pages
                if blocks(page, "sh small")]


def run_cmake(page, first, block, source, installed):
    """The block in a project with one program."""
    with tempfile.TemporaryDirectory(prefix="halfshade-snippets-") as scratch:
        fetches = "FetchContent" in block
        text = ["cmake_minimum_required(VERSION 3.22)", "project(app LANGUAGES CXX C)", "add_executable(app app.cpp)",
                block.replace("path/to/halfshade", str(source))]
        if fetches:
            text.append("target_link_libraries(app PRIVATE halfshade::halfshade)")
        shutil.copy(source / "examples/minimal.cpp", pathlib.Path(scratch) / "app.cpp")
        (pathlib.Path(scratch) / "CMakeLists.txt").write_text("\n".join(text), encoding="utf-8")
        commands = [["cmake", "-S", ".", "-B", "build", "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={installed}"]]
        # Fetched, it would compile the whole library: .ci/run does so.
        commands += [["ninja", "-C", "build", "-n", "app"]] if fetches else [["cmake", "--build", "build"], ["build/app"]]
        for command in commands:
            ran = subprocess.run(command, cwd=scratch, capture_output=True, text=True, timeout=SECONDS, check=False)
            if ran.returncode != 0:
                print(f"{page}:{first}: {' '.join(command)}\n{ran.stdout}{ran.stderr}")
                return False
    print(f"{page}:{first}: ok")
    return True


def run_installed(source, build, pages):
    with tempfile.TemporaryDirectory(prefix="halfshade-installed-") as scratch:
        installed = pathlib.Path(scratch) / "prefix"
        for component in ("runtime", "dev"):
            subprocess.run(["cmake", "--install", build, "--prefix", installed, "--component", component], check=True,
                           stdout=subprocess.DEVNULL)
        done = [run_cmake(page, first, block, source, installed) for page in pages for first, block in blocks(page, "cmake")]
        libraries = next(installed.rglob("libhalfshade.so")).parent
        environment = dict(os.environ, PKG_CONFIG_PATH=str(libraries / "pkgconfig"), LD_LIBRARY_PATH=str(libraries))
        for page in pages:
            if blocks(page, "sh installed"):
                text = f"cp {source}/examples/minimal.cpp app.cpp; cp {source}/examples/c_minimal.c app.c\n"
                done.append(run_page(page, text + shell_text(page, "sh installed") + "\n./a.out", ["bash"], environment, source,
                                     installed))
    return done


def run_python(modules, pages):
    environment = dict(os.environ, PYTHONPATH=modules)
    if subprocess.run([sys.executable, "-c", "import halfshade, numpy"], env=environment, stderr=subprocess.DEVNULL,
                      check=False).returncode != 0:
        print("the Python module is not there: skipped")
        return []
    return [run_page(page, "".join(text for _, text in blocks(page, "python")), [sys.executable, "-"], environment,
                     HERE.parents[1], pathlib.Path(modules)) for page in pages if blocks(page, "python")]


def main(what, *arguments):
    if what in ("cpp", "c"):
        translate(what, arguments[0], arguments[1:])
        return 0
    if what == "labels":
        check_labels(arguments[0], arguments[1:])
        return 0
    if what == "python":
        done = run_python(arguments[0], arguments[1:])
    elif what == "sh":
        done = run_shell(pathlib.Path(arguments[0]).resolve(), arguments[1], arguments[2:])
    elif what == "small":
        programs = [pathlib.Path(program).resolve() for program in arguments[0].split(",")]
        done = run_small(programs, arguments[1], arguments[2], arguments[3], arguments[4:])
    else:
        done = run_installed(pathlib.Path(arguments[0]).resolve(), arguments[1], arguments[2:])
    if not done:
        return 77
    return 0 if all(done) else 1


if __name__ == "__main__":
    if len(sys.argv) < 4 or sys.argv[1] not in ("labels", "cpp", "c", "sh", "small", "installed", "python"):
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
