"""Cartesian paths: straight lines at the speed asked for, the right start branch, files, and wrong input."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from jacokin import IKSolver, Robot
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.ik import PathResult, plot_path, track_path
from jacokin.ik.paths.lines import sample
from jacokin.ik.paths.track import start_branches


def test_lines_are_straight_and_timed(robot: Robot) -> None:
    start = robot.forward_kinematics(robot.home)
    end = pin.SE3(start.rotation @ pin.exp3(np.array([0.0, 0.3, 0.0])), start.translation + np.array([0.1, 0.0, 0.0]))
    path = sample([start, end], 0.05, 1.0, 0.01)
    assert len(path.poses) == 201  # 0.1 m at 0.05 m/s in steps of 0.01 s, and the start
    for tick, pose in enumerate(path.poses):
        assert np.allclose(pose.translation, start.translation + np.array([0.1 * tick / 200, 0.0, 0.0]), atol=1e-15)
        turned = pin.log3(start.rotation.T @ pose.rotation)
        assert np.allclose(turned, [0.0, 0.3 * tick / 200, 0.0], atol=1e-12)
    slow_turn = sample([start, end], 10.0, 0.1, 0.01)
    assert len(slow_turn.poses) == 301  # 0.3 rad at 0.1 rad/s takes longer


def test_a_square_is_followed(robot: Robot, square: list[pin.SE3], result: PathResult) -> None:
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
    assert np.allclose(np.diff(result.q, axis=0) / 0.01, result.v[1:], atol=1e-9)
    assert (np.abs(result.v) <= robot.velocity_limit + 1e-9).all()
    assert (result.limit_margin >= 0.0).all()
    assert np.isinf(result.limit_margin[:, robot.unlimited]).all()
    assert "on the path throughout" in str(result)


def test_a_branch_that_fails_gives_way_to_one_that_does_not(robot: Robot) -> None:
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
            legal = IKSolver(robot).solve_all(start).legal
            assert len(result.branches) == len(legal)
            assert all(report.failed_segments == (0,) for report in result.branches)
        if found >= 2:
            return
    pytest.fail("no path of the sample needed another branch")


def test_an_impossible_path_names_its_segments(robot: Robot, square: list[pin.SE3]) -> None:
    poses = square[:2]
    far = pin.SE3(poses[0].rotation, poses[0].translation + np.array([0.0, 0.0, 2.0]))
    result = track_path(robot, [*poses, far], speed=1.0)
    assert not result.success
    assert 1 in result.failed_segments
    assert result.time_limited > 0.5
    assert "leaves it on segment" in result.message
    assert any("velocity" in names for names in result.limiting)
    assert np.isfinite(result.q).all()


def test_a_first_pose_out_of_reach_is_said(robot: Robot, square: list[pin.SE3]) -> None:
    poses = square[:2]
    far = pin.SE3(poses[0].rotation, np.array([2.0, 0.0, 0.5]))
    result = track_path(robot, [far, poses[0]], speed=1.0)
    assert "no legal configuration reaches the first pose" in result.message
    assert result.status[0] != "OK"


def test_without_closed_form_branches_come_from_many_seeds(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    from jacokin.errors import StructureError

    solver = IKSolver(robot)
    pose = robot.forward_kinematics(robot.home)
    exact = [np.array(q) for q in solver.solve_all(pose).legal]

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


def test_the_plot_shows_joints_and_error(result: PathResult, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    file = tmp_path / "path.png"
    plot_path(result, file)
    assert file.read_bytes().startswith(b"\x89PNG")
    assert file.stat().st_size > 20_000
    with pytest.raises(InvalidInputError, match="cannot write the plot"):
        plot_path(result, tmp_path / "missing" / "path.png")
    with pytest.raises(InvalidInputError, match="cannot write the plot"):
        plot_path(result, tmp_path / "path.nonsense")


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ({"waypoints": []}, "at least two"),
        ({"waypoints": [np.eye(4)]}, "at least two"),
        ({"waypoints": [np.eye(4), np.full((4, 4), np.nan)]}, r"waypoints\[1\]"),
        ({"waypoints": [np.eye(4), np.eye(3)]}, r"waypoints\[1\]"),
        ({"waypoints": 3.0}, "waypoints must be a sequence"),
        ({"waypoints": [np.eye(4), np.eye(4)]}, "same pose"),
        ({"dt": 0.0}, "dt must be"),
        ({"speed": 0.0}, "speed must be"),
        ({"speed": [0.1, 0.1]}, "speed must have shape"),
        ({"speed": 1e-12}, "more than 10000000 ticks"),
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
