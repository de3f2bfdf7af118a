"""Nodes of ROS as processes: an arm, and the program that sends to it."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import json
import os
import select
import signal
import socket
import subprocess
import sys
import sysconfig
import threading
import time
import xmlrpc.client
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin.motion import Trajectory

HERE = Path(__file__).parent
BESIDE = HERE / "beside_ros.py"
SENDER = Path(__file__).parents[2] / "examples" / "send_trajectory.py"
BOUND = 40.0  # [s] that any of these processes may take
PYTHON = "/usr/bin/python3"  # of Debian, whose packages rospy and actionlib are
NEEDED = "python3-rospy python3-rosmaster python3-actionlib python3-{sensor,trajectory,geometry}-msgs"
ENVIRONMENT = Path(os.environ.get("ROS2_ENVIRONMENT", HERE.parents[1] / ".venv-ros2"))


class MissingRosError(Exception):
    """ROS is not installed; says how it is."""


@dataclass
class Ros:
    """An installation of ROS: its Python, and what its processes see."""

    python: str
    environment: Mapping[str, str]

    @contextlib.contextmanager
    def arm(self, script: Path, *words: str) -> Iterator[Arm]:
        """An arm, a node that runs until the end of the block."""
        process = self._start(script, *words)
        try:
            arm = Arm(process)
            arm.says("ready")
            yield arm
        finally:
            process.kill()
            process.communicate()

    def sending(self, *words: object) -> subprocess.Popen[str]:
        """The sender, at work."""
        return self._start(SENDER, *map(str, words))

    def send(self, *words: object) -> tuple[int, str, str]:
        """Run the sender; returns its status, and what it said."""
        return finish(self.sending(*words))

    def starting(self, *words: object) -> subprocess.Popen[str]:
        """A script that imports ROS and jacokin, or `jacokin` itself, at work.

        Skips where the two need different Pythons.
        """
        folders = [Path(jacokin.__file__).parents[1], sysconfig.get_paths()["purelib"]]
        beside = dataclasses.replace(
            self, environment={**self.environment, "JACOKIN_PATHS": os.pathsep.join(map(str, folders))}
        )
        if version_of(self.python) != str(sys.version_info[:2]):
            pytest.skip(f"ROS has another Python than the tests: {version_of(self.python)}")
        return beside._start(BESIDE, *map(str, words))

    def run(self, *words: object) -> tuple[int, str, str]:
        """Run such a script; returns its status, and what it said."""
        return finish(self.starting(*words))

    @contextlib.contextmanager
    def twin(self, *words: object) -> Iterator[Twin]:
        """A twin, until the end of the block."""
        process = self.starting("jacokin", "twin", "--json", *words)
        try:
            twin = Twin(process)
            twin.says("ready")
            yield twin
        finally:
            process.kill()
            process.communicate()

    def registered(self) -> set[str]:
        """The nodes that a master of ROS 1 knows."""
        with xmlrpc.client.ServerProxy(self.environment["ROS_MASTER_URI"]) as master:
            answer: Any = master.getSystemState("/tests")
        return {node for each in answer[2] for _, nodes in each for node in nodes}

    def _start(self, script: Path, *words: str) -> subprocess.Popen[str]:
        pipe = subprocess.PIPE
        command = [self.python, str(script), *words]
        return subprocess.Popen(
            command, env=dict(self.environment), stdout=pipe, stderr=pipe, text=True, preexec_fn=heed_signals
        )


@functools.cache
def version_of(python: str) -> str:
    """Which Python it is."""
    command = [python, "-c", "import sys; print(sys.version_info[:2])"]
    return subprocess.run(command, capture_output=True, text=True).stdout.strip()


def heed_signals() -> None:
    """Heed signals that whoever started the tests may have ignored, as nohup and the shells' & do."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


@dataclass
class Arm:
    """An arm of a block."""

    process: subprocess.Popen[str]

    def says(self, word: str) -> None:
        """Wait until it says that."""
        assert self.process.stdout is not None
        assert select.select([self.process.stdout], [], [], BOUND)[0], f"it never said {word!r}"
        assert self.process.stdout.readline().strip() == word

    def ends(self) -> dict[str, Any]:
        """End it; returns what it did."""
        self.process.send_signal(signal.SIGTERM)
        _, output, errors = finish(self.process)
        assert output, errors
        record: dict[str, Any] = json.loads(output.splitlines()[-1])
        return record


