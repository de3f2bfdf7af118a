"""`jacokin move`: a motion to a pose or to joint angles, its files, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.motion import Trajectory
from tests.cli.run import Run
from tests.robot_files import CRANE

BLOCK = "- {shape: box, name: block, size: [0.2, 0.2, 0.2], position: [0.3, -0.2, 0.5]}\n"


def test_a_motion_to_a_pose_is_written(robot: Robot, tmp_path: Path, run: Run) -> None:
    out, plot = tmp_path / "motion.csv", tmp_path / "motion.png"
    words = ("move", "--position", "0.3", "-0.2", "0.5", "--down", "--output", str(out), "--plot", str(plot), "--json")
    document = run(*words).document
    motion = Trajectory.load(out)
    np.testing.assert_allclose(robot.forward_kinematics(motion.q[-1]).translation, [0.3, -0.2, 0.5], atol=1e-6)
    np.testing.assert_array_equal(motion.q[0], robot.home)
    assert document["success"]
    assert document["q_end"] == motion.q[-1].tolist()
    assert document["min_clearance"] == pytest.approx(motion.clearance.min())
    assert plot.stat().st_size > 1000


def test_limits_of_torque_slow_a_motion_down(run: Run) -> None:
    end = (jacokin.load_robot().home + 0.4).tolist()
    words = ["move", "--to", *map(repr, end), "--velocity-limit", "6", "--acceleration-limit", "60", "--json"]
    durations = []
    for more in ((), ("--torque-limit", "20"), ("--rated-torque",)):
        document = run(*words, *more).document
        durations.append(document["duration"])
        assert ("slower for the torques" in document["message"]) == (len(durations) == 2)
    assert durations[0] == durations[2] < durations[1]
    assert run(*words, "--torque-limit", "1", code=1).document["outcome"] == "TOO_HEAVY"
    assert "--rated-torque" in run(*words, "--torque-limit", "20", "--rated-torque", code=2).err


def test_degrees_go_in_and_out(robot: Robot, run: Run) -> None:
    start, end = np.degrees(robot.home), np.degrees(robot.home + 0.2)
    words = ["move", "--from", *map(repr, start.tolist()), "--to", *map(repr, end.tolist()), "--degrees", "--json"]
    document = run(*words).document
    np.testing.assert_allclose(document["q_end"], end, atol=1e-9)
    assert document["angle_unit"] == "deg"


@pytest.mark.parametrize("command", ["move", "plan", "track", "teleop"])
def test_a_rail_is_not_written_in_degrees(command: str, run: Run, tmp_path: Path) -> None:
    crane, path = tmp_path / "crane.urdf", tmp_path / "path.csv"
    crane.write_text(CRANE, encoding="utf-8")
    path.write_text("x,y,z,qw,qx,qy,qz\n0.3,0,0.5,1,0,0,0\n0.3,0,0.6,1,0,0,0\n", encoding="utf-8")
    words = {"move": ("--to", "0", "0.5", "0"), "teleop": ("--fast", "--seconds", "1")}.get(command, ("--path", path))
    for name in ("motion.kinova.csv", "motion.kinova.json"):
        said = run(command, *words, "--robot", crane, "--output", tmp_path / name, code=2).err
        assert said == f"jacokin: --output {name}: Kinova's files hold angles, and slide slides\n"
        assert not (tmp_path / name).exists()


def test_no_way_says_what_touches(tmp_path: Path, run: Run) -> None:
    scene = tmp_path / "scene.yaml"
    scene.write_text(BLOCK)
    shown = run("move", "--position", "0.3", "-0.2", "0.5", "--down", "--scene", scene, code=1).out
    assert "block" in shown
    assert "no way" in shown


@pytest.mark.parametrize("name", ["motion.csv", "motion.npz", "motion.json", "motion.kinova.csv"])
def test_what_failed_is_not_written(tmp_path: Path, run: Run, name: str) -> None:
    scene, out = tmp_path / "scene.yaml", tmp_path / name
    scene.write_text(BLOCK)
    out.write_text("precious")
    words = ("move", "--position", "0.3", "-0.2", "0.5", "--down", "--scene", str(scene), "--output", str(out))
    assert "not written" in run(*words, code=1).out
    assert out.read_text() == "precious"
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([name, "scene.yaml"])
    if name in ("motion.csv", "motion.npz"):
        assert "written to" in run(*words, "--save-failed", code=1).out
        assert not Trajectory.load(out).success


def test_a_motion_for_ros(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "motion.json"
    words = ("move", "--position", "0.3", "-0.2", "0.5", "--down", "--output", str(out), "--first-time", "0.5")
    run(*words)
    points = json.loads(out.read_text())["points"]
    assert points[0]["time_from_start"] == {"sec": 0, "nanosec": 500_000_000}
    assert not any(points[0]["velocities"] + points[-1]["velocities"])


def test_degrees_in_place_of_radians_are_noted(run: Run) -> None:
    answer = run("move", "--position", "0.3", "-0.2", "0.5", "--rpy", "180", "0", "0", code=1)
    assert "note: --rpy is in radians, and an angle exceeds a full turn" in answer.err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "exactly one of --to and a pose"),
        (("--to", "1", "2", "--position", "0", "0", "0"), "--position does not go with --to"),
        (("--to", "1", "2"), "--to must be 6 numbers, got 2"),
        (("--position", "0.3", "-0.2", "0.5", "--output", "motion.txt"), "--output must end in"),
        (("--position", "0.3", "-0.2", "0.5", "--time-limit", "0"), "--time-limit must be"),
        (
            ("--to", "1", "2", "--output", "m.csv", "--ros", "1"),
            "--ros, --joint-prefix and --first-time go with",
        ),
        (("--to", "1", "2", "--output", "m.csv", "--first-time", "1"), "--first-time go with --output FILE.json"),
        (("--to", "1", "2", "--output", "m.kinova.csv", "--save-failed"), "--save-failed goes with --output FILE.csv"),
        (("--to", "1", "2", "--save-failed"), "--save-failed goes with --output FILE.csv or FILE.npz"),
        (("--to", "1", "2", "3", "4", "5", "6", "--velocity-limit", "1e12"), "velocity-limit must be at most 10000"),
        (
            ("--to", *"123456", "--acceleration-limit", "1e9", "--degrees"),
            "--acceleration-limit must be at most 5.72958e+07 deg/s^2, got 1e+09 deg/s^2",
        ),
        (
            ("--to", *"123456", "--acceleration-limit", "-1", "--degrees"),
            "--acceleration-limit must be positive [deg/s^2], got [-1,",
        ),
        (("--to", "0", "500", "0", "0", "0", "0", "--degrees"), "--to puts joint_2 at 500 deg, outside [47, 313] deg"),
    ],
)
def test_what_is_refused(words: tuple[str, ...], message: str, run: Run) -> None:
    assert message in " ".join(run("move", "--dt", "0.01", *words, code=2).err.split())
