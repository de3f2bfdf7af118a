"""`jacokin move`: a motion to a pose or to joint angles, its files, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin.motion import Trajectory
from tests.cli.run import leave

BLOCK = "- {shape: box, name: block, size: [0.2, 0.2, 0.2], position: [0.3, -0.2, 0.5]}\n"


def test_a_motion_to_a_pose_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, plot = tmp_path / "motion.csv", tmp_path / "motion.png"
    words = ("move", "--position", "0.3", "-0.2", "0.5", "--down", "--output", str(out), "--plot", str(plot), "--json")
    assert leave(*words) == 0
    document = json.loads(capsys.readouterr().out)
    motion = Trajectory.load(out)
    robot = jacokin.load_robot()
    np.testing.assert_allclose(robot.forward_kinematics(motion.q[-1]).translation, [0.3, -0.2, 0.5], atol=1e-6)
    np.testing.assert_array_equal(motion.q[0], robot.home)
    assert document["success"]
    assert document["q_end"] == motion.q[-1].tolist()
    assert document["min_clearance"] == pytest.approx(motion.clearance.min())
    assert plot.stat().st_size > 1000


def test_limits_of_torque_slow_a_motion_down(capsys: pytest.CaptureFixture[str]) -> None:
    end = (jacokin.load_robot().home + 0.4).tolist()
    words = ["move", "--to", *map(repr, end), "--velocity-limit", "6", "--acceleration-limit", "60", "--json"]
    durations = []
    for more in ((), ("--torque-limit", "20"), ("--rated-torque",)):
        assert leave(*words, *more) == 0
        document = json.loads(capsys.readouterr().out)
        durations.append(document["duration"])
        assert ("slower for the torques" in document["message"]) == (len(durations) == 2)
    assert durations[0] == durations[2] < durations[1]
    assert leave(*words, "--torque-limit", "1") == 1
    assert json.loads(capsys.readouterr().out)["outcome"] == "TOO_HEAVY"
    assert leave(*words, "--torque-limit", "20", "--rated-torque") == 2
    assert "--rated-torque" in capsys.readouterr().err


def test_degrees_go_in_and_out(capsys: pytest.CaptureFixture[str]) -> None:
    robot = jacokin.load_robot()
    start, end = np.degrees(robot.home), np.degrees(robot.home + 0.2)
    words = ["move", "--from", *map(repr, start.tolist()), "--to", *map(repr, end.tolist()), "--degrees", "--json"]
    assert leave(*words) == 0
    document = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(document["q_end"], end, atol=1e-9)
    assert document["angle_unit"] == "deg"


def test_no_way_says_what_touches(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = tmp_path / "scene.yaml"
    scene.write_text(BLOCK)
    assert leave("move", "--position", "0.3", "-0.2", "0.5", "--down", "--scene", str(scene)) == 1
    shown = capsys.readouterr().out
    assert "block" in shown
    assert "no way" in shown


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "exactly one of --to and a pose"),
        (("--to", "1", "2", "--position", "0", "0", "0"), "exactly one of --to and a pose"),
        (("--to", "1", "2"), "--to must be 6 numbers, got 2"),
        (("--position", "0.3", "-0.2", "0.5", "--output", "motion.txt"), "--output must end in"),
        (("--position", "0.3", "-0.2", "0.5", "--time-limit", "0"), "--time-limit must be"),
        (("--to", "1", "2", "--output", "m.csv", "--ros", "1"), "--ros and --joint-prefix go with --output FILE.json"),
    ],
)
def test_what_is_refused(words: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert leave("move", "--dt", "0.01", *words) == 2
    assert message in " ".join(capsys.readouterr().err.split())