@dataclass
class Twin:
    """A twin of a block."""

    process: subprocess.Popen[str]

    def says(self, words: str) -> None:
        """Wait until it says that."""
        assert self.process.stderr is not None
        guard = threading.Timer(BOUND, self.process.kill)
        guard.start()
        try:
            assert any(words in line for line in self.process.stderr), f"it never said {words!r}"
        finally:
            guard.cancel()

    def ends(self, *, by_itself: bool = False) -> tuple[int, dict[str, Any], str]:
        """End it; returns its status, what it has done, and what it said."""
        if not by_itself:
            self.process.send_signal(signal.SIGTERM)
        status, output, errors = finish(self.process)
        assert output, errors
        record: dict[str, Any] = json.loads(output)
        return status, record, errors


@dataclass
class Master:
    """A master of ROS 1 that may be ended, and started again at the same address."""

    port: int
    environment: Mapping[str, str]

    def __post_init__(self) -> None:
        """Start it."""
        self.start()

    def start(self) -> None:
        """Start it, and wait until it answers."""
        command = [PYTHON, "-c", "import rosmaster; rosmaster.rosmaster_main()", "--core", "-p", str(self.port)]
        quiet = subprocess.DEVNULL
        self._process = subprocess.Popen(command, env=dict(self.environment), stdout=quiet, stderr=quiet)
        end = time.monotonic() + 20.0
        while not self._answers() and time.monotonic() < end:
            time.sleep(0.05)

    def kill(self) -> None:
        """End it."""
        self._process.kill()
        self._process.wait()

    def _answers(self) -> bool:
        with socket.socket() as asking:
            return not asking.connect_ex(("127.0.0.1", self.port))


@contextlib.contextmanager
def ros1_with_master() -> Iterator[tuple[Ros, Master]]:
    """ROS 1 of Debian, and a master of its own.

    Raises:
        MissingRosError: it is not installed.
    """
    port = free_port()
    environment = plain_environment(
        ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1", PYTHONPATH=str(HERE / "ros1")
    )
    needed = "import actionlib, genpy, geometry_msgs.msg, rosmaster, rospy, sensor_msgs.msg, trajectory_msgs.msg"
    try:
        subprocess.run([PYTHON, "-c", needed], env=environment, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        raise MissingRosError(f"ROS 1 is not installed: apt-get install {NEEDED}") from None
    master = Master(port, environment)
    try:
        yield Ros(PYTHON, environment), master
    finally:
        master.kill()


def ros2_of_wheels() -> Ros:
    """ROS 2 in a domain of its own.

    Raises:
        MissingRosError: it is not installed.
    """
    if not (ENVIRONMENT / "installed").exists():
        raise MissingRosError(f"ROS 2 is not installed: tests/ros/ros2/install.sh {ENVIRONMENT}")
    domain = str(1 + os.getpid() % 100)  # nobody else's
    environment = plain_environment(ROS_DOMAIN_ID=domain, ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST")
    return Ros(str(ENVIRONMENT / "bin" / "python"), environment)


def free_port() -> int:
    """A port that nobody listens to."""
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        return int(listening.getsockname()[1])


def finish(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    """Wait for the end of a process."""
    try:
        output, errors = process.communicate(timeout=BOUND)
    except subprocess.TimeoutExpired:
        process.kill()
        raise
    return process.returncode, output, errors


@contextlib.contextmanager
def at_work(process: subprocess.Popen[str]) -> Iterator[subprocess.Popen[str]]:
    """A process that has ended after the block, whatever happens there."""
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def interrupt(sender: subprocess.Popen[str], arm: Arm, number: signal.Signals) -> tuple[int, str, float]:
    """Send a signal in the middle of a motion; returns status, words, and how long the sender then took [s]."""
    arm.says("moving")
    time.sleep(0.5)
    assert sender.poll() is None
    sender.send_signal(number)
    begun = time.monotonic()
    status, _, errors = finish(sender)
    return status, errors, time.monotonic() - begun


def lose(sender: subprocess.Popen[str], arm: Arm, number: signal.Signals) -> tuple[dict[str, Any], str]:
    """Kill or hold a sender in the middle of a motion; returns what the arm did until it stopped, and words."""
    with at_work(sender):
        arm.says("moving")
        time.sleep(0.3)
        sender.send_signal(number)
        arm.says("stopped")
        record = arm.ends()
        sender.kill()
        return record, sender.communicate()[1]


def away(record: dict[str, Any], motion: Trajectory) -> float:
    """How far the arm is from the end of a motion [deg]."""
    return float(np.degrees(np.abs(np.array(record["angles"]) - motion.q[-1]).max()))


def plain_environment(**names: str) -> dict[str, str]:
    """The environment without what belongs to another Python."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV", "ROS_"))}
    return kept | names
