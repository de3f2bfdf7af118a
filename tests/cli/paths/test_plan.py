"""`jacokin plan`, and scenes on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin.ik import Scene
from jacokin.motion import PathResult
from tests.cli.run import POSE, Run, leave

TABLE = "- {shape: box, name: table, size: [0.6, 0.6, 0.05], position: [0.5, -0.5, 0.1]}\n"
BLOCK = "- {shape: box, name: block, size: [0.2, 0.2, 0.2], position: [0.3, -0.2, 0.5]}\n"


def test_a_plan_is_written_and_clear_of_the_scene(path_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, scene = path_file.with_name("plan.csv"), path_file.with_name("scene.yaml")
    scene.write_text(TABLE)
    words = ("plan", "--path", str(path_file), "--dt", "0.05", "--output", str(out), "--scene", str(scene), "--json")
    assert leave(*words, "--free-axis", "x", "--clearance", "0.01") == 0
    document = json.loads(capsys.readouterr().out)
    assert document["success"]
    assert document["max_position_error"] < 1e-8
    result = PathResult.load(out)
    robot = jacokin.load_robot()
    assert np.min(robot.clearance(result.q, Scene.load(scene))) > 0.01
    assert document["least_clearance"] == result.clearance.min() > 0.01
    assert document["parameter"] == result.parameter.tolist()


def test_seven_joints_and_what_was_chosen(path_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A plan of seven joints for ROS, and the angle of joint 3 at both poses in degrees."""
    out, rows = path_file.with_name("plan.json"), path_file.with_name("plan.csv")
    words = ("plan", "--path", str(path_file), "--dt", "0.05", "--robot", "j2s7s300", "--timing", "slow", "--degrees")
    assert leave(*words, "--output", str(out)) == 0
    assert "joint_3 at the poses" in capsys.readouterr().out
    message = json.loads(out.read_text(encoding="utf-8"))
    assert message["joint_names"] == [f"joint_{k}" for k in range(1, 8)]
    assert leave(*words, "--output", str(rows), "--json") == 0
    document, result = json.loads(capsys.readouterr().out), PathResult.load(rows)
    np.testing.assert_array_equal([point["positions"] for point in message["points"]], result.q)
    np.testing.assert_allclose(document["parameter"], np.degrees(result.q[[0, -1], 2]), atol=1e-9)
    assert leave(*words, "--free-axis", "x") == 2
    assert "a FreeAxis on seven joints leaves two free parameters" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["plan", "track"])
def test_a_tool_and_limits_of_ones_own(path_file: Path, run: Run, command: str) -> None:
    out = path_file.with_name("out.npz")
    words = ("--tool", "0", "0.01", "-0.03", "--limit", "joint_1=0,3.9", "--dt", "0.05", "--output", str(out))
    assert run(command, "--path", str(path_file), *words).code == 0
    q = PathResult.load(out).q
    assert (q[:, 0] >= 0.0).all()
    assert (q[:, 0] <= 3.9).all()
    tips = [jacokin.load_robot().forward_kinematics(row) * jacokin.pose([0.0, 0.01, -0.03]) for row in q[[0, -1]]]
    np.testing.assert_allclose([tip.translation for tip in tips], [[0.3, -0.2, 0.5], [0.4, -0.2, 0.5]], atol=1e-4)


def test_seven_joints_are_tracked(path_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert leave("track", "--path", str(path_file), "--dt", "0.05", "--robot", "j2s7s300") == 0
    assert "on the path throughout" in capsys.readouterr().out


def test_slower_in_degrees(path_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("plan", "--path", str(path_file), "--dt", "0.02", "--speed", "0.5", "--degrees", "--velocity-limit", "15")
    assert leave(*words) == 1
    assert "cannot follow at this speed" in capsys.readouterr().out
    free = ("--free-axis", "0 0 1", "--free-range", "-20", "20")
    out = path_file.with_name("plan.npz")
    slow = ("--timing", "slow", "--acceleration-limit", "100", "--output", str(out))
    assert leave(*words, *slow, *free) == 0
    assert np.abs(PathResult.load(out).v).max() <= np.radians(15.0) + 1e-9


def test_scenes_of_ik_and_track(path_file: Path, run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    scene = path_file.with_name("scene.yaml")
    scene.write_text(BLOCK)
    answer = run("ik", *POSE, "--scene", str(scene), "--json")
    assert answer.code == 1
    assert answer.document["status"] == "IN_COLLISION"
    assert any("block" in pair for pair in answer.document["touching"])
    scene.write_text(TABLE)
    assert run("ik", *POSE, "--scene", str(scene), "--clearance", "0.01").code == 0
    scene.write_text("- {shape: cone}\n")
    refused = run("ik", *POSE, "--scene", str(scene))
    assert refused.code == 2
    assert "obstacle 0: 'cone'" in refused.err
    scene.write_text(BLOCK)
    assert leave("track", "--path", str(path_file), "--dt", "0.05", "--scene", str(scene)) == 1
