#!/usr/bin/env python3
"""The recipes of docs/farm.md, run for real on this machine: the bytes of one run. Standard library only.

Usage: test_recipes.py HALFSHADE DIRECTORY_OF_RECIPES parallel|slurm. Exit code 77: its programs are not installed.
"""

import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

PROGRAM, RECIPES, WHICH = os.path.abspath(sys.argv[1]), pathlib.Path(sys.argv[2]).resolve(), sys.argv[3]
SKIPPED = 77
SCENE = ("builtin:fence", "--size", "64x48", "--light-samples", "36")
PATH = os.environ.get("PATH", "") + ":/usr/sbin:/sbin"


def documented(script):
    """The arguments that docs/farm.md gives a recipe, but for the picture and the scene."""
    page = (RECIPES.parents[1] / "docs/farm.md").read_text(encoding="utf-8")
    command = re.search(rf"`{script} (.*?)`", page).group(1).split()
    assert command[-4:] == ["picture.exr", "scene.obj", "--size", "2048x2048"], command
    return command[:-4]


def need(*programs):
    missing = [program for program in programs if shutil.which(program, path=PATH) is None]
    if missing:
        print(f"skipped: {', '.join(missing)} not installed")
        sys.exit(SKIPPED)


def run(*command, **environment):
    result = subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=100, check=False,
                            env={**os.environ, "PATH": PATH, "HALFSHADE": PROGRAM, **environment})
    if result.returncode != 0:
        raise AssertionError(f"{command}: exit code {result.returncode}\n{result.stdout}{result.stderr}")
    return result.stdout


def whole(directory, split, frames=5):
    """The bytes of one run, and the arguments of the recipe."""
    path = directory / f"whole_{split}.exr"
    if split != "frames":
        run(PROGRAM, "render", *SCENE, "-q", "-o", path)
        return path.read_bytes(), SCENE
    pattern = directory / "frame_%d.exr"
    run(PROGRAM, "accumulate", *SCENE, "-q", "--reference-samples", 0, "--frames", frames, "-o", pattern)
    return (directory / f"frame_{frames - 1}.exr").read_bytes(), (*SCENE, "--frames", frames)


def test_parallel(directory):
    need("parallel")
    for split in ("crop", "frames", "samples", "blockers"):
        expected, arguments = whole(directory, split)
        output = directory / "with space" / f"{split}.exr"
        output.parent.mkdir(exist_ok=True)
        run(RECIPES / "gnu_parallel.sh", split, 4, 2, output, *arguments, HOME=str(directory))
        assert output.read_bytes() == expected, split
        assert os.listdir(output.parent) == [output.name], os.listdir(output.parent)
        output.unlink()
    expected, arguments = whole(directory, "crop")
    run(RECIPES / "gnu_parallel.sh", *documented("gnu_parallel.sh"), output, *arguments, HOME=str(directory))
    assert output.read_bytes() == expected
    output.unlink()
    # A failing job stops all; what was finished is used again.
    command = (RECIPES / "gnu_parallel.sh", "crop", 4, 2, output, *SCENE)
    try:
        run(*command, "--shading", "none", HOME=str(directory))
    except AssertionError as failure:
        assert "shading 'none'" in str(failure), failure
    else:
        raise AssertionError("a wrong option went unnoticed")
    assert not output.exists()


def free_ports(count):
    """Ports that nobody uses now."""
    sockets = [socket.socket() for _ in range(count)]
    for s in sockets:
        s.bind(("127.0.0.1", 0))
    ports = [s.getsockname()[1] for s in sockets]
    for s in sockets:
        s.close()
    return ports


