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
from tests.logs.recordings import joint_state, measured_hand, names_of, visits, write

URDF = Path(__file__).parents[2] / "urdf"


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


def test_a_document_is_alone_on_stdout_when_files_are_written(run: Run, robot: Robot, tmp_path: Path) -> None:
    path, calibrated = tmp_path / "m.csv", tmp_path / "a.toml"
    planned = run("calibrate", "plan", "--points", "12", "--output", path, "--json").document
    assert len(planned["q"]) == 12
    fill_in(path, hidden_arm(robot, 1))
    document = run("calibrate", path, "--sigma", "0.0003", "--output", calibrated, "--json").document
    assert document["facts"]["measurements"] == 12
    assert calibrated.exists()


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [False, True])
def test_from_a_plan_to_an_arm(run: Run, robot: Robot, tmp_path: Path, degrees: bool) -> None:
    path, arm, unit = tmp_path / "m.csv", hidden_arm(robot, 1), ["--degrees"] if degrees else []
    assert "mm before" in run("calibrate", "plan", "--points", "12", "--output", path, *unit).out
    fill_in(path, arm, degrees=degrees)
    outputs = [
        "--output",
        str(tmp_path / "a.toml"),
        "--urdf",
        str(tmp_path / "a.urdf"),
        "--mjcf",
        str(tmp_path / "a.xml"),
    ]
    found = run("calibrate", path, "--sigma", "0.0003", *outputs, *unit)
    assert "12 of 12 measurements" in found.out
    assert f"written to {tmp_path / 'a.toml'}" in found.out
    loaded = jacokin.load_robot(calibration=tmp_path / "a.toml")
    assert mean_error(arm, loaded) < 0.25 * mean_error(arm, robot)
    assert jacokin.load_robot(tmp_path / "a.urdf").dof == 6
    document = run("calibrate", "fit", path, "--sigma", "0.0003", "--json", *unit).document
    assert document["facts"]["measurements"] == 12
    assert document["parameters"]["joint_1.offset"]["unit"] == "rad"
    run("ik", "--position", "0.3", "-0.2", "0.5", "--down", "--calibration", tmp_path / "a.toml")


