"""Trajectory files: exact round trips, exports for ROS and Kinova, and files that are not ours."""

from __future__ import annotations

import copy
import csv
import io
import json
import math
import pickle
import re
import zipfile
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from jacokin import IKSolver, Robot, Tracker, load_robot
from jacokin.errors import InvalidInputError
from jacokin.motion import Trajectory, move_joints, plan_motion, track_path
from jacokin.motion import trajectory as trajectories
from tests.programs import python
from tests.robot_files import CRANE


@pytest.fixture(scope="module")
def motion(robot: Robot) -> Trajectory:
    goal = robot.home.copy()
    goal[[0, 1, 5]] += [2.0, 0.4, -1.0]
    return move_joints(robot, robot.home, goal, dt=0.013)


@pytest.fixture(params=["path", "motion"])
def trajectory(request: pytest.FixtureRequest) -> Trajectory:
    """Either kind of result."""
    found: Trajectory = request.getfixturevalue("result" if request.param == "path" else "motion")
    return found


@pytest.fixture(scope="module")
def lifting(tmp_path_factory: pytest.TempPathFactory) -> Trajectory:
    """A motion of an arm whose second joint slides."""
    file = tmp_path_factory.mktemp("crane") / "crane.urdf"
    file.write_text(CRANE, encoding="utf-8")
    robot = load_robot(file)
    return move_joints(robot, [0.0, 0.2, 0.0], [0.1, 0.7, 0.4])


@pytest.mark.parametrize("name", ["made.csv", "made.npz"])
def test_which_joints_slide_comes_back(lifting: Trajectory, motion: Trajectory, tmp_path: Path, name: str) -> None:
    assert lifting.sliding.tolist() == [False, True, False]
    lifting.save(tmp_path / name)
    back = Trajectory.load(tmp_path / name)
    assert back.sliding.tolist() == [False, True, False]
    assert not back.sliding.flags.writeable
    motion.save(tmp_path / name)
    assert Trajectory.load(tmp_path / name).sliding.tolist() == [False] * 6
    # An arm whose joints all turn has the files that it had before.
    assert b"sliding" not in (tmp_path / name).read_bytes()


@pytest.mark.parametrize("name", ["made.kinova.csv", "made.kinova.json"])
def test_metres_are_not_written_as_degrees(lifting: Trajectory, tmp_path: Path, name: str) -> None:
    lifting.save(tmp_path / "kept.csv")
    for trajectory in (lifting, Trajectory.load(tmp_path / "kept.csv")):
        with pytest.raises(InvalidInputError, match=rf"{name}.*Kinova's files hold angles, and slide slides"):
            trajectory.save(tmp_path / name)
    assert not (tmp_path / name).exists()
    lifting.save(tmp_path / "made.json")
    message = json.loads((tmp_path / "made.json").read_text(encoding="utf-8"))
    assert message["points"][-1]["positions"] == lifting.q[-1].tolist()


