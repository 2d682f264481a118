#!/usr/bin/env python3
"""Faulty input as the whole program meets it: exit code, message, time, memory and the files it opens.

S36 (OBJ), S38 (pictures), S39 (paths; with strace where it is installed). Standard library only.

Usage: test_input_faults.py HALFSHADE [unittest arguments]
"""

import os
import pathlib
import random
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
import unittest
import zlib

PROGRAM = os.path.abspath(sys.argv.pop(1)) if len(sys.argv) > 1 else "halfshade"
OK, BAD_INPUT, LIMIT = 0, 3, 4
SECONDS = 1.0  # of processor time, whatever else the machine does; most of it is the start of the program
VERTICES = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"  # lines 1 to 3
SANITIZED = "HALFSHADE_SANITIZED" in os.environ


class Outcome:
    """`seconds` of processor time; a program that waits for ever is killed after four minutes."""
    def __init__(self, code, stderr, seconds, peak_mib):
        self.code, self.stderr, self.seconds, self.peak_mib = code, stderr, seconds, peak_mib


def run(*arguments, wrapper=()):
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen([*wrapper, PROGRAM, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=errors,
                                   stdin=subprocess.DEVNULL)
        watchdog = threading.Timer(240.0, process.kill)
        watchdog.start()
        _, status, usage = os.wait4(process.pid, 0)
        watchdog.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        errors.seek(0)
        return Outcome(process.returncode, errors.read().decode(errors="replace"), usage.ru_utime + usage.ru_stime,
                       usage.ru_maxrss / 1024)


def render(path, *arguments, wrapper=()):
    return run("render", path, "--size", "8x8", "--light-samples", 1, "--quiet", "--threads", 1, *arguments,
               wrapper=wrapper)


class Faults(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory(prefix="halfshade-faults-")
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)

    @classmethod
    def setUpClass(cls):
        # What the program needs to start and to draw one triangle: bounds are on top of it.
        with tempfile.TemporaryDirectory() as directory:
            path = pathlib.Path(directory) / "good.obj"
            path.write_text(VERTICES + "f 1 2 3\n")
            good = render(path)
            assert good.code == OK, good.stderr
            cls.base_mib = good.peak_mib

    def write(self, name, content):
        path = self.directory / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    def check(self, outcome, codes, message, mib, seconds=SECONDS):
        self.assertIn(outcome.code, codes, outcome.stderr)
        self.assertRegex(outcome.stderr, message)
        if not SANITIZED:
            self.assertLess(outcome.seconds, seconds)
            self.assertLess(outcome.peak_mib, max(mib, self.base_mib + 16.0))

    def refuse(self, path, message, *arguments, codes=(BAD_INPUT,), mib=64.0, wrapper=()):
        outcome = render(path, "-o", self.directory / "picture.png", *arguments, wrapper=wrapper)
        self.check(outcome, codes, message, mib, 4 * SECONDS if wrapper else SECONDS)  # tracing takes time of its own
        self.assertFalse((self.directory / "picture.png").exists())


class S36(Faults):
    # The line, and what the message says about it.
    WRONG_LINES = [
        ("f 1 2 99", r"'99'.*1\.\.3"),
        ("f 1 2 -9", r"'-9'.*-3\.\.-1"),
        ("f 4294967297 2 3", r"'4294967297'.*1\.\.3"),
        ("f 99999999999999999999 2 3", r"'9{20}'.*1\.\.3"),
        ("f 2147483647 2 3", r"'2147483647'.*1\.\.3"),
        ("f -2147483648 2 3", r"'-2147483648'.*1\.\.3"),
        ("v nan inf -inf", r"'nan'.*finite"),
        ("v abc 0 0", r"'abc'.*number"),
        ("v 1,5 0 0", r"'1,5'.*number"),
        ("v 0 1", r"2 numbers.*3\.\.8"),
        ("v 1e400 0 0", r"'1e400'.*3\.40282"),
        ("v 1e39 0 0", r"'1e39'.*3\.40282"),
        ("vt nan 0", r"'nan'.*finite"),
    ]

    def test_a_wrong_line_ends_with_3_and_names_file_line_value_and_range(self):
        for line, message in self.WRONG_LINES:
            with self.subTest(line=line):
                self.refuse(self.write("bad.obj", VERTICES + line + "\nf 1 2 3\n"), r"bad\.obj:4: .*" + message)

    def test_lenient_skips_wrong_faces_counts_them_and_ends_with_0(self):
        wrong = [line for line, _ in self.WRONG_LINES]
        outcome = render(self.write("bad.obj", VERTICES + "\n".join(wrong) + "\nf 1 2 3\n"), "--lenient")
        self.assertEqual(outcome.code, OK, outcome.stderr)
        faces = sum(line.startswith("f") for line in wrong)
        self.assertRegex(outcome.stderr, rf"warning.*\b{faces} wrong faces skipped")

    def test_a_byte_order_mark_and_continued_lines_are_read(self):
        outcome = render(self.write("bom.obj", "\ufeff" + VERTICES + "f 1 \\\n2 \\\n3\n"))
        self.assertEqual(outcome.code, OK, outcome.stderr)

    def test_noise_empty_files_and_files_that_are_none_are_refused(self):
        noise = random.Random(36).randbytes(200000)
        self.refuse(self.write("noise.obj", noise), r"noise\.obj")
        self.refuse(self.write("empty.obj", ""), r"empty\.obj.*no geometry")
        (self.directory / "folder.obj").mkdir()
        self.refuse(self.directory / "folder.obj", r"folder\.obj.*directory")
        os.mkfifo(self.directory / "fifo.obj")
        self.refuse(self.directory / "fifo.obj", r"fifo\.obj.*fifo")
        self.refuse("/dev/zero", "/dev/zero.*device")

    def test_a_line_of_more_than_a_mebibyte_is_refused(self):
        self.refuse(self.write("line.obj", "v 0 0 0\n#" + "x" * (1 << 20)), r"line\.obj:2: .*1048576")

    def test_a_polygon_of_8000_corners_is_drawn_quickly_and_one_of_65536_refused(self):
        circle = [(float(i) / 8000.0) for i in range(8000)]
        text = "".join(f"v {t} {t * t} 0\n" for t in circle)  # convex: a parabola
        outcome = render(self.write("polygon.obj", text + "f " + " ".join(str(i + 1) for i in range(8000)) + "\n"))
        self.check(outcome, (OK,), "^", 96.0)
        self.refuse(self.write("large.obj", VERTICES + "f" + " 1 2 3 2" * 16384 + "\n"), r"large\.obj:4: .*65535")

    def test_missing_textures_and_materials_are_warnings_all_at_once_or_errors_with_strict(self):
        self.write("m.mtl", "newmtl a\nmap_Kd one.png\nnewmtl b\nmap_d two.png\n")
        text = ("mtllib none.mtl m.mtl\nvt 0 0\n" + VERTICES + "usemtl a\nf 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3/1\n"
                "usemtl c\nf 1/1 2/1 3/1\n")
        path = self.write("missing.obj", text)
        for arguments, code in (((), OK), (("--strict",), BAD_INPUT)):
            outcome = render(path, *arguments)
            self.assertEqual(outcome.code, code, outcome.stderr)
            for name in ("none.mtl", "one.png", "two.png", "'c'"):
                self.assertIn(name, outcome.stderr)


def png_chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width, height, rows):
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + png_chunk(b"IHDR", header) + png_chunk(b"IDAT", zlib.compress(rows)) +
            png_chunk(b"IEND", b""))