def test_options_before_the_file(run: Run, robot: Robot, tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    run("calibrate", "plan", "--points", "8", "--output", path)
    fill_in(path, robot)
    run("calibrate", "--sigma", "0.0003", path)
    run("calibrate", path, "--sigma", "0.0003", "--robot", "j2s6s300", code=2)


def test_what_is_refused(run: Run, robot: Robot, tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    run("calibrate", "plan", "--points", "4", "--output", path)
    assert f"{path}: has no row of finite numbers" in run("calibrate", path, "--sigma", "0.001", code=2).err
    fill_in(path, robot)
    for words, sentence in [
        ((str(path),), "has no column sigma"),
        ((str(tmp_path / "none.csv"),), "cannot be read"),
        ((str(path), "--sigma", "0.001", "--estimate", "length"), "--estimate: unknown group of parameters 'length'"),
        (("/dev/zero", "--sigma", "0.001"), "is a device: give a file or a pipe"),
        ((str(path), "--sigma", "0.001", "--output", str(path)), "it would be lost"),
        ((str(path), "--sigma", "0.001", "--output", str(tmp_path / "none" / ".." / path.name)), "it would be lost"),
        ((str(path), "--sigma-angle", "0.001"), "--sigma-angle goes with --sigma"),
        ((str(path), "--sigma", "-1"), "sigma must be positive"),
        ((str(path), "--sigma", "0.001", "--contact", "line"), "unknown contact 'line'"),
        ((str(path), "--sigma", "0.001", "--estimate", "all"), "Valid: geometry, offset, scale, compliance"),
        (("plan", "--lower", "0", "0", "0"), "--lower goes with --upper"),
    ]:
        assert sentence in run("calibrate", *words, code=2).err


@pytest.mark.slow
def test_half_bad_sets_leave_with_two_and_write_nothing(run: Run, robot: Robot, tmp_path: Path) -> None:
    path, arm = tmp_path / "m.csv", hidden_arm(robot, 1)
    run("calibrate", "plan", "--points", "16", "--output", path)
    fill_in(path, arm)
    good = path.read_text().splitlines()
    rng = np.random.default_rng(0)
    rows = list(csv.DictReader(good))
    for row in rows[:11]:
        row |= {axis: repr(float(row[axis]) + float(rng.normal(0, 0.03))) for axis in "xyz"}
    bad = tmp_path / "bad.csv"
    with bad.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    refused = run("calibrate", bad, "--sigma", "0.0003", "--output", tmp_path / "a.toml", code=2)
    assert str(bad) in refused.err or "cannot tell" in refused.err
    assert not (tmp_path / "a.toml").exists()
    (tmp_path / "long.csv").write_text("\n".join([*good[:3], good[3] + ",1.0", *good[4:]]))
    assert (
        "long.csv: line 4 has 10 cells, and there are 9 columns" in run("calibrate", tmp_path / "long.csv", code=2).err
    )
    moved = run("calibrate", path, "--sigma", "0.0003", "--prior", "0.002", "0.005", "0.02", "--json")
    assert moved.document["parameters"]["joint_1.x"]["prior"] == 0.002
    assert moved.document["base"] is None


def test_units_are_named_by_file_and_option(run: Run, robot: Robot, tmp_path: Path) -> None:
    path = tmp_path / "m.csv"
    run("calibrate", "plan", "--points", "8", "--output", path, "--degrees")
    fill_in(path, robot, degrees=True)
    refused = run("calibrate", path, "--sigma", "0.001", code=2)
    assert f"{path}: joint angles must be in radians and look like degrees: read them with --degrees\n" in refused.err


@pytest.mark.slow
def test_hand_eye(run: Run, robot: Robot, tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    q, camera = robot.sample(rng, 10), jacokin.pose([1.0, 0.4, 0.3], rpy=[0.3, 0.2, 2.0])
    T = [(camera * robot.forward_kinematics(row)).homogeneous for row in q]
    rows = np.hstack([q, [each[:3, 3] for each in T], [jacokin.model.quat_wxyz(each[:3, :3]) for each in T]])
    header = ",".join([*robot.joint_names, "x", "y", "z", "qw", "qx", "qy", "qz"])
    np.savetxt(tmp_path / "looks.csv", rows, delimiter=",", header=header, comments="")
    words = ("calibrate", str(tmp_path / "looks.csv"), "--sigma", "0.001", "--sigma-angle", "0.002")
    unknown = ("--unknown-base", "--unknown-tool", "--estimate", "none")
    document = run(*words, *unknown, "--json").document
    np.testing.assert_allclose(document["base"], camera.homogeneous, atol=1e-6)
    np.testing.assert_allclose(document["tools"][0]["pose"], np.eye(4), atol=1e-6)
    assert "base in the instrument's frame: position (1.000000, 0.400000, 0.300000) m" in run(*words, *unknown).out
    assert "parameters is empty, and neither base nor tool" in run(*words, "--estimate", "none", code=2).err


def recorded(robot: Robot, hidden: Robot, folder: Path) -> Path:
    """A recording of an arm that stands at a dozen places."""
    times, q = visits(robot.sample(np.random.default_rng(4), 12), stand=2.2, rate=20.0)
    names, rows = names_of(robot).all, zip(times, q, strict=True)
    joints = [joint_state("/joint_states", float(t), names, [*row, 0.0, 0.0, 0.0]) for t, row in rows]
    return write(folder, ".mcap", [*joints, *measured_hand(hidden, times, q, 20.0, 3e-4, 1)])


@pytest.mark.slow
def test_from_a_recording_of_ros_to_an_arm(run: Run, robot: Robot, tmp_path: Path) -> None:
    hidden = hidden_arm(robot, 1)
    path, output = recorded(robot, hidden, tmp_path), tmp_path / "a.toml"
    errors = ["--sigma", "0.0001", "--sigma-angle", "0.0003"]
    assert "12 of 12 measurements" in run("calibrate", path, *errors, "--still", "0.01", "1", "--output", output).out
    assert mean_error(hidden, jacokin.load_robot(calibration=output)) < 0.1 * mean_error(hidden, robot)
    topics = ["--joints-topic", "/joint_states", "--pose-topic", "/tracker/hand"]
    assert run("calibrate", path, *errors, *topics, "--json").document["facts"]["measurements"] == 12


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--sigma", "0.001", "--kinova"], "--contact, --kinova and --degrees are not for a recording of ROS"),
        (["--sigma", "0.001", "--degrees"], "--contact, --kinova and --degrees are not for a recording of ROS"),
        ([], "--sigma is needed"),
        (["--sigma", "0.001", "--pose-topic", "/hand"], "unknown topic '/hand'. Valid: /joint_states, /tracker/hand"),
        (["--sigma", "0.001", "--still", "0.01", "60"], "the arm never stands still for 60 s"),
        (["--sigma", "0.001", "--joint-prefix", "left_"], "'left_' before their names"),
    ],
)
def test_what_a_recording_lacks_is_one_sentence(
    run: Run, robot: Robot, tmp_path: Path, words: list[str], message: str
) -> None:
    assert message in run("calibrate", recorded(robot, robot, tmp_path), *words, code=2).err


def test_options_of_recordings_are_for_recordings(run: Run, tmp_path: Path) -> None:
    words = ("calibrate", tmp_path / "m.csv", "--sigma", "0.001", "--still", "0.01", "1")
    assert "are for a recording of ROS" in run(*words, code=2).err


@pytest.mark.slow
def test_all_files_are_written_or_none(run: Run, robot: Robot, tmp_path: Path) -> None:
    plan, arm = tmp_path / "m.csv", tmp_path / "arm.toml"
    run("calibrate", "plan", "--points", "12", "--output", plan)
    fill_in(plan, robot)
    arm.write_text("old")
    nowhere = tmp_path / "nowhere" / "report.html"
    words = ("calibrate", plan, "--sigma", "3e-4", "--output", arm)
    assert f"{nowhere}: cannot be written" in run(*words, "--report", nowhere, code=2).err
    run(*words, "--mjcf", tmp_path / "a.xml", "--estimate", "scale", code=2)
    assert arm.read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["arm.toml", "m.csv"]


def test_wrong_files_and_numbers_are_named(run: Run, robot: Robot, tmp_path: Path) -> None:
    measured = tmp_path / "m.csv"
    measured.write_text("q1,q2,q3,q4,q5,x,y,z\n" + "0.1,0.2,0.3,0.4,0.5,0.6,0.7,0.8\n" * 4)
    words = ("calibrate", measured, "--sigma", "3e-4")
    assert run(*words, code=2).err == f"jacokin: {measured} must have 6 joint angles in a row, got 5\n"
    measured.write_text("q1,q2,q3,q4,q5,q6,a,y,z\n" + "0.1,0.2,0.3,0.4,0.5,0.6,0.7,0.8,0.9\n" * 4)
    result = run(*words, code=2)
    assert result.err.count(str(measured)) == 1
    assert "column x is missing" in result.err
    assert "--prior" in run(*words, "--prior", "0", "1", "1", code=2).err
    result = run("calibrate", "plan", "--lower", "0", "0", "0", "--upper", "1", "0", "1", code=2)
    assert "--lower must be below --upper [m]" in result.err


def test_a_plan_of_an_arm_with_other_names_is_read_back(run: Run, tmp_path: Path) -> None:
    text = (URDF / "j2n6s300.urdf").read_text().replace('"joint_', '"axis_')
    arm, plan = tmp_path / "arm.urdf", tmp_path / "m.csv"
    arm.write_text(text)
    run("calibrate", "plan", "--robot", arm, "--points", "12", "--output", plan)
    assert plan.read_text().startswith("joint_1,joint_2,joint_3,joint_4,joint_5,joint_6,x,y,z\n")


def test_a_kind_of_file_that_cannot_be_written_is_said_with_the_option_that_can(
    run: Run, robot: Robot, tmp_path: Path
) -> None:
    arm, measured = tmp_path / "arm.urdf", tmp_path / "m.csv"
    arm.write_text((URDF / "j2n6s300.urdf").read_text())
    q = robot.sample(np.random.default_rng(0), 20)
    rows = np.hstack([q, [robot.forward_kinematics(row).translation for row in q]])
    np.savetxt(measured, rows, delimiter=",", header="q1,q2,q3,q4,q5,q6,x,y,z", comments="", fmt="%.17g")
    answer = run("calibrate", measured, "--robot", arm, "--sigma", "3e-4", "--mjcf", tmp_path / "arm.xml", code=2)
    assert answer.err.endswith("is a URDF: --urdf writes it\n")
