"""`jacokin twin --ros 2` at real clients: the sender as it is, velocities, joint states, pictures."""

from __future__ import annotations

import json
import signal
import time
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin.motion import Trajectory
from tests.ros.nodes import Ros, at_work, away, finish

pytestmark = pytest.mark.slow
HERE = Path(__file__).parent / "ros2"
CONTROLLER = (
    *("--ros", "2", "--states", "/joint_states"),
    *("--action", "/joint_trajectory_controller/follow_joint_trajectory"),
)
CLOSE = 0.5  # [deg]
STANDS = 0.35  # [s] 0.2, the watchdog's 0.05, and what lies between a signal and the last message that it lets through


@pytest.mark.parametrize("faults", ["", "lag=0.02,loss=0.01,stall"])
def test_a_goal_ends_where_the_file_does(ros2: Ros, motion: Trajectory, file: Path, faults: str) -> None:
    with ros2.twin("--ros", 2, "--faults", faults) as twin:
        status, output, errors = ros2.send(file, *CONTROLLER)
        code, record, _ = twin.ends()
    assert status == 0, errors
    assert code == 128 + signal.SIGTERM
    assert away(record, motion) < CLOSE
    assert float(output.partition("arm ends ")[2].split()[0]) < CLOSE
    assert record["margin"] > 0.0
    assert record["speed"] < 1.0


def test_as_fast_as_it_can(ros2: Ros, motion: Trajectory, file: Path) -> None:
    with ros2.twin("--ros", 2, "--fast") as twin:
        begun = time.monotonic()
        status, _, errors = ros2.send(file, *CONTROLLER)
        seconds = time.monotonic() - begun
        _, record, _ = twin.ends()
    assert status == 0, errors
    assert away(record, motion) < CLOSE
    assert record["time"] > 1.5 * seconds
    with ros2.twin("--ros", 2, "--fast", "--seconds", 5) as twin:
        status, record, errors = twin.ends(by_itself=True)
    assert status == 0, errors
    assert record["time"] == pytest.approx(5.0, abs=0.02)


def test_a_goal_that_is_cancelled_leaves_the_arm_standing(ros2: Ros, motion: Trajectory, file: Path) -> None:
    with ros2.twin("--ros", 2) as twin, at_work(ros2.sending(file, *CONTROLLER)) as sender:
        twin.says("a trajectory of")
        time.sleep(0.8)
        sender.send_signal(signal.SIGINT)
        status, _, errors = finish(sender)
        time.sleep(0.5)
        _, record, _ = twin.ends()
    assert status == 1
    assert "told to stop" in errors
    assert record["coasted"] < STANDS
    assert away(record, motion) > CLOSE


def test_a_goal_that_the_controller_would_reject(ros2: Ros, motion: Trajectory, tmp_path: Path) -> None:
    motion.save(tmp_path / "m.json", joint_prefix="j2n6s300_")
    message = json.loads((tmp_path / "m.json").read_text())
    message["points"][-1]["velocities"][0] = 0.1
    (tmp_path / "m.json").write_text(json.dumps(message))
    with ros2.twin("--ros", 2) as twin:
        status, _, errors = ros2.send(tmp_path / "m.json", *CONTROLLER)
        _, record, said = twin.ends()
    assert status == 1
    assert "rejected the goal" in errors
    assert "must have no velocity" in said
    assert record["goals"] == 0


def test_velocities_until_their_sender_is_killed(ros2: Ros) -> None:
    with ros2.twin("--ros", 2) as twin, at_work(ros2.starting(HERE / "client.py", "velocities")) as client:
        twin.says("velocities come")
        time.sleep(1.0)
        client.kill()
        output, _ = client.communicate()
        time.sleep(1.5)
        _, record, _ = twin.ends()
    seen = json.loads(output.splitlines()[0])
    fingers = [f"j2n6s300_joint_finger_{k}" for k in (1, 2, 3)]
    assert seen["names"] == [f"j2n6s300_joint_{k}" for k in range(1, 7)] + fingers
    home = jacokin.load_robot().home
    np.testing.assert_allclose(seen["positions"][:6], home, atol=1e-3)
    assert 50.0 < seen["rate"] < 110.0
    assert record["coasted"] < STANDS
    assert record["velocities"] > 20
    moved = np.array(record["angles"]) - home
    assert 0.1 < moved[0] == pytest.approx(-moved[5], abs=0.05)


def test_the_scene_of_a_task_and_its_camera(ros2: Ros) -> None:
    pytest.importorskip("gymnasium")
    with ros2.twin("--ros", 2, "--task", "lift_brick", "--camera", "wrist=48x64") as twin:
        status, output, errors = ros2.run(HERE / "client.py", "picture")
        assert status == 0, errors
        twin.ends()
    height, width, encoding, brightest, darkest = json.loads(output)["picture"]
    assert (height, width, encoding) == (48, 64, "rgb8")
    assert brightest - darkest > 30