def exr(side):
    """Header of a scanline EXR of that size with one half channel and no body."""
    def attribute(name, kind, value):
        return name + b"\0" + kind + b"\0" + struct.pack("<I", len(value)) + value
    window = struct.pack("<iiii", 0, 0, side - 1, side - 1)
    channel = b"R\0" + struct.pack("<I4xII", 1, 1, 1) + b"\0"
    return (struct.pack("<II", 20000630, 2) + attribute(b"channels", b"chlist", channel) +
            attribute(b"compression", b"compression", b"\0") + attribute(b"dataWindow", b"box2i", window) +
            attribute(b"displayWindow", b"box2i", window) + attribute(b"lineOrder", b"lineOrder", b"\0") +
            attribute(b"pixelAspectRatio", b"float", struct.pack("<f", 1)) +
            attribute(b"screenWindowCenter", b"v2f", bytes(8)) +
            attribute(b"screenWindowWidth", b"float", struct.pack("<f", 1)) + b"\0")


class S38(Faults):
    def textured(self, name, content):
        self.write(name, content)
        self.write("m.mtl", f"newmtl a\nmap_Kd {name}\n")
        return self.write("a.obj", "mtllib m.mtl\nvt 0 0\n" + VERTICES + "usemtl a\nf 1/1 2/1 3/1\n")

    def test_headers_that_promise_gigabytes_are_refused_in_little_time_and_memory(self):
        tga = bytes([0, 0, 2] + [0] * 9) + b"\xff\xff\xff\xff\x20\x00"
        self.assertEqual(len(tga), 18)
        empty = zlib.decompress(b"\x78\x9c\x03\x00\x00\x00\x00\x01")
        self.assertLessEqual(len(png(30000, 30000, empty)), 65)
        for name, content in (("bomb.tga", tga), ("bomb.png", png(30000, 30000, empty)),
                              ("huge.png", png(0x7fffffff, 0x7fffffff, empty)), ("bomb.exr", exr(30000)),
                              ("huge.exr", exr(0x7fffffff)), ("tga.png", tga)):
            with self.subTest(name=name):
                self.refuse(self.textured(name, content), re.escape(name), codes=(BAD_INPUT, LIMIT), mib=128.0)

    def test_a_picture_cut_off_is_refused(self):
        rows = b"".join(b"\0" + random.Random(y).randbytes(3 * 40) for y in range(30))
        whole = png(40, 30, rows)
        self.assertEqual(render(self.textured("whole.png", whole)).code, OK)
        for k in (0, 1, 4, 9, 15):  # the others in tests/io
            with self.subTest(sixteenths=k):
                self.refuse(self.textured("cut.png", whole[:len(whole) * k // 16]), r"cut\.png", mib=128.0)


class S39(Faults):
    def setUp(self):
        super().setUp()
        self.secret = self.write("secret.mtl", "newmtl secret\nKd 1 0 0\n")
        self.secret_picture = self.write("secret.png", png(1, 1, b"\0abc"))
        self.scene = self.directory / "scene"
        self.scene.mkdir()
        for name, target in (("link.mtl", "../secret.mtl"), ("link.png", "../secret.png"), ("zero", "/dev/zero")):
            os.symlink(target, self.scene / name)
        (self.scene / "folder").mkdir()
        os.mkfifo(self.scene / "fifo")

    def obj(self, library):
        return self.write("scene/a.obj", f"mtllib {library}\nvt 0 0\n" + VERTICES + "usemtl a\nf 1/1 2/1 3/1\n")

    def textured(self, keyword, name):
        self.write("scene/m.mtl", f"newmtl a\n{keyword} {name}\n")
        return self.obj("m.mtl")

    def cases(self):
        """(scene, what must not be opened)"""
        for name, target in (("../secret.mtl", "secret.mtl"), (str(self.secret), "secret.mtl"),
                             ("link.mtl", "secret.mtl"), ("../../../../../../etc/passwd", "/etc/passwd"),
                             ("/etc/passwd", "/etc/passwd"), ("zero", "/dev/zero"), ("/dev/zero", "/dev/zero"),
                             ("fifo", "fifo"), ("folder", "folder")):
            yield lambda name=name: self.obj(name), target
        for keyword in ("map_Kd", "map_d"):
            for name, target in (("../secret.png", "secret.png"), (str(self.secret_picture), "secret.png"),
                                 ("link.png", "secret.png"), ("../../../../../../etc/passwd", "/etc/passwd"),
                                 ("zero", "/dev/zero"), ("fifo", "fifo"), ("folder", "folder")):
                yield lambda keyword=keyword, name=name: self.textured(keyword, name), target

    def test_what_lies_outside_or_is_no_file_is_refused_and_never_opened(self):
        log, traced = self.directory / "strace.log", may_trace()
        wrapper = ("strace", "-f", "-qq", "-s", "4096", "-y", "-e", "trace=open,openat,openat2,creat", "-o", str(log))
        for make, target in self.cases():
            path = make()
            with self.subTest(scene=path.read_text().split("\n")[0], target=target):
                self.refuse(path, r"(a\.obj:1: mtllib|m\.mtl:2: map_)", wrapper=wrapper if traced else ())
                if traced:
                    opens = opened(log)
                    self.assertTrue(any(name.endswith("/scene/a.obj") for name in opens), "this log shows nothing")
                    self.assertFalse([name for name in opens if name.endswith(target)])
        if not traced:
            self.skipTest("strace is not installed or may not trace: what is opened was not checked")


def may_trace():
    return (shutil.which("strace") is not None and
            subprocess.run(["strace", "-qq", "-o", os.devnull, "true"], check=False).returncode == 0)


def opened(log):
    """Every path that was opened for reading or writing, as strace saw it; links count as what they lead to."""
    names = []
    for line in log.read_text(errors="replace").splitlines():
        succeeded = re.search(r"= \d+<(.*)>$", line)
        if succeeded and "O_PATH" not in line:
            names.append(succeeded.group(1))
    return names


if __name__ == "__main__":
    unittest.main()
