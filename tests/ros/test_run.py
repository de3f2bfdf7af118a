"""`jacokin run` at the twins of ROS 1 and 2: where the arm ends, and that it stands when anything ends."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from jacokin import Robot
from jacokin.motion import Trajectory, move_joints
from tests.ros.nodes import Master, Ros, Twin, at_work, away, finish, heed_signals

pytestmark = pytest.mark.slow
VERSIONS = (1, 2)
CLOSE = 0.5  # [deg]
#: [s] 0.2, the watchdogs' 0.05 each, and what lies between a signal and the last message that it lets through
STANDS = {1: 0.3, 2: 0.35}
OURS = {name: value for name, value in os.environ.items() if not name.startswith("ROS_")}


@pytest.fixture(params=VERSIONS)
def version(request: pytest.FixtureRequest) -> int:
    found: int = request.param
    return found


@pytest.fixture
def ros(request: pytest.FixtureRequest, version: int) -> Ros:
    made: Ros = request.getfixturevalue(f"ros{version}")
    return made


@pytest.fixture(scope="module")
def motion(robot: Robot) -> Trajectory:
    return move_joints(robot, robot.home, robot.home + np.array([0.4, 0.1, -0.2, 0.5, 0.1, 0.6]), dt=0.02)


@pytest.fixture
def file(motion: Trajectory, tmp_path: Path) -> Path:
    motion.save(tmp_path / "m.csv")
    return tmp_path / "m.csv"


def start(ros: Ros, version: int, *words: object) -> subprocess.Popen[str]:
    """`jacokin run`, at work."""
    pipe = subprocess.PIPE
    arm = ("--ros", str(version), "--python", ros.python, "--lag", "20")  # a twin on a busy machine is late
    command = [sys.executable, "-P", "-m", "jacokin", "run", *map(str, words), "--json", *arm]
    environment = {**OURS, **{name: value for name, value in ros.environment.items() if name.startswith("ROS_")}}
    return subprocess.Popen(
        command, env=environment, stdin=pipe, stdout=pipe, stderr=pipe, text=True, preexec_fn=heed_signals
    )


@contextlib.contextmanager
def moving(ros: Ros, version: int, file: Path, *words: object) -> Iterator[tuple[Twin, subprocess.Popen[str]]]:
    """A twin whose arm has moved for 0.8 s."""
    with ros.twin("--ros", version, *words) as twin, at_work(start(ros, version, file)) as running:
        twin.says("velocities come")
        time.sleep(0.8)
        assert running.poll() is None
        yield twin, running


@pytest.mark.parametrize("faults", ["", "lag=0.02,loss=0.05"])
def test_the_arm_ends_where_the_file_does(ros: Ros, version: int, motion: Trajectory, file: Path, faults: str) -> None:
    with ros.twin("--ros", version, "--faults", faults) as twin:
        status, output, errors = finish(start(ros, version, file))
        assert status == 0, output + errors
        _, record, _ = twin.ends()
    said = json.loads(output)
    assert said["status"] == "ARRIVED"
    assert away(record, motion) < CLOSE
    assert said["away_deg"] == pytest.approx(away(record, motion), abs=0.1)
    assert said["stands"]
    assert record["margin"] > 0.0
    assert record["speed"] < 1.02


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_a_runner_that_ends_leaves_the_arm_standing(ros: Ros, version: int, file: Path, number: signal.Signals) -> None:
    with moving(ros, version, file) as (twin, running):
        running.send_signal(number)
        status, output, _ = finish(running)
        time.sleep(0.5)
        _, record, _ = twin.ends()
    assert status == (-number if number is signal.SIGKILL else 128 + number)
    if number is not signal.SIGKILL:
        assert json.loads(output)["status"] == "INTERRUPTED", output
    # The zeros that end it count as velocities: the arm has stood long before the last of them.
    assert record["coasted"] < STANDS[version]


def test_a_runner_that_hangs_leaves_the_arm_standing(ros: Ros, version: int, file: Path) -> None:
    with moving(ros, version, file) as (twin, running):
        running.send_signal(signal.SIGSTOP)
        time.sleep(1.0)
        _, record, _ = twin.ends()
    assert record["coasted"] < STANDS[version]


def test_an_arm_that_falls_silent_is_stopped(ros: Ros, version: int, file: Path) -> None:
    with moving(ros, version, file) as (twin, running):
        twin.process.send_signal(signal.SIGSTOP)
        status, output, _ = finish(running)
    assert status == 1
    assert json.loads(output)["status"] == "SILENT"


def test_a_driver_that_is_restarted_in_the_middle(ros: Ros, version: int, file: Path, motion: Trajectory) -> None:
    """The runner ends, and the new driver's arm stays where it stands."""
    with moving(ros, version, file) as (twin, running):
        twin.process.kill()
        with ros.twin("--ros", version) as new:
            status, output, _ = finish(running)
            _, record, _ = new.ends()
    said = json.loads(output)
    assert status == 1
    # ROS 2 keeps a process that was killed for a while, ROS 1 sees that its connection is cut.
    assert said["status"] == {1: "LOST", 2: "SILENT"}[version], said
    assert said["message"]
    np.testing.assert_allclose(record["angles"], motion.q[0], atol=1e-6)  # a last velocity of zero may have come to it


def test_a_master_that_is_restarted_in_the_middle(
    ros1_and_master: tuple[Ros, Master], motion: Trajectory, file: Path
) -> None:
    """Nodes that have found each other do not need it."""
    ros, master = ros1_and_master
    with moving(ros, 1, file) as (twin, running):
        master.kill()
        time.sleep(0.3)
        master.start()
        status, output, errors = finish(running)
        _, record, _ = twin.ends()
    assert (status, json.loads(output)["status"]) == (0, "ARRIVED"), errors
    assert away(record, motion) < CLOSE


def test_an_arm_elsewhere_is_not_moved(ros: Ros, version: int, file: Path, motion: Trajectory) -> None:
    elsewhere = np.degrees(motion.q[0]) + 3.0 * np.eye(6)[2]
    with ros.twin("--ros", version, "--degrees", "--from", *elsewhere) as twin:
        status, output, _ = finish(start(ros, version, file))
        _, record, _ = twin.ends()
    said = json.loads(output)
    assert (status, said["status"]) == (1, "NOT_THERE")
    assert "joint_3 is 3.0 deg from where the motion begins" in said["message"]
    np.testing.assert_allclose(np.degrees(record["angles"]), elsewhere, atol=0.1)


def test_without_an_arm_it_says_so(ros: Ros, version: int, file: Path) -> None:
    status, _, errors = finish(start(ros, version, file))
    assert status == 2
    topic = "/j2n6s300_driver/in/joint_velocity" if version == 1 else "/forward_velocity_controller/commands"
    assert f"no arm listens to velocities (waited 10 s): nobody is at {topic}" in errors


def test_fingers_move_with_the_joints(ros: Ros, version: int, motion: Trajectory, file: Path) -> None:
    with ros.twin("--ros", version) as twin:
        status, output, errors = finish(start(ros, version, file, "--fingers", 0.5))
        assert status == 0, output + errors
        _, record, said = twin.ends()
    assert away(record, motion) < CLOSE
    np.testing.assert_allclose(record["fingers"], 0.75, atol=0.02)  # [rad] of 0.15 to 1.35
    if version == 1:
        assert record["goals"] == 1, said
