#!/usr/bin/env python3
"""Stability cases of renders that do not end by themselves: S40 disk_full, S41 kill_anytime, S42 sigint.
Standard library only.

Usage: test_interrupted.py HALFSHADE [--kills N] [unittest arguments]
"""

import contextlib
import functools
import hashlib
import os
import pathlib
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM = os.path.abspath(sys.argv.pop(1)) if len(sys.argv) > 1 else "halfshade"
KILLS = int(sys.argv.pop(1)) if sys.argv[1:2] == ["--kills"] and sys.argv.pop(1) else 8
OK, DIFFERENT, USAGE, BAD_INPUT, LIMIT, OUTPUT = range(6)
INTERRUPTED = 130

SMALL = ("builtin:columns", "--size", "256x192", "--light-samples", "64", "--quiet")
LONG_SECONDS = 2.0


@functools.cache
def long_render():
    """Arguments of a render in many bands that takes this machine LONG_SECONDS or more."""
    width = 80
    while True:
        arguments = ("builtin:hairball:1000", "--size", f"{width}x{width * 3 // 4}", "--light-samples", "256", "--quiet",
                     "--resume", "--band-seconds", "0.1", "--threads", "1")
        with tempfile.TemporaryDirectory(prefix="halfshade-interrupted-") as scratch:
            start = time.monotonic()
            subprocess.run([PROGRAM, "render", *arguments, "-o", f"{scratch}/a.png"], check=True, capture_output=True)
            if time.monotonic() - start >= LONG_SECONDS:
                return arguments
        width = width * 7 // 5


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def names(directory):
    return sorted(str(path.relative_to(directory)) for path in directory.rglob("*"))


class Interrupted(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory(prefix="halfshade-interrupted-")
        self.addCleanup(scratch.cleanup)
        self.directory = pathlib.Path(scratch.name)
        self.picture = self.directory / "picture.png"
        self.journal = self.directory / "picture.png.journal"

    def command(self, *arguments):
        return [PROGRAM, "render", *map(str, arguments)]

    def run_program(self, *arguments, **more):
        return subprocess.run(self.command(*arguments), capture_output=True, text=True, timeout=600, check=False, **more)

    def expect(self, code, *arguments, **more):
        result = self.run_program(*arguments, **more)
        self.assertEqual(result.returncode, code, f"{arguments}\n{result.stdout}{result.stderr}")
        return result

    def bands(self):
        """(finished, unfinished) directories of the journal."""
        every = [path for path in self.journal.glob("rows_*") if path.is_dir()]
        finished = [path for path in every if (path / "part.json").exists()]
        return finished, [path for path in every if path not in finished]

    def rows_done(self):
        return sum(int(path.name[11:16]) - int(path.name[5:10]) for path in self.bands()[0])

    def uninterrupted(self):
        """sha256 and seconds of a run from start to end."""
        path = self.directory / "whole.png"
        start = time.monotonic()
        self.expect(OK, *long_render(), "-o", path)
        seconds = time.monotonic() - start
        plain = self.directory / "plain.png"
        self.expect(OK, *(a for a in long_render() if a != "--resume"), "-o", plain)
        digest = sha256(path)
        self.assertEqual(sha256(plain), digest, "bands change the picture")
        path.unlink(), plain.unlink()
        self.assertEqual(names(self.directory), [])
        return digest, seconds


class S40(Interrupted):
    @contextlib.contextmanager
    def small_disk(self):
        """1 MiB of file system."""
        disk = self.directory / "disk"
        disk.mkdir()
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", disk], capture_output=True, check=False)
        if mounted.returncode != 0:
            self.skipTest("a small file system cannot be mounted here")
        try:
            yield disk
        finally:
            subprocess.run(["umount", "-l", disk], check=True)

    def outputs(self, directory):
        return {"png": ("-o", directory / "a.png"), "exr": ("-o", directory / "a.exr"),
                "json": ("--json", directory / "a.json"), "dump": ("--dump", directory / "a"),
                "part": ("--part", "1/2", "-o", directory / "a"), "resume": ("--resume", "-o", directory / "a.png")}

    def check_outputs(self, directory, keep, **more):
        """Every kind of output fails with 5, names its file, changes no old file and leaves no temporary one."""
        for kind, options in self.outputs(directory).items():
            with self.subTest(kind=kind):
                target = pathlib.Path(options[-1])
                if kind in ("png", "exr", "json", "resume"):
                    target.write_bytes(b"old")
                before = sha256(target) if target.is_file() else None
                message = self.expect(OUTPUT, *SMALL, *options, **more).stderr
                self.assertIn(str(target), message)
                self.assertEqual([name for name in names(directory) if ".halfshade-" in name], [])
                if before:
                    self.assertEqual(sha256(target), before)
                for name in ("dump.json", "part.json"):
                    self.assertFalse((target / name).exists())
                for path in sorted(directory.rglob("*"), reverse=True):
                    if path != keep:
                        path.rmdir() if path.is_dir() else path.unlink()

    def test_on_a_full_file_system(self):
        with self.small_disk() as disk:
            ballast = disk / "ballast"
            with contextlib.suppress(OSError), open(ballast, "wb", buffering=0) as file:
                while True:
                    file.write(b"x" * 4096)
            os.truncate(ballast, ballast.stat().st_size - 4096)  # for the old file
            self.check_outputs(disk, ballast)

    def test_where_files_may_not_grow(self):
        limit = (512, resource.RLIM_INFINITY)
        self.check_outputs(self.directory, None, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, limit))

    def test_a_journal_on_a_full_disk_goes_on_where_there_is_room_again(self):
        with self.small_disk() as disk:
            picture, ballast = disk / "a.png", disk / "ballast"
            self.expect(OK, *SMALL, "-o", self.picture)
            picture.write_bytes(b"old")
            ballast.write_bytes(b"x" * (760 << 10))
            command = (*SMALL, "--resume", "--band-seconds", "0.01", "-o", picture)
            self.expect(OUTPUT, *command)
            self.assertEqual(picture.read_bytes(), b"old")
            done = [path for path in (disk / "a.png.journal").glob("rows_*/part.json")]
            self.assertGreater(len(done), 0)
            ballast.unlink()
            self.assertIn("going on after", self.expect(OK, *command).stderr)
            self.assertEqual(sha256(picture), sha256(self.picture))
            self.assertEqual(names(disk), ["a.png"])


