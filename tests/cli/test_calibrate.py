"""`jacokin calibrate`: from a plan to a file of the arm."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from tests.calibration.simulated import hidden_arm, mean_error
from tests.cli.run import Run


def fill_in(path: Path, arm: Robot, *, degrees: bool = False) -> None:
    """Measure what a plan asks for."""
    rng = np.random.default_rng(0)
    rows = list(csv.DictReader(path.read_text().splitlines()))
    for row in rows:
        q = np.array([float(row[name]) for name in arm.joint_names])
        point = arm.forward_kinematics(np.radians(q) if degrees else q).translation + rng.normal(0, 3e-4, 3)
        row |= dict(zip("xyz", map(repr, point.tolist()), strict=True))
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)


@pytest.mark.parametrize("degrees", [False, True])
def test_from_a_plan_to_an_arm(run: Run, robot: Robot, tmp_path: Path, degrees: bool) -> None:
    path, arm, unit = tmp_path / "m.csv", hidden_arm(robot, 1), ["--degrees"] if degrees else []
    planned = run("calibrate", "plan", "--points", "12", "--output", str(path), *unit)
    assert planned.code == 0
    assert "mm before" in planned.out
    fill_in(path, arm, degrees=degrees)
    outputs = [
        "--output",
        str(tmp_path / "a.toml"),
        "--urdf",
        str(tmp_path / "a.urdf"),
        "--mjcf",
        str(tmp_path / "a.xml"),
    ]
    found = run("calibrate", str(path), "--sigma", "0.0003", *outputs, *unit)
    assert found.code == 0, found.err
    assert "12 of 12 measurements" in found.out
    assert f"written to {tmp_path / 'a.toml'}" in found.out
    loaded = jacokin.load_robot(calibration=tmp_path / "a.toml")
    assert mean_error(arm, loaded) < 0.25 * mean_error(arm, robot)
    assert jacokin.load_robot(tmp_path / "a.urdf").dof == 6
    document = run("calibrate", "fit", str(path), "--sigma", "0.0003", "--json", *unit).document
    assert document["facts"]["measurements"] == 12
    assert document["parameters"]["joint_1.offset"]["unit"] == "rad"
    solved = run("ik", "--position", "0.3", "-0.2", "0.5", "--down", "--calibration", str(tmp_path / "a.toml"))
    assert solved.code == 0


def test_options_before_the_file(run: Run, robot: Robot, tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    assert run("calibrate", "plan", "--points", "8", "--output", str(path)).code == 0
    fill_in(path, robot)
    assert run("calibrate", "--sigma", "0.0003", str(path)).code == 0
    assert run("calibrate", str(path), "--sigma", "0.0003", "--robot", "j2s6s300").code == 2


def test_what_is_refused(run: Run, robot: Robot, tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    assert run("calibrate", "plan", "--points", "4", "--output", str(path)).code == 0
    empty = run("calibrate", str(path), "--sigma", "0.001")
    assert empty.code == 2
    assert "has no row of finite numbers" in empty.err
    fill_in(path, robot)
    for words, sentence in [
        ((str(path),), "has no column sigma"),
        ((str(tmp_path / "none.csv"),), "cannot be read"),
        (("/dev/zero", "--sigma", "0.001"), "is a device: give a file or a pipe"),
        ((str(path), "--sigma", "0.001", "--output", str(path)), "it would be lost"),
        ((str(path), "--sigma-angle", "0.001"), "--sigma-angle needs --sigma"),
        ((str(path), "--sigma", "-1"), "sigma must be positive"),
        ((str(path), "--sigma", "0.001", "--contact", "line"), "unknown contact 'line'"),
        ((str(path), "--sigma", "0.001", "--estimate", "all"), "Valid: geometry, offset, scale, compliance"),
        (("plan", "--lower", "0", "0", "0"), "--lower and --upper go together"),
    ]:
        answer = run("calibrate", *words)
        assert answer.code == 2
        assert sentence in answer.err