class LocalSlurm:
    """munged, slurmctld and slurmd as children of this process, with all their files in one directory."""

    def __init__(self, directory):
        self.directory, self.daemons = directory, []
        self.configuration = directory / "slurm.conf"

    def __enter__(self):
        for name in ("state", "spool"):
            (self.directory / name).mkdir()
        key = self.directory / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o600)
        self.directory.chmod(0o755)  # munged refuses a socket that others cannot reach
        host = socket.gethostname().split(".")[0]
        ports = free_ports(2)
        self.configuration.write_text("\n".join((
            "ClusterName=local", f"SlurmctldHost={host}(127.0.0.1)", f"SlurmctldPort={ports[0]}",
            f"SlurmdPort={ports[1]}", "AuthType=auth/munge", f"AuthInfo=socket={self.directory}/munge.socket",
            "SlurmUser=root", "SlurmdUser=root", f"StateSaveLocation={self.directory}/state",
            f"SlurmdSpoolDir={self.directory}/spool", f"SlurmctldPidFile={self.directory}/slurmctld.pid",
            f"SlurmdPidFile={self.directory}/slurmd.pid", "ProctrackType=proctrack/linuxproc", "TaskPlugin=task/none",
            "SelectType=select/cons_tres", "SelectTypeParameters=CR_CPU", "JobAcctGatherType=jobacct_gather/none",
            "MpiDefault=none", "ReturnToService=2", "SlurmdParameters=config_overrides",
            "SchedulerParameters=batch_sched_delay=0,sched_interval=1",
            f"NodeName={host} NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN",
            "PartitionName=main Nodes=ALL Default=YES MaxTime=10 State=UP", "")))
        try:
            self.start("munged", "--foreground", "--force", f"--key-file={key}",
                       f"--socket={self.directory}/munge.socket", f"--pid-file={self.directory}/munge.pid",
                       f"--log-file={self.directory}/munge.log", f"--seed-file={self.directory}/munge.seed")
            self.wait(lambda: (self.directory / "munge.socket").exists(), "munged")
            self.start("slurmctld", "-D", "-f", self.configuration)
            self.start("slurmd", "-D", "-f", self.configuration)
            self.wait(lambda: "idle" in self.sinfo(), "a node")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for daemon in reversed(self.daemons):
            daemon.send_signal(signal.SIGTERM)
            try:
                daemon.wait(timeout=20)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()

    def environment(self):
        return {"SLURM_CONF": str(self.configuration)}

    def start(self, *command):
        log = open(self.directory / f"{command[0]}.out", "wb")
        self.daemons.append(subprocess.Popen([str(part) for part in command], stdout=log, stderr=log,
                                             env={**os.environ, "PATH": PATH, **self.environment()}))
        log.close()

    def sinfo(self):
        return subprocess.run(["sinfo", "--noheader"], capture_output=True, text=True, check=False, timeout=30,
                              env={**os.environ, "PATH": PATH, **self.environment()}).stdout

    def wait(self, condition, what, seconds=60):
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end or any(daemon.poll() is not None for daemon in self.daemons):
                logs = "".join(f"{path.name}:\n{path.read_text(errors='replace')[-2000:]}" for path in
                               self.directory.glob("*.out"))
                raise AssertionError(f"waited for {what} in vain\n{logs}")
            time.sleep(0.2)


def test_slurm(directory):
    need("munged", "slurmctld", "slurmd", "sbatch")
    if os.geteuid() != 0:
        print("skipped: the daemons of Slurm need root")
        sys.exit(SKIPPED)
    expected, arguments = whole(directory, "crop")
    (directory / "slurm").mkdir()
    with LocalSlurm(directory / "slurm") as slurm:
        output = directory / "farm.exr"
        split, parts = documented("slurm_submit.sh")
        job = run(RECIPES / "slurm_submit.sh", split, parts, output, *arguments, **slurm.environment()).strip()
        assert job.isdigit(), job

        def ended():
            return job not in run("squeue", "--noheader", "--format=%i", **slurm.environment()).split()

        slurm.wait(ended, "the merge", 90)
        logs = {path.name: path.read_text() for path in directory.glob("farm.exr.*.log")}
        assert output.exists(), logs
        assert output.read_bytes() == expected, logs
        assert not (directory / "farm.exr.parts").exists()
        assert sorted(logs) == ["farm.exr.merge.log", *(f"farm.exr.parts.{i}.log" for i in range(1, int(parts) + 1))], logs


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(prefix="halfshade-farm-") as scratch:
        start = time.monotonic()
        {"parallel": test_parallel, "slurm": test_slurm}[WHICH](pathlib.Path(scratch))
        print(f"{WHICH}: ok, {time.monotonic() - start:.1f} s")
