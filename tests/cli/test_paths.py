"""`jacokin track` and `jacokin plan`: a path in, a trajectory out, scenes, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.ik import Scene
from jacokin.motion import Trajectory
from tests.cli.run import POSE, Run

TABLE = "- {shape: box, name: table, size: [0.6, 0.6, 0.05], position: [0.5, -0.5, 0.1]}\n"
BLOCK = "- {shape: box, name: block, size: [0.2, 0.2, 0.2], position: [0.3, -0.2, 0.5]}\n"
BOTH = (
    (("--dt", "0"), "--dt must be"),
    (("--dt", "-0.01"), "--dt must be"),
    (("--speed", "0"), "--speed"),
    (("--output", "trajectory.txt"), ".csv or .npz"),
    (("--output", "nowhere/trajectory.csv"), "nowhere"),
    (("--plot", "trajectory.doc"), ".png"),
    (("--frame", "link_9"), "link_6"),
    (("--seed", "1", "2"), "--seed"),
    (("--velocity-limit", "1", "2"), "--velocity-limit"),
    (("--scene", "none.yaml"), "none.yaml: cannot be read"),
)
TRACK = (
    (("--acceleration-limit", "0"), "--acceleration-limit"),
    (("--clearance", "-1"), "--clearance must be"),
)
PLAN = (
    (("--free-axis", "0 0 0"), "--free-axis must have a direction"),
    (("--free-axis", "1 0"), "--free-axis must be x, y, z or three numbers"),
    (("--free-axis", "w"), "--free-axis must be x, y, z or three numbers"),
    (("--free-axis", "x", "--free-range", "1", "-1"), "--free-range must be (least, largest)"),
    (("--free-range", "1", "2"), "--free-range goes with --free-axis"),
    (("--timing", "fast"), "Valid: keep, slow"),
    (("--acceleration-limit", "2"), "needs --timing"),
    (("--clearance", "-1"), "--clearance must be"),
)


@pytest.fixture
def path_file(tmp_path: Path) -> Path:
    """Ten centimetres to the right with the tool down."""
    path = tmp_path / "path.csv"
    half = 0.5**0.5
    rows = [f"{x},-0.2,0.5,0,{half!r},{half!r},0" for x in (0.3, 0.4)]
    path.write_text("\n".join(["x,y,z,qw,qx,qy,qz", *rows]) + "\n", encoding="utf-8")
    return path


def test_track_follows_a_line_inside_the_limits(robot: Robot, path_file: Path, run: Run) -> None:
    out, plot = path_file.with_name("trajectory.csv"), path_file.with_name("trajectory.png")
    words = ("track", "--path", str(path_file), "--dt", "0.02", "--output", str(out), "--plot", str(plot), "--json")
    document = run(*words).document
    assert 2.0 < document["duration"] < 2.3  # 0.1 m at 0.05 m/s, from rest to rest
    assert document["max_position_error"] < 1e-4
    result = Trajectory.load(out)
    assert all(robot.within_limits(q) for q in result.q)
    assert (np.abs(result.v) <= robot.velocity_limit + 1e-9).all()
    last = robot.forward_kinematics(result.q[-1]).translation
    assert np.linalg.norm(last - [0.4, -0.2, 0.5]) < 1e-4
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_track_of_a_path_that_leaves_the_reach_ends_with_1(path_file: Path, run: Run) -> None:
    text = path_file.read_text(encoding="utf-8")
    path_file.write_text(text.replace("\n0.4,", "\n1.4,"), encoding="utf-8")
    words = ("track", "--path", str(path_file), "--dt", "0.05", "--speed", "0.5")
    shown = run(*words, code=1).out
    assert "NOT on the path" in shown
    assert "start branch" in shown


@pytest.mark.slow
def test_track_keeps_limits_in_degrees_and_clear_of_obstacles(run: Run, path_file: Path) -> None:
    out = path_file.with_name("trajectory.npz")
    words = ("track", "--path", str(path_file), "--output", str(out), "--dt", "0.02", "--degrees")
    run(*words, "--velocity-limit", "12", "--angular-speed", "20", "--speed", "0.02")
    assert np.abs(Trajectory.load(out).v).max() <= np.radians(12.0) + 1e-9
    # The path leads through a box: the tool stops before it.
    scene = path_file.with_name("scene.json")
    box = {"shape": "box", "name": "box", "size": [0.1, 0.1, 0.1], "position": [0.4, -0.2, 0.5]}
    scene.write_text(json.dumps([box]), encoding="utf-8")
    before = out.read_bytes()
    shown = run(*words, "--scene", scene, "--clearance", "0.01", code=1).out
    assert "NOT on the path" in shown
    assert "not written" in shown
    assert out.read_bytes() == before
    run(*words, "--scene", scene, "--clearance", "0.01", "--save-failed", code=1)
    assert not Trajectory.load(out).success


def test_track_starts_near_a_seed_in_degrees(path_file: Path, run: Run) -> None:
    words = ("track", "--path", str(path_file), "--dt", "0.05", "--json")
    starts = [branch["q_start"] for branch in run(*words).document["branches"]]
    again = run(*words, "--degrees", "--seed", *map(repr, np.degrees(starts[0]).tolist())).document
    assert again["angle_unit"] == "deg"
    assert np.allclose(again["branches"][0]["q_start"], np.degrees(starts[0]), rtol=0.0, atol=1e-9)


def test_a_plan_is_written_and_clear_of_the_scene(robot: Robot, path_file: Path, run: Run) -> None:
    out, scene = path_file.with_name("plan.csv"), path_file.with_name("scene.yaml")
    scene.write_text(TABLE)
    words = ("plan", "--path", str(path_file), "--dt", "0.05", "--output", str(out), "--scene", str(scene), "--json")
    document = run(*words, "--free-axis", "x", "--clearance", "0.01").document
    assert document["success"]
    assert document["max_position_error"] < 1e-8
    result = Trajectory.load(out)
    assert np.min(robot.clearance(result.q, Scene.load(scene))) > 0.01
    assert document["least_clearance"] == result.clearance.min() > 0.01
    assert document["parameter"] == result.parameter.tolist()


def test_seven_joints_and_what_was_chosen(path_file: Path, run: Run) -> None:
    """A plan of seven joints for ROS, and the angle of joint 3 at both poses in degrees."""
    out, rows = path_file.with_name("plan.json"), path_file.with_name("plan.csv")
    words = ("plan", "--path", str(path_file), "--dt", "0.05", "--robot", "j2s7s300", "--timing", "slow", "--degrees")
    assert "joint_3 at the poses" in run(*words, "--output", out).out
    message = json.loads(out.read_text(encoding="utf-8"))
    assert message["joint_names"] == [f"joint_{k}" for k in range(1, 8)]
    document, result = run(*words, "--output", rows, "--json").document, Trajectory.load(rows)
    np.testing.assert_array_equal([point["positions"] for point in message["points"]], result.q)
    np.testing.assert_allclose(document["parameter"], np.degrees(result.q[[0, -1], 2]), atol=1e-9)
    assert "on the path throughout" in run(*words, "--free-axis", "x").out


@pytest.mark.parametrize("command", ["plan", "track"])
def test_a_tool_and_limits_of_ones_own(path_file: Path, run: Run, command: str) -> None:
    out = path_file.with_name("out.npz")
    words = ("--tool", "0", "0.01", "-0.03", "--limit", "joint_1=0,3.9", "--dt", "0.05", "--output", str(out))
    run(command, "--path", path_file, *words)
    q = Trajectory.load(out).q
    assert (q[:, 0] >= 0.0).all()
    assert (q[:, 0] <= 3.9).all()
    tips = [jacokin.load_robot().forward_kinematics(row) * jacokin.pose([0.0, 0.01, -0.03]) for row in q[[0, -1]]]
    np.testing.assert_allclose([tip.translation for tip in tips], [[0.3, -0.2, 0.5], [0.4, -0.2, 0.5]], atol=1e-4)


def test_seven_joints_are_tracked(path_file: Path, run: Run) -> None:
    assert "on the path throughout" in run("track", "--path", path_file, "--dt", "0.05", "--robot", "j2s7s300").out


def test_slower_in_degrees(path_file: Path, run: Run) -> None:
    words = ("plan", "--path", str(path_file), "--dt", "0.02", "--speed", "0.5", "--degrees", "--velocity-limit", "15")
    assert "cannot follow at this speed" in run(*words, code=1).out
    free = ("--free-axis", "0 0 1", "--free-range", "-20", "20")
    out = path_file.with_name("plan.npz")
    slow = ("--timing", "slow", "--acceleration-limit", "100", "--output", str(out))
    run(*words, *slow, *free)
    assert np.abs(Trajectory.load(out).v).max() <= np.radians(15.0) + 1e-9


def test_scenes_of_ik_and_track(path_file: Path, run: Run) -> None:
    scene = path_file.with_name("scene.yaml")
    scene.write_text(BLOCK)
    answer = run("ik", *POSE, "--scene", scene, "--json", code=1)
    assert answer.document["status"] == "IN_COLLISION"
    assert any("block" in pair for pair in answer.document["touching"])
    scene.write_text(TABLE)
    run("ik", *POSE, "--scene", scene, "--clearance", "0.01")
    scene.write_text("- {shape: cone}\n")
    assert "obstacle 0: 'cone'" in run("ik", *POSE, "--scene", scene, code=2).err
    scene.write_text(BLOCK)
    run("track", "--path", path_file, "--dt", "0.05", "--scene", scene, code=1)


@pytest.mark.parametrize(
    ("command", "words", "message"),
    [(command, *case) for command, own in (("track", TRACK), ("plan", PLAN)) for case in (*BOTH, *own)],
)
def test_wrong_input_is_refused(path_file: Path, run: Run, command: str, words: tuple[str, ...], message: str) -> None:
    answer = run(command, "--path", path_file, *words, code=2)
    assert message in answer.err
    assert answer.out == ""
    assert [file.name for file in path_file.parent.iterdir()] == ["path.csv"]


@pytest.mark.parametrize("command", ["track", "plan"])
def test_a_path_is_two_poses_with_orientations(path_file: Path, run: Run, command: str) -> None:
    lines = path_file.read_text(encoding="utf-8").splitlines()
    path_file.write_text("\n".join(lines[:2]), encoding="utf-8")
    assert "at least two" in run(command, "--path", path_file, code=2).err
    path_file.write_text("x,y,z\n0.3,-0.2,0.5\n0.4,-0.2,0.5\n", encoding="utf-8")
    assert "orientations" in run(command, "--path", path_file, code=2).err


def test_plotting_without_matplotlib_names_the_extra(
    path_file: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    assert ".[plot]" in run("track", "--path", path_file, "--plot", "a.png", code=2).err
