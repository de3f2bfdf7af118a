"""Cartesian paths: straight lines at the speed asked for, the right start branch, files, and wrong input."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver, Robot
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.motion import Trajectory, plot_path, track_path
from jacokin.motion.rows import most_between
from jacokin.motion.track import start_branches
from jacokin.motion.trajectory import list_segments

POSE = pin.SE3(np.eye(3), np.array([0.3, -0.2, 0.5]))


def test_a_square_is_followed(robot: Robot, square: list[pin.SE3], result: Trajectory) -> None:
    assert result.success
    assert result.failed_segments == ()
    assert result.t[-1] == pytest.approx(1.0 + 0.5 + 1.0 + 0.5)
    assert np.bincount(result.segment).tolist() == [101, 50, 100, 50]
    assert result.position_error.max() < 1e-5
    for q in result.q:
        place = robot.forward_kinematics(q).translation - square[0].translation
        edges = [abs(place[1]), abs(place[1] - 0.05), abs(place[2]), abs(place[2] - 0.05)]
        assert abs(place[0]) < 1e-4
        assert min(edges) < 1e-4
    assert not result.v[[0, -1]].any()
    assert (np.abs(result.v) <= robot.velocity_limit + 1e-9).all()
    assert (result.limit_margin >= 0.0).all()
    assert np.isinf(result.limit_margin[:, robot.unlimited]).all()
    assert "on the path throughout" in str(result)


@pytest.mark.slow
@pytest.mark.parametrize("wanted", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_branch_that_fails_gives_way_to_one_that_does_not(robot: Robot, wanted: int) -> None:
    """The seed stands where joint 3 soon meets its limit; another branch has room."""
    rng = np.random.default_rng(5)
    found = 0
    for _ in range(40):
        q = robot.sample(rng)
        q[2] = robot.lower[2] + 0.05
        start = robot.forward_kinematics(q)
        beyond = robot.forward_kinematics(np.array([*q[:2], 1.0, *q[3:]])).translation
        away = start.translation - 0.08 * (beyond - start.translation) / np.linalg.norm(beyond - start.translation)
        result = track_path(robot, [start, pin.SE3(start.rotation, away)], seed=q)
        if result.success and len(result.branches) > 1:
            found += 1
            assert all(report.failed_segments for report in result.branches[:-1])
            assert result.branches[-1].failed_segments == ()
            assert result.branches[-1].position_error <= 1e-4
            assert "stays on the path" in result.message
        elif not result.success:
            within = IKSolver(robot).solve_all(start).q_within_limits
            assert len(result.branches) == len(within)
            assert all(report.failed_segments == (0,) for report in result.branches)
        if found == wanted:
            return
    pytest.fail("no path of the sample needed another branch")


def test_a_sentence_names_a_few_segments() -> None:
    assert list_segments([0, 2]) == "0, 2"
    assert list_segments(range(9)) == "0, 1, 2, 3, 4, 5, 6, 7 and 1 more"


def test_an_impossible_path_names_its_segments(robot: Robot, square: list[pin.SE3]) -> None:
    poses = square[:2]
    far = pin.SE3(poses[0].rotation, poses[0].translation + np.array([0.0, 0.0, 2.0]))
    result = track_path(robot, [*poses, far], speed=1.0)
    assert not result.success
    assert 1 in result.failed_segments
    assert result.time_limited > 0.5
    assert re.search(r"leaves it on segment 1, held back by .*(pose|velocity|acceleration)", result.message)
    assert any("velocity" in names for names in result.limiting)
    assert np.isfinite(result.q).all()


def test_a_first_pose_out_of_reach_is_said(robot: Robot, square: list[pin.SE3]) -> None:
    poses = square[:2]
    far = pin.SE3(poses[0].rotation, np.array([2.0, 0.0, 0.5]))
    result = track_path(robot, [far, poses[0]], speed=1.0)
    assert "no configuration within the limits reaches the first pose" in result.message
    assert result.status[0] != "OK"


def test_without_closed_form_branches_come_from_many_seeds(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    from jacokin.errors import StructureError

    solver = IKSolver(robot)
    pose = robot.forward_kinematics(robot.home)
    exact = [np.array(q) for q in solver.solve_all(pose).q_within_limits]

    def refuse() -> None:
        raise StructureError("no closed form")

    monkeypatch.setattr(solver, "closed_form", refuse)
    found = start_branches(solver, pose, robot.home)
    assert np.abs(found[0] - robot.home).max() < 1e-5
    assert len(found) > len(exact) / 2
    for q in found:
        turned = [np.abs((q - other + np.pi) % (2 * np.pi) - np.pi).max() for other in exact]
        assert min(turned) < 1e-3
        assert robot.within_limits(q)


def test_progress_is_reported(robot: Robot, square: list[pin.SE3]) -> None:
    seen: list[tuple[int, int]] = []
    result = track_path(robot, square[:2], progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (len(result), len(result))


@pytest.mark.slow
def test_the_plot_shows_joints_and_error(result: Trajectory, tmp_path: Path) -> None:
    file = tmp_path / "path.png"
    plot_path(result, file)
    assert file.read_bytes().startswith(b"\x89PNG")
    assert file.stat().st_size > 20_000
    with pytest.raises(InvalidInputError, match="cannot be written"):
        plot_path(result, tmp_path / "missing" / "path.png")
    with pytest.raises(InvalidInputError, match=r"must end in \.png or \.svg or \.pdf"):
        plot_path(result, tmp_path / "path.nonsense")
    with pytest.raises(InvalidInputError, match="file name"):
        plot_path(result, None)  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InvalidInputError, match="must be a Trajectory"):
        plot_path(None, file)  # type: ignore[arg-type]  # wrong on purpose


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ({"waypoints": []}, "at least two"),
        ({"waypoints": [np.eye(4)]}, "at least two"),
        ({"waypoints": [np.eye(4), np.full((4, 4), np.nan)]}, r"waypoints\[1\]"),
        ({"waypoints": [np.eye(4), np.eye(3)]}, r"waypoints\[1\]"),
        ({"waypoints": 3.0}, "waypoints must be a sequence"),
        ({"waypoints": [np.eye(4), FreeAxis(POSE, axis=(1.0, 0.0, 0.0))]}, "track_path follows full poses"),
        ({"waypoints": [np.eye(4), np.eye(4)]}, "same pose"),
        ({"dt": 0.0}, "dt must be"),
        ({"speed": 0.0}, "speed must be"),
        ({"speed": [0.1, 0.1]}, "speed must have shape"),
        ({"speed": 1e-12}, "more than 10000000 ticks"),
        ({"speed": 1e-320}, "more than 10000000 ticks"),
        ({"dt": 1e300}, "less than one control step of 1e\\+300 s"),
        ({"speed": "0.05"}, "speed must be one number or 1"),
        ({"speed": True}, "speed must be one number or 1"),
        ({"speed": np.datetime64("2026-01-01")}, "speed must be one number or 1"),
        ({"speed": np.ma.masked_array([0.05], mask=[True])}, "speed must be one number or 1"),
        ({"angular_speed": "fast"}, "angular_speed must be one number or 1"),
        ({"velocity_limit": "0.5"}, "velocity_limit must be one number or 6"),
        ({"velocity_limit": [True] * 6}, "velocity_limit must be one number or 6"),
        ({"acceleration_limit": np.timedelta64(1, "s")}, "acceleration_limit must be one number or 6"),
        ({"start": [1e17] * 6}, "start: joint_1 = 1e\\+17 rad is too far"),
        ({"start": [4.8, 2.9, 1.0, 4.2, 1.4, 1.3], "seed": [4.8, 2.9, 1.0, 4.2, 1.4, 1.3]}, "at most one of seed and"),
        ({"angular_speed": -1.0}, "angular_speed must be"),
        ({"velocity_limit": [1.0] * 7}, "velocity_limit"),
        ({"velocity_limit": -1.0}, "velocity_limit"),
        ({"frame": "link_base"}, "fixed to the base"),
        ({"seed": [np.nan] * 6}, "seed"),
    ],
)
def test_wrong_arguments_are_refused(
    robot: Robot, square: list[pin.SE3], arguments: dict[str, Any], match: str
) -> None:
    given: dict[str, Any] = {"waypoints": square[:2], **arguments}
    waypoints = given.pop("waypoints")
    with pytest.raises(InvalidInputError, match=match):
        track_path(robot, waypoints, **given)


def test_unknown_names_are_refused(robot: Robot, square: list[pin.SE3]) -> None:
    with pytest.raises(UnknownNameError):
        track_path(robot, square[:2], frame="tcp")
    with pytest.raises(UnknownNameError):
        track_path(robot, square[:2], qp_solver="simplex")


def test_wrong_types_are_refused(robot: Robot, square: list[pin.SE3]) -> None:
    with pytest.raises(InvalidInputError, match="robot must be"):
        track_path("j2n6s300", square)  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InvalidInputError, match="progress must be"):
        track_path(robot, square, progress=3)  # type: ignore[arg-type]  # wrong on purpose


@pytest.mark.parametrize("acceleration", [5.0, 2.0, 1.0])
def test_a_path_is_followed_from_rest_to_rest_within_acceleration(robot: Robot, acceleration: float) -> None:
    """The corners of the documentation's example: a jump of the speed at each would throw the tool off the path."""
    start = robot.forward_kinematics(robot.home)
    ways = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.1], [0.05, 0.0, 0.1]])
    corners = [pin.SE3(start.rotation, start.translation + way) for way in ways]
    result = track_path(robot, corners, speed=[0.05, 0.1], acceleration_limit=acceleration)
    assert result.success
    assert len(result.branches) == 1
    assert result.position_error.max() < 2e-5
    assert (np.abs(result.a) <= acceleration + 1e-7).all()
    assert (np.abs(result.v) <= robot.velocity_limit + 1e-9).all()
    # At rest at the ends and at the corner, up to one tick of acceleration.
    corner = int(np.flatnonzero(result.segment == 0)[-1])
    for row in (1, corner, corner + 1, len(result) - 1):
        assert np.abs(result.v[row]).max() <= acceleration * 0.01 + 1e-9
    # On the lines, and at the waypoints at their ends.
    for q in result.q[:: max(1, len(result) // 50)]:
        offset = robot.forward_kinematics(q).translation - start.translation
        assert min(np.hypot(offset[0], offset[1]), np.hypot(offset[1], offset[2] - 0.1)) < 2e-5
    reached = robot.forward_kinematics(result.q[-1])
    assert np.abs(reached.translation - corners[-1].translation).max() < 1e-5


@pytest.mark.parametrize(("offset", "outcome"), [([0.1, 0.0, 0.0], "OK"), ([0.0, 0.0, 0.3], "OFF_PATH")])
def test_limits_hold_between_ticks_that_take_all_of_them(offset: list[float], outcome: str) -> None:
    lite = jacokin.load_robot("gen3_lite")
    start = lite.forward_kinematics(lite.home)
    corners = [start, pin.SE3(start.rotation, start.translation + np.array(offset))]
    result = track_path(lite, corners, start=lite.home, speed=0.3, acceleration_limit=1.0)
    assert result.outcome == outcome
    fastest, hardest = most_between(result.rows)
    assert (fastest <= lite.velocity_limit * (1.0 + 1e-9)).all()
    assert hardest.max() <= 1.0 + 1e-9
    assert np.array_equal(result.q[0], lite.home)
    assert not result.v[[0, -1]].any()
    for row in range(0, len(result), 10):
        tool = lite.forward_kinematics(result.q[row]).translation
        nearest = np.clip((tool - start.translation) @ offset / np.dot(offset, offset), 0.0, 1.0) * np.array(offset)
        off_line = np.linalg.norm(tool - start.translation - nearest)
        assert off_line <= result.position_error[row] + 1e-12
    if outcome == "OK":
        assert result.position_error.max() <= 1e-4
        assert result.orientation_error.max() <= 1e-3


def test_a_speed_that_no_joint_can_follow_is_not_reached(robot: Robot) -> None:
    """The line is asked for in a tenth of a second; from rest to rest it takes what the joints need."""
    start = robot.forward_kinematics(robot.home)
    corners = [start, pin.SE3(start.rotation, start.translation + np.array([0.0, 0.0, 0.2]))]
    result = track_path(robot, corners, speed=2.0, start=robot.home, acceleration_limit=2.0)
    assert result.success
    assert (np.abs(result.a) <= 2.0 + 1e-7).all()
    assert 0.7 < result.t[-1] < 3.0
    slower = track_path(robot, corners, speed=0.05, start=robot.home, acceleration_limit=2.0)
    assert slower.t[-1] > 4.0


@pytest.mark.parametrize("wanted", [1, pytest.param(12, marks=pytest.mark.slow)])  # 12: all are looked at
def test_a_start_is_never_left(robot: Robot, wanted: int) -> None:
    """The path that made `seed` begin on another branch: from `start` it is refused by its result instead."""
    rng = np.random.default_rng(5)
    jumped = 0
    for _ in range(12):
        q = robot.sample(rng)
        q[2] = robot.lower[2] + 0.05
        first = robot.forward_kinematics(q)
        beyond = robot.forward_kinematics(np.array([*q[:2], 1.0, *q[3:]])).translation
        away = first.translation - 0.08 * (beyond - first.translation) / np.linalg.norm(beyond - first.translation)
        path = [first, pin.SE3(first.rotation, away)]
        near, fixed = track_path(robot, path, seed=q), track_path(robot, path, start=q)
        assert np.array_equal(fixed.q[0], q)
        assert fixed.start_distance == 0.0
        assert len(fixed.branches) == 1
        assert near.start_distance == pytest.approx(np.abs(near.q[0] - q).max())
        if near.start_distance > 0.1 and near.success:
            jumped += 1
            assert not fixed.success
            assert "the given start leaves the path on segment 0" in str(fixed)
            assert f"it starts {near.start_distance:.3g} rad (joint_" in str(near)
            assert "from the seed: bring the arm to q[0] first" in str(near)
        if jumped == wanted:
            return
    assert jumped >= 2


def test_a_start_away_from_the_first_pose_is_said(robot: Robot, square: list[pin.SE3]) -> None:
    q = robot.home + np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0])
    result = track_path(robot, square[:2], start=q)
    assert not result.success
    assert "the given start is not at the first pose" in result.message
    assert np.array_equal(result.q[0], q)


def test_the_qp_solver_reaches_the_search_for_starts(robot: Robot, square: list[pin.SE3]) -> None:
    seen: list[str] = []

    class Recording(IKSolver):
        def __init__(self, *arguments: Any, **options: Any) -> None:
            seen.append(options["qp_solver"])
            super().__init__(*arguments, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("jacokin.motion.track.IKSolver", Recording)
        track_path(robot, square[:2], qp_solver="osqp")
    assert seen == ["osqp"]