class S41(Interrupted):
    def test_a_render_killed_at_any_time_goes_on_to_the_same_bytes(self):
        digest, seconds = self.uninterrupted()
        generator = random.Random(41)
        self.picture.write_bytes(b"old")
        old = sha256(self.picture)
        landed = 0
        while landed < KILLS:
            # A few kills per picture, so that every one has room to get on and journals of several runs come together.
            before = self.rows_done()
            process = subprocess.Popen(self.command(*long_render(), "-o", self.picture), stdout=subprocess.DEVNULL,
                                       stderr=subprocess.DEVNULL)
            time.sleep(generator.random() * seconds * 0.5)
            process.kill()
            ended = process.wait() == OK
            self.assertIn(sha256(self.picture), (old, digest))
            landed += not ended
            if sha256(self.picture) == digest:
                self.assertFalse(ended and self.journal.exists())
                self.picture.write_bytes(b"old")
                continue
            self.assertFalse(ended)
            self.assertGreaterEqual(self.rows_done(), before, "finished work was lost")
            self.assertLessEqual(len(self.bands()[1]), 1, "more than one band was lost")
        self.expect(OK, *long_render(), "-o", self.picture)
        self.assertEqual(sha256(self.picture), digest)
        self.assertFalse(self.journal.exists())
        left = [name for name in names(self.directory) if name != "picture.png"]
        self.assertTrue(all(name.startswith(".halfshade-") for name in left), left)

    def test_a_journal_of_another_render_is_refused(self):
        process = subprocess.Popen(self.command(*long_render(), "-o", self.picture), stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        while not self.bands()[0] and process.poll() is None:
            time.sleep(0.01)
        process.send_signal(signal.SIGSTOP)  # it shall not end before the second comes
        second = self.run_program(*long_render(), "-o", self.picture)
        process.kill()
        self.assertNotEqual(process.wait(), OK, "the render was too short for this test")
        self.assertEqual(second.returncode, OUTPUT)
        self.assertIn("another process", second.stderr)
        before = names(self.journal)
        for extra in (("--seed", 1), ("--crop", "0,60,0,50"), ("--shading", "bent")):
            message = self.expect(BAD_INPUT, *long_render(), *extra, "-o", self.picture).stderr
            self.assertIn("different renders", message)
            self.assertIn(str(self.journal), message)
        kept = [name for name in before if name in names(self.journal)]
        self.assertGreater(len(kept), 1)
        masks = self.bands()[0][0] / "masks_0.npy"
        content = bytearray(masks.read_bytes())
        content[-1] ^= 1
        masks.write_bytes(content)
        self.assertIn(str(masks), self.expect(BAD_INPUT, *long_render(), "-o", self.picture).stderr)
        self.assertFalse(self.picture.exists())


class S42(Interrupted):
    ROUNDS = 12  # with four each of the two other tests, 20
    LIMIT_MS = 250.0
    late = []  # milliseconds of all tests; one may be, since a busy machine can delay any process

    def interrupt(self, arguments, after, signals=1):
        """(exit code, milliseconds from the last signal to the end), or None if the program was through before."""
        with subprocess.Popen(self.command(*arguments), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            self.wait_for_handler(process)
            time.sleep(after)
            if process.poll() is not None:
                return None
            for _ in range(signals):
                start = time.monotonic()
                process.send_signal(signal.SIGINT)
            code = process.wait(timeout=60)
            if code == OK:  # the signal came after the last question whether to go on
                self.assertTrue(self.picture.exists())
                return None
            return code, (time.monotonic() - start) * 1e3

    @staticmethod
    def wait_for_handler(process):
        """Until the program catches the signal; before, it just dies of it."""
        while process.poll() is None:
            status = pathlib.Path(f"/proc/{process.pid}/status").read_text()
            caught = int(status.split("SigCgt:")[1].split()[0], 16)
            if caught >> (signal.SIGINT - 1) & 1:
                return
            time.sleep(0.002)

    def check(self, arguments, seconds, signals=1):
        """Interrupts at a random time: milliseconds to the end, or None if the program was through before."""
        result = self.interrupt(arguments, self.generator.random() * seconds, signals)
        if result is None:
            return None
        self.assertEqual(result[0], INTERRUPTED)
        self.assertEqual([name for name in names(self.directory) if ".halfshade-" in name], [])
        if result[1] > self.LIMIT_MS:
            self.late.append(result[1])
        self.assertLessEqual(len(self.late), 1, f"milliseconds after the signal; allowed are {self.LIMIT_MS:.0f}: {self.late}")
        return result[1]

    def test_an_interrupted_render_stops_soon_and_can_go_on(self):
        self.generator = random.Random(42)
        digest, seconds = self.uninterrupted()
        times = []
        while len(times) < self.ROUNDS:
            before = self.rows_done()
            taken = self.check((*long_render(), "-o", self.picture), seconds * 0.5)
            if taken is not None:
                times.append(taken)
            if self.picture.exists():  # complete, whether or not the program was told so in time
                self.assertEqual(sha256(self.picture), digest)
                self.picture.unlink()
                continue
            self.assertIn(names(self.directory)[:1], ([], [self.journal.name]))
            self.assertGreaterEqual(self.rows_done(), before)
        self.expect(OK, *long_render(), "-o", self.picture)
        self.assertEqual(sha256(self.picture), digest)
        self.assertEqual(names(self.directory), ["picture.png"])
        print(f"milliseconds to the end: median {sorted(times)[len(times) // 2]:.0f}, most {max(times):.0f}")

    def test_a_second_signal_ends_at_once(self):
        self.generator = random.Random(43)
        for _ in range(4):
            taken = self.check(("builtin:hairball", "--size", "256x256", "--method", "oracle", "--quiet", "-o",
                                self.picture), 1.0, signals=2)
            self.assertIsNotNone(taken)
            self.assertEqual(names(self.directory), [])

    def test_nothing_is_waited_for_while_a_scene_is_made(self):
        self.generator = random.Random(44)
        stopped = 0
        while stopped < 4:
            taken = self.check(("builtin:hairball:20000", "--size", "64x64", "--quiet", "-o", self.picture), 0.5)
            self.picture.unlink(missing_ok=True)
            self.assertEqual(names(self.directory), [])
            stopped += taken is not None


if __name__ == "__main__":
    unittest.main()
