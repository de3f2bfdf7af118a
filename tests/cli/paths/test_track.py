"""`jacokin track`: a path in, a trajectory out, and what happens when a file is wrong."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin.motion import PathResult
from tests.cli.run import leave


def test_track_follows_a_line_inside_the_limits(path_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, plot = path_file.with_name("trajectory.csv"), path_file.with_name("trajectory.png")
    words = ("track", "--path", str(path_file), "--dt", "0.02", "--output", str(out), "--plot", str(plot), "--json")
    assert leave(*words) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["duration"] == pytest.approx(2.0)  # 0.1 m at 0.05 m/s
    assert document["max_position_error"] < 1e-4
    result = PathResult.load(out)
    robot = jacokin.load_robot()
    assert all(robot.within_limits(q) for q in result.q)
    assert (np.abs(result.v) <= robot.velocity_limit + 1e-9).all()
    last = robot.forward_kinematics(result.q[-1]).translation
    assert np.linalg.norm(last - [0.4, -0.2, 0.5]) < 1e-4
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_track_of_a_path_that_leaves_the_reach_ends_with_1(path_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = path_file.read_text(encoding="utf-8")
    path_file.write_text(text.replace("\n0.4,", "\n1.4,"), encoding="utf-8")
    words = ("track", "--path", str(path_file), "--dt", "0.05", "--speed", "0.5")
    assert leave(*words) == 1
    shown = capsys.readouterr().out
    assert "NOT on the path" in shown
    assert "start branch" in shown


def test_track_keeps_limits_in_degrees_and_clear_of_obstacles(
    path_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = path_file.with_name("trajectory.npz")
    words = ("track", "--path", str(path_file), "--output", str(out), "--dt", "0.02", "--degrees")
    assert leave(*words, "--velocity-limit", "12", "--angular-speed", "20", "--speed", "0.02") == 0
    assert np.abs(PathResult.load(out).v).max() <= np.radians(12.0) + 1e-9
    capsys.readouterr()
    # The path leads through a box: the tool stops before it.
    scene = path_file.with_name("scene.json")
    box = {"shape": "box", "name": "box", "size": [0.1, 0.1, 0.1], "position": [0.4, -0.2, 0.5]}
    scene.write_text(json.dumps([box]), encoding="utf-8")
    assert leave(*words, "--scene", str(scene), "--clearance", "0.01") == 1
    assert "NOT on the path" in capsys.readouterr().out


def test_track_starts_near_a_seed_in_degrees(path_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("track", "--path", str(path_file), "--dt", "0.05", "--json")
    leave(*words)
    starts = [branch["q_start"] for branch in json.loads(capsys.readouterr().out)["branches"]]
    leave(*words, "--degrees", "--seed", *map(repr, np.degrees(starts[0]).tolist()))
    again = json.loads(capsys.readouterr().out)
    assert again["angle_unit"] == "deg"
    assert np.allclose(again["branches"][0]["q_start"], np.degrees(starts[0]), rtol=0.0, atol=1e-9)