def test_every_motion_knows_which_joints_slide(lifting: Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "crane.urdf"
    file.write_text(CRANE, encoding="utf-8")
    robot = load_robot(file)
    solver = IKSolver(robot)
    poses = [robot.forward_kinematics(q) for q in ([0.0, 0.4, 0.0], [0.05, 0.45, 0.05])]
    found = (track_path(robot, poses, start=[0.0, 0.4, 0.0]), plan_motion(solver, [0.0, 0.2, 0.0], [0.1, 0.7, 0.4]))
    for trajectory in found:
        assert trajectory.sliding.tolist() == [False, True, False]
    away = track_path(robot, poses)
    assert "m (slide) from home: bring the arm to q[0] first" in away.message
    fast = replace(lifting, velocity_limit=0.1 * lifting.velocity_limit, outcome="OK")
    assert re.search(r"slide moves \S+ m from row .*: faster than 0.1 m/s", fast.message)


def test_values_of_a_slide_are_told_in_metres(lifting: Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "crane.urdf"
    file.write_text(CRANE, encoding="utf-8")
    robot = load_robot(file)
    outside, far = [0.0, 2.0, 0.0], [0.0, 1e9, 0.0]
    with pytest.raises(InvalidInputError, match=r"q_to puts slide at 2 m, outside \[0, 1.5\] m$"):
        move_joints(robot, lifting.q[0], outside)
    with pytest.raises(InvalidInputError, match=r"slide = 1e\+09 m is too far from zero; use a value within 1e6$"):
        move_joints(robot, lifting.q[0], far)
    tracker = Tracker(robot, dt=0.01, q=outside)
    with pytest.raises(InvalidInputError, match=r"v has slide at 9 m/s, its limit is 1 m/s"):
        tracker.reset(lifting.q[0], v=[0.0, 9.0, 0.0])
    step = tracker.step(robot.forward_kinematics(lifting.q[0]))
    assert "slide is 0.5 m past its limit and moves only inwards" in step.message


def test_a_wrong_word_on_sliding_is_refused(lifting: Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "made.csv"
    lifting.save(file)
    text = file.read_text(encoding="utf-8")
    assert "# sliding,0,1,0" in text
    for told in ("0,2,0", "0,1", "0,x,0"):
        file.write_text(text.replace("# sliding,0,1,0", f"# sliding,{told}"), encoding="utf-8")
        with pytest.raises(InvalidInputError, match=r"made\.csv.*sliding"):
            Trajectory.load(file)


@pytest.mark.parametrize("name", ["made.csv", "made.npz"])
def test_files_come_back_exactly(trajectory: Trajectory, tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    trajectory.save(file)
    back = Trajectory.load(file)
    of_paths = ("position_error", "orientation_error", "segment") if trajectory.follows_path else ("a",)
    for field in ("t", "q", "v", "lower", "upper", "velocity_limit", *of_paths):
        assert np.array_equal(getattr(back, field), getattr(trajectory, field)), field
        assert not getattr(back, field).flags.writeable
    assert np.array_equal(back.clearance, trajectory.clearance, equal_nan=True)
    for field in ("joint_names", "status", "limiting", "qp_solver", "message", "success"):
        assert getattr(back, field) == getattr(trajectory, field)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    if name == "made.csv":
        assert ("position_error" in file.read_text(encoding="utf-8")) is trajectory.follows_path


def test_a_failed_save_leaves_the_old_file(result: Trajectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "path.csv"
    file.write_text("precious")

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(trajectories, "write_table", fail)
    with pytest.raises(InvalidInputError, match="No space left"):
        result.save(file)
    assert file.read_text() == "precious"
    assert [path.name for path in tmp_path.iterdir()] == ["path.csv"]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("empty.csv", ""),
        ("other.csv", "a,b\n1,2\n"),
        ("binary.csv", "\x00\x01"),
        ("text.npz", "not an archive"),
    ],
)
def test_files_that_are_not_ours_are_refused(tmp_path: Path, name: str, text: str) -> None:
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises(InvalidInputError, match=name):
        Trajectory.load(file)


@pytest.mark.parametrize("damage", ["x", "1_", "\u0663"])  # the last is a digit, but not to C
def test_a_damaged_line_is_named(result: Trajectory, tmp_path: Path, damage: str) -> None:
    file = tmp_path / "path.csv"
    result.save(file)
    lines = file.read_text().splitlines()
    lines[10] = lines[10].replace(",", f",{damage}", 1)
    file.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InvalidInputError, match="line 11"):
        Trajectory.load(file)


@pytest.mark.slow
def test_files_that_were_cut_off_are_refused(motion: Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "motion.csv"
    motion.save(file)
    lines = file.read_text().splitlines(keepends=True)
    file.write_text("".join(lines[:-5]))
    with pytest.raises(InvalidInputError, match=f"{len(motion) - 5} rows of the {len(motion)} that were written"):
        Trajectory.load(file)
    file.write_text("".join(line for line in lines[:-5] if not line.startswith("# rows")))  # of an earlier version
    assert len(Trajectory.load(file)) == len(motion) - 5


def test_unusable_file_names(result: Trajectory, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=r"must end in \.csv or \.npz"):
        result.save(tmp_path / "path.txt")
    with pytest.raises(InvalidInputError, match="cannot be written"):
        result.save(tmp_path / "missing" / "path.csv")
    with pytest.raises(InvalidInputError, match="cannot be read"):
        Trajectory.load(tmp_path / "missing.npz")


def test_damaged_archives_are_refused(result: Trajectory, motion: Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "path.npz"
    for trajectory, names in ((result, ("q", "v", "lower")), (motion, ("q", "a", "upper"))):
        trajectory.save(file)
        whole = file.read_bytes()
        with np.load(file) as archive:
            numbers = dict(archive)
        for name, damaged in zip(names, (numbers["q"][:2], numbers["v"].astype(str), np.zeros(5)), strict=True):
            np.savez(file, **{**numbers, name: damaged})
            with pytest.raises(InvalidInputError, match=f"{name} has the wrong shape or type"):
                type(trajectory).load(file)
        file.write_bytes(whole[: len(whole) // 2])
        with pytest.raises(InvalidInputError, match="not a trajectory written by jacokin"):
            type(trajectory).load(file)
    for refused in (lambda: Trajectory.load(None), lambda: result.save(None)):  # type: ignore[arg-type]  # wrong on purpose
        with pytest.raises(InvalidInputError, match="file name"):
            refused()


def test_files_without_sense_are_refused(trajectory: Trajectory, tmp_path: Path) -> None:
    """Numbers that are not finite, times that do not rise, and arrays that no trajectory has."""
    q, t = trajectory.q.copy(), trajectory.t.copy()
    q[3, 1], t[4] = np.nan, t[3]
    for name in ("path.csv", "path.npz"):
        file = tmp_path / name
        for wrong, message in (
            (replace(trajectory, q=q), "q is not finite"),
            (replace(trajectory, t=t), "t does not rise"),
            (replace(trajectory, lower=np.full_like(trajectory.lower, np.nan)), "lower is not a number"),
            (replace(trajectory, outcome="FINE"), "outcome is none of OK, "),
        ):
            wrong.save(file, failed=True)
            with pytest.raises(InvalidInputError, match=message):
                type(trajectory).load(file)
    trajectory.save(file)
    with np.load(file) as archive:
        numbers = dict(archive)
    np.savez(file, **numbers, strange=np.zeros(3))
    with pytest.raises(InvalidInputError, match="it holds strange"):
        type(trajectory).load(file)


def test_paths_saved_before_parameters_were_are_read(result: Trajectory, tmp_path: Path) -> None:
    csv_file, npz_file = tmp_path / "path.csv", tmp_path / "path.npz"
    result.save(csv_file)
    lines = csv_file.read_text(encoding="utf-8").splitlines()
    csv_file.write_text("\n".join(line for line in lines if not line.startswith("# parameter")), encoding="utf-8")
    result.save(npz_file)
    with np.load(npz_file) as archive:
        numbers = {name: archive[name] for name in archive.files if name != "parameter"}
    np.savez(npz_file, **numbers)
    for file in (csv_file, npz_file):
        assert Trajectory.load(file).parameter.size == 0


def test_files_of_earlier_versions_are_read(result: Trajectory, motion: Trajectory, tmp_path: Path) -> None:
    """Paths had no accelerations and no outcome; motions had their distances in a note, which might be empty."""
    file = tmp_path / "path.npz"
    result.save(file)
    with np.load(file) as archive:
        numbers = {name: archive[name] for name in archive.files if name not in ("a", "outcome")}
    np.savez(file, **numbers)
    back = Trajectory.load(file)
    np.testing.assert_allclose(back.a[1:], np.diff(result.v, axis=0) / np.diff(result.t)[:, None])
    assert (back.outcome, back.success, back.follows_path) == ("OK", True, True)
    file = tmp_path / "motion.csv"
    for known in ("", ",".join(["0.25"] * len(motion))):
        replace(motion, clearance=np.full(len(motion), 0.5)).save(file)
        lines = file.read_text(encoding="utf-8").splitlines()
        table = [line.rpartition(",")[0] if not line.startswith("#") else line for line in lines]
        file.write_text("\n".join([f"# clearance,{known}" if known else "# clearance", *table]), encoding="utf-8")
        back = Trajectory.load(file)
        np.testing.assert_array_equal(back.clearance, np.full(len(motion), 0.25 if known else np.nan))
        np.testing.assert_array_equal(back.a, motion.a)
        assert not back.follows_path


def test_a_path_that_is_left_is_no_success(result: Trajectory) -> None:
    left = replace(result, status=("LOST", *result.status[1:]))
    assert (left.outcome, left.success) == ("OFF_PATH", False)
    assert "NOT on the path" in str(left)


def member(shape: tuple[int, ...], content: bytes = b"") -> bytes:
    """A file in NPY format that claims a shape."""
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<f8", "fortran_order": False, "shape": shape})
    return stream.getvalue() + content


@pytest.mark.parametrize(
    "content",
    [member((10**12,)), member((10**6, 10**6, 10**6)), b"no magic", member((600_000_000,)), b""],
    ids=["claims terabytes", "overflows", "no magic", "claims gigabytes", "empty"],
)
def test_archives_that_claim_too_much_are_refused(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "path.npz"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("q.npy", content)
    with pytest.raises(InvalidInputError, match="not a trajectory"):
        Trajectory.load(file)


@pytest.mark.slow
def test_a_path_survives_a_locale_without_utf8(result: Trajectory, tmp_path: Path) -> None:
    file, copied = tmp_path / "path.csv", tmp_path / "copy.csv"
    replace(result, message="Gelenk 2 läuft über 90°").save(file)
    code = "import sys; from jacokin.motion import Trajectory; Trajectory.load(sys.argv[1]).save(sys.argv[2])"
    environment = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    python("-c", code, file, copied, environment=environment)
    assert copied.read_bytes() == file.read_bytes()


def arrays(value: Any) -> list[NDArray[np.float64]]:
    return [found for each in fields(value) if isinstance(found := getattr(value, each.name), np.ndarray)]


def test_copies_stay_read_only(trajectory: Trajectory) -> None:
    for other in (pickle.loads(pickle.dumps(trajectory)), copy.deepcopy(trajectory)):
        assert len(arrays(other)) >= 7
        for array in arrays(other):
            assert not array.flags.writeable
    if trajectory.follows_path:
        assert not pickle.loads(pickle.dumps(trajectory)).branches[0].q_start.flags.writeable


def test_json_has_the_fields_of_a_ros_trajectory(trajectory: Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "trajectory.json"
    trajectory.save(file)
    message = json.loads(file.read_text(encoding="utf-8"))
    assert tuple(message["joint_names"]) == trajectory.joint_names
    points = message["points"]
    assert len(points) == len(trajectory)
    assert np.array_equal([point["positions"] for point in points], trajectory.q)
    assert np.array_equal([point["velocities"] for point in points], trajectory.v)
    assert np.array_equal([point["accelerations"] for point in points], trajectory.a)
    times = [point["time_from_start"]["sec"] + 1e-9 * point["time_from_start"]["nanosec"] for point in points]
    assert np.allclose(times, trajectory.t, atol=1e-9)
    assert all(0 <= point["time_from_start"]["nanosec"] < 10**9 for point in points)


def test_json_for_ros_1_and_with_the_names_of_a_driver(trajectory: Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "trajectory.json"
    trajectory.save(file, ros=1, joint_prefix="j2n6s300_")
    message = json.loads(file.read_text(encoding="utf-8"))
    assert message["joint_names"] == [f"j2n6s300_{name}" for name in trajectory.joint_names]
    times = [point["time_from_start"]["secs"] + 1e-9 * point["time_from_start"]["nsecs"] for point in message["points"]]
    assert np.allclose(times, trajectory.t, atol=1e-9)
    with pytest.raises(InvalidInputError, match="ros must be a whole number <= 2"):
        trajectory.save(file, ros=3)
    with pytest.raises(InvalidInputError, match=r"ros, joint_prefix and first_time are for \.json files"):
        trajectory.save(tmp_path / "trajectory.csv", joint_prefix="a")


def test_a_first_time_is_for_controllers_that_drop_a_point_at_time_0(trajectory: Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "trajectory.json"
    trajectory.save(file, first_time=0.25)
    points = json.loads(file.read_text(encoding="utf-8"))["points"]
    times = [point["time_from_start"]["sec"] + 1e-9 * point["time_from_start"]["nanosec"] for point in points]
    assert np.allclose(times, trajectory.t + 0.25, atol=1e-9)
    for wrong in (-0.1, np.inf, 11.0, "0.1"):
        with pytest.raises(InvalidInputError, match="first_time must be"):
            trajectory.save(file, first_time=wrong)  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InvalidInputError, match=r"first_time are for \.json files"):
        trajectory.save(tmp_path / "trajectory.csv", first_time=0.1)


ENDINGS = ["motion.csv", "motion.npz", "motion.json", "motion.kinova.csv"]


@pytest.mark.parametrize("name", ENDINGS)
def test_what_failed_is_not_saved(motion: Trajectory, tmp_path: Path, name: str) -> None:
    one = {field: getattr(motion, field)[:1] for field in ("t", "q", "v", "a")}
    failed = replace(motion, **one, outcome="NO_WAY", message="no way was found", **short(motion, 1))
    file = tmp_path / name
    with pytest.raises(InvalidInputError, match="failed is not saved: NO_WAY, no way was found"):
        failed.save(file)
    if name in ENDINGS[:2]:
        failed.save(file, failed=True)
        back = Trajectory.load(file)
        assert (back.success, back.outcome, len(back)) == (False, "NO_WAY", 1)
        with pytest.raises(InvalidInputError, match="NO_WAY"):
            back.save(tmp_path / "again.csv")
    else:
        with pytest.raises(InvalidInputError, match="NO_WAY"):
            failed.save(file, failed=True)
        assert not file.exists()


def short(motion: Trajectory, rows: int) -> dict[str, Any]:
    """The fields of the first rows."""
    names = ("clearance", "position_error", "orientation_error", "status", "limiting", "segment")
    return {name: getattr(motion, name)[:rows] for name in names}


@pytest.mark.parametrize("name", ENDINGS)
@pytest.mark.parametrize("jump", [2.0 * np.pi, 0.02, np.nan])
def test_nothing_that_jumps_leaves_the_library(trajectory: Trajectory, tmp_path: Path, name: str, jump: float) -> None:
    q = trajectory.q.copy()
    q[len(q) // 2 :, 3] += jump
    wrong = replace(trajectory, q=q)
    assert (wrong.success, wrong.outcome) == (False, "TOO_FAST")
    assert "joint_4 moves" in wrong.message
    with pytest.raises(InvalidInputError, match="TOO_FAST, joint_4 moves"):
        wrong.save(tmp_path / name)
    q[:] = trajectory.q  # what was checked is not changed from outside
    assert not np.array_equal(wrong.q, q)


@pytest.mark.parametrize("name", ["path.csv", "path.npz"])
def test_a_file_that_was_changed_to_jump_is_no_success(motion: Trajectory, tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    motion.save(file)
    if name == "path.npz":
        with np.load(file) as archive:
            numbers = dict(archive)
        numbers["q"][5:, 0] += 2.0 * np.pi
        np.savez(file, **numbers)
    else:
        lines = file.read_text(encoding="utf-8").splitlines()
        limit = next(k for k, line in enumerate(lines) if line.startswith("# velocity_limit"))
        lines[limit] = "# velocity_limit,0.1,0.1,0.1,0.1,0.1,0.1"
        file.write_text("\n".join(lines), encoding="utf-8")
    back = Trajectory.load(file)
    assert (back.success, back.outcome) == (False, "TOO_FAST")
    for ending in ENDINGS:
        with pytest.raises(InvalidInputError, match="TOO_FAST"):
            back.save(tmp_path / ending)


def test_rows_as_controllers_of_ros_take_them(trajectory: Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "trajectory.json"
    rests = trajectory.v.copy()
    rests[-1] = 2e-7
    with pytest.raises(InvalidInputError, match="the last row is not at rest"):
        replace(trajectory, v=rests).save(file)
    wild = trajectory.v.copy()
    wild[10, 2] = 1.0
    with pytest.raises(InvalidInputError, match="joint_3 would pass its limit by .* between rows .* a smaller dt"):
        replace(trajectory, v=wild).save(file)
    wild = trajectory.a.copy()
    wild[10, 2] = 1e6
    with pytest.raises(InvalidInputError, match="joint_3 would pass its limit by .* interpolates by quintics"):
        replace(trajectory, a=wild).save(file)
    assert not file.exists()


def test_where_it_starts_outside_it_may_come_inside(motion: Trajectory, tmp_path: Path) -> None:
    lower = motion.lower.copy()
    lower[1] = motion.q[len(motion) // 2, 1]
    inwards = replace(motion, lower=lower)
    for name in ENDINGS:
        inwards.save(tmp_path / name)
    outwards = replace(motion, lower=lower, q=motion.q[::-1].copy(), v=-motion.v[::-1], a=motion.a[::-1])
    for name in ENDINGS[2:]:
        with pytest.raises(InvalidInputError, match="joint_2"):
            outwards.save(tmp_path / name)


def test_results_print_short(trajectory: Trajectory) -> None:
    assert repr(trajectory).count("\n") == 0
    assert len(repr(trajectory)) < 200
    assert len(str(trajectory)) < 400
    assert len(repr([trajectory, trajectory])) < 400


def kinova_rows(file: Path) -> tuple[list[str], NDArray[np.float64]]:
    with file.open(newline="", encoding="utf-8") as stream:
        head, *rows = csv.reader(stream)
    return head, np.array(rows, dtype=np.float64)


def test_kinova_files_are_velocities_at_100_hz(trajectory: Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "trajectory.kinova.csv"
    trajectory.save(file)
    head, rows = kinova_rows(file)
    assert head == ["time_s", *(f"joint{k}_deg" for k in range(1, 7)), *(f"joint{k}_deg_s" for k in range(1, 7))]
    time, angles, speeds = rows[:, 0], rows[:, 1:7], rows[:, 7:]
    assert np.array_equal(time, np.arange(len(rows)) / 100)
    assert 0.0 <= time[-1] - trajectory.t[-1] < 0.01
    # Sent in turn for 10 ms each, the velocities lead from the first angles through all others to the last.
    sent = angles[0] + np.vstack([np.zeros(6), np.cumsum(0.01 * speeds[:-1], axis=0)])
    assert np.allclose(sent, angles, atol=1e-9)
    assert not speeds[-1].any()
    assert np.allclose(angles[[0, -1]], np.degrees(trajectory.q[[0, -1]]), atol=1e-12)
    for column, original in zip(angles.T, trajectory.q.T, strict=True):
        assert np.allclose(column, np.degrees(np.interp(time, trajectory.t, original)), atol=1e-9)
    # Limits hold after resampling, read the way a user would.
    radians = np.array([[math.radians(angle) for angle in row] for row in angles.tolist()])
    assert (radians >= trajectory.lower).all()
    assert (radians <= trajectory.upper).all()
    assert (np.abs(speeds) <= np.degrees(trajectory.velocity_limit) + 1e-7).all()


def test_kinova_files_keep_joints_that_stand_on_their_limits(robot: Robot, motion: Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "limit.kinova.csv"
    for limit in (robot.lower, robot.upper):
        q = motion.q.copy()
        q[:, 1:3] = limit[1:3]
        replace(motion, q=q).save(file)
        radians = np.radians(kinova_rows(file)[1][:, 2:4])
        assert (radians >= robot.lower[1:3]).all()
        assert (radians <= robot.upper[1:3]).all()


def test_a_trajectory_that_breaks_limits_is_not_sent(motion: Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "fast.kinova.csv"
    with pytest.raises(InvalidInputError, match="TOO_FAST, joint_1 moves"):
        replace(motion, velocity_limit=motion.velocity_limit * 0.5).save(file)
    with pytest.raises(InvalidInputError, match="joint_2 breaks its limit after resampling"):
        replace(motion, upper=np.array([np.inf, motion.q[0, 1], *motion.upper[2:]])).save(file)
    assert not file.exists()
