"""The tracker: paths followed, limits held exactly, statuses, and wrong arguments."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import qpsolvers
from numpy.typing import ArrayLike, NDArray

import jacokin
from jacokin import IKSolver, Robot, Tracker
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.ik import Scene, Sphere, qp_backend
from jacokin.ik.qp_backend import Backend, QPFailed
from jacokin.kernels.library import Call
from jacokin.model import poses
from jacokin.motion import JointTarget, PositionTarget, TrackerStatus
from tests.threads import run_in_threads

DT = 0.01  # [s]


def line(robot: Robot, ticks: int = 200, length: float = 0.1) -> list[pin.SE3]:
    """Straight up from home: 10 cm at 5 cm/s."""
    start = robot.forward_kinematics(robot.home)
    ways = length * np.arange(1, ticks + 1) / ticks
    return [pin.SE3(start.rotation, start.translation + np.array([0.0, 0.0, way])) for way in ways]


def distance_to_line(robot: Robot, q: NDArray[np.float64]) -> float:
    """How far off the straight line a configuration is, measured by Pinocchio [m]."""
    offset = robot.forward_kinematics(q).translation - robot.forward_kinematics(robot.home).translation
    return float(np.hypot(offset[0], offset[1]))


def test_a_straight_line_is_followed(robot: Robot) -> None:
    tracker = Tracker(robot, dt=DT, acceleration_limit=np.inf)
    for pose in line(robot):
        step = tracker.step(pose)
        assert step.status is TrackerStatus.OK
        assert np.linalg.norm(robot.forward_kinematics(step.q).translation - pose.translation) < 1e-5
        assert distance_to_line(robot, step.q) < 1e-5
        assert step.limiting == ()


def test_a_tick_is_one_call_of_the_kernels(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """Within limits, near obstacles that stand as well."""
    calls, run = 0, Call.__call__

    def counted(self: Call[Any]) -> int:
        nonlocal calls
        calls += 1
        return run(self)

    monkeypatch.setattr(Call, "__call__", counted)
    for scene in (None, Scene([Sphere("ball", 0.05, [0.6, 0.0, 0.9])])):
        tracker, poses = Tracker(robot, dt=DT, scene=scene), line(robot)
        calls = 0
        for number, pose in enumerate(poses, 1):
            tracker.step(pose)
            assert calls == number


def test_a_circle_is_followed(robot: Robot) -> None:
    start = robot.forward_kinematics(robot.home)
    tracker = Tracker(robot, dt=DT, acceleration_limit=np.inf)
    ticks = round(2 * np.pi * 0.05 / 0.05 / DT)  # once round a radius of 5 cm at 5 cm/s
    for angle in 2 * np.pi * np.arange(1, ticks + 1) / ticks:
        offset = 0.05 * np.array([0.0, np.sin(angle), 1.0 - np.cos(angle)])
        step = tracker.step(pin.SE3(start.rotation, start.translation + offset))
        reached = robot.forward_kinematics(step.q).translation - start.translation
        centre = np.array([0.0, 0.0, 0.05])
        assert abs(np.linalg.norm(reached - centre) - 0.05) < 1e-5
        assert step.status is TrackerStatus.OK


@pytest.mark.parametrize("ticks", [1_500, pytest.param(5_000, marks=pytest.mark.slow)])
def test_limits_hold_exactly_while_targets_jump(robot: Robot, rng: np.random.Generator, ticks: int) -> None:
    tracker = Tracker(robot, dt=DT, acceleration_limit=np.inf)
    before = tracker.q
    at_speed = 0
    for tick in range(ticks):
        if tick % 20 == 0:
            reachable = rng.random() < 0.7
            target = (
                robot.forward_kinematics(robot.sample(rng))
                if reachable
                else pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
            )
        step = tracker.step(target)
        assert robot.within_limits(step.q)
        speed = np.abs(step.q - before) / DT
        assert (speed <= robot.velocity_limit + 1e-9).all()
        assert np.allclose(step.v, (step.q - before) / DT, atol=1e-12)
        at_speed += bool((speed > 0.999 * robot.velocity_limit).any())
        before = step.q
    assert at_speed > ticks / 2


@pytest.mark.parametrize("solver", ["osqp", "quadprog", "proxqp"])
def test_every_qp_solver_gives_the_path_of_daqp(robot: Robot, solver: str) -> None:
    if solver not in qpsolvers.available_solvers:
        pytest.skip(f"{solver} is an extra and not installed")
    tracker, daqp = Tracker(robot, dt=DT, qp_solver=solver), Tracker(robot, dt=DT, qp_solver="daqp")
    for pose in line(robot):
        step = tracker.step(pose)
        assert step.qp_solver == solver
        assert np.abs(step.q - daqp.step(pose).q).max() < 1e-4


@pytest.mark.one_quick
@pytest.mark.parametrize(
    "position", [[2.0, 0.3, 0.5], [0.0, 0.0, 3.0], [-1.5, -1.0, 0.1]], ids=["ahead", "above", "behind"]
)
def test_a_target_out_of_reach_gives_the_closest_motion_and_no_oscillation(robot: Robot, position: list[float]) -> None:
    tracker = Tracker(robot, dt=DT, acceleration_limit=np.inf)
    steps = [tracker.step(np.array(position)) for _ in range(900)]
    errors = np.array([step.position_error for step in steps])
    assert (np.diff(errors) <= 1e-9).all()
    assert steps[-1].status is TrackerStatus.HELD
    assert not steps[-1].v.any()
    # The arm points at the target: nothing nearer can be reached from where joints 2 and 3 are.
    stretch = robot.forward_kinematics(steps[-1].q).translation
    shoulder = np.array([0.0, 0.0, 0.2755])
    along = (np.array(position) - shoulder) / np.linalg.norm(np.array(position) - shoulder)
    assert (stretch - shoulder) @ along > 0.95 * np.linalg.norm(stretch - shoulder)


@pytest.mark.parametrize("acceleration", [None, np.inf], ids=["default", "none"])
def test_a_target_that_runs_away_is_lost_and_found_again(robot: Robot, acceleration: float | None) -> None:
    tracker = Tracker(robot, dt=DT, acceleration_limit=acceleration)
    start = robot.forward_kinematics(robot.home)
    statuses = set()
    for tick in range(120):
        step = tracker.step(pin.SE3(start.rotation, start.translation + np.array([0.0, 0.0, 0.02 * tick])))
        statuses.add(step.status)
    assert step.status is TrackerStatus.LOST
    assert TrackerStatus.LIMITED in statuses
    assert any("velocity" in name for name in step.limiting)
    for _ in range(600):
        step = tracker.step(start)
    assert step.status is TrackerStatus.OK


def half_turn(robot: Robot, axis: list[float]) -> pin.SE3:
    """The tool at home turned about one of its axes to the opposite orientation, where the error has no derivative."""
    return robot.forward_kinematics(robot.home) * pin.SE3(pin.exp3(np.pi * np.array(axis)), np.zeros(3))


def test_a_half_turn_is_reached(robot: Robot) -> None:
    target = half_turn(robot, [0.0, 0.0, 1.0])
    tracker = Tracker(robot, dt=DT, acceleration_limit=np.inf)
    for _ in range(1_000):
        step = tracker.step(target)
    assert step.status is TrackerStatus.OK
    assert step.orientation_error < 1e-9


@pytest.mark.parametrize("axis", [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], ids=["x", "y"])
def test_a_half_turn_out_of_reach_ends_as_near_as_the_arm_gets(robot: Robot, axis: list[float]) -> None:
    target = half_turn(robot, axis)
    assert not IKSolver(robot).solve_all(target).within_limits.any()
    tracker = Tracker(robot, dt=DT, acceleration_limit=np.inf)
    steps = [tracker.step(target) for _ in range(1_500)]
    errors = [np.hypot(step.position_error, 0.1 * step.orientation_error) for step in steps]  # 1 rad counts as 0.1 m
    assert (np.diff(errors) <= 1e-9).all()
    assert steps[-1].status is TrackerStatus.HELD
    # Both end in the same local minimum; rounding decides which way round, and so on which side the arm rests.
    assert steps[-1].orientation_error == pytest.approx(1.026, abs=4e-3)
    assert steps[-1].position_error == pytest.approx(0.038, abs=1.2e-3)


@pytest.mark.parametrize("reference", ["local_world_aligned", "local", "world"])
def test_a_twist_moves_the_tool_at_that_velocity(robot: Robot, reference: str) -> None:
    twist = np.array([0.01, -0.02, 0.03, 0.05, 0.1, -0.05])
    tracker = Tracker(robot, dt=1e-3, acceleration_limit=np.inf)
    middle = None
    for tick in range(101):
        step = tracker.step(twist=twist, reference=reference)
        assert step.status is TrackerStatus.OK
        if tick == 50:
            middle = step.q
            velocity = robot.jacobian(step.q, reference=reference) @ step.v
    assert middle is not None
    assert np.abs(velocity - twist).max() < 1e-4


def test_twists_do_not_drift(robot: Robot) -> None:
    tracker = Tracker(robot, dt=DT, acceleration_limit=np.inf)
    start = robot.forward_kinematics(robot.home)
    for _ in range(200):
        step = tracker.step(twist=[0.0, 0.0, 0.05, 0.0, 0.0, 0.1])
    moved = robot.forward_kinematics(step.q)
    assert np.abs(moved.translation - start.translation - [0.0, 0.0, 0.1]).max() < 1e-5
    assert np.abs(moved.rotation - pin.exp3(np.array([0.0, 0.0, 0.2])) @ start.rotation).max() < 1e-5


def test_a_tool_moves_instead_of_its_frame(robot: Robot) -> None:
    T_frame_tool = pin.SE3(pin.exp3(np.array([0.1, 0.2, 0.3])), np.array([0.0, 0.02, 0.1]))
    target = robot.forward_kinematics(robot.home) * T_frame_tool
    target.translation = target.translation + np.array([0.0, 0.0, 0.02])
    tracker = Tracker(robot, tool=T_frame_tool)
    for _ in range(100):
        step = tracker.step(target)
    reached = robot.forward_kinematics(step.q) * T_frame_tool
    assert step.status is TrackerStatus.OK
    assert np.linalg.norm(reached.translation - target.translation) < 1e-6


def test_steps_are_frozen_and_statuses_say_what_to_do(robot: Robot) -> None:
    tracker = Tracker(robot)
    step = tracker.step(robot.forward_kinematics(robot.home))
    with pytest.raises(AttributeError):
        step.status = TrackerStatus.LOST  # type: ignore[misc]  # wrong on purpose
    with pytest.raises(ValueError, match="read-only"):
        step.q[0] = 0.0
    assert all(len(status.value) > 30 for status in TrackerStatus)
    assert "OK" in str(step)


def test_the_errors_reported_are_what_forward_kinematics_says(robot: Robot, rng: np.random.Generator) -> None:
    tracker = Tracker(robot)
    target = robot.forward_kinematics(robot.sample(rng))
    for _ in range(50):
        step = tracker.step(target)
        here = robot.forward_kinematics(step.q)
        assert step.position_error == pytest.approx(np.linalg.norm(here.translation - target.translation), abs=1e-12)
        angle = np.linalg.norm(pin.log3(here.rotation.T @ target.rotation))
        assert step.orientation_error == pytest.approx(angle, abs=1e-9)


def test_reset_puts_the_arm_there_and_noise_past_a_limit_is_removed(robot: Robot) -> None:
    tracker = Tracker(robot)
    q = robot.home.copy()
    q[1] = robot.upper[1] + 9e-7
    tracker.reset(q)
    assert tracker.q[1] == robot.upper[1]
    assert not tracker.v.any()
    assert robot.within_limits(tracker.step(robot.forward_kinematics(robot.home)).q)


def test_copies_go_on_from_where_the_tracker_is(robot: Robot) -> None:
    tracker = Tracker(robot, clearance=0.005)
    for pose in line(robot)[:5]:
        tracker.step(pose)
    for other in (pickle.loads(pickle.dumps(tracker)), copy.deepcopy(tracker)):
        for array in (other.q, other.v, other.velocity_limit):
            assert not array.flags.writeable
        here = copy.deepcopy(tracker)
        for pose in line(robot)[5:15]:
            assert np.array_equal(other.step(pose).q, here.step(pose).q)


def at_upper_limit(robot: Robot) -> NDArray[np.float64]:
    """Joint 2 is at its limit, so that the QP has to keep it."""
    q = robot.home.copy()
    q[1] = robot.upper[1]
    return q


def test_a_qp_that_cannot_be_solved_holds_the_arm_and_says_so(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    tracker = Tracker(robot, q=at_upper_limit(robot), acceleration_limit=np.inf)
    before, pose = tracker.q, robot.forward_kinematics(robot.home)

    def fail(*_: object) -> None:
        raise QPFailed

    with monkeypatch.context() as patch:
        patch.setattr(Backend, "minimize", fail)
        step = tracker.step(JointTarget(before + 1.0))
    assert step.status is TrackerStatus.HELD
    assert "no QP solver" in step.message
    assert np.array_equal(step.q, before)
    assert not step.v.any()
    for _ in range(600):
        step = tracker.step(pose)
    assert step.status is TrackerStatus.OK


def test_a_failing_solver_is_replaced_and_the_step_says_by_which(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    run = qp_backend._solve

    def fail_proxqp(problem: qpsolvers.Problem, solver: str) -> Any:
        if solver == "proxqp":
            raise ValueError("matrix G is not positive definite")
        return run(problem, solver)

    monkeypatch.setattr(qp_backend, "_solve", fail_proxqp)
    tracker = Tracker(robot, q=at_upper_limit(robot), qp_solver="proxqp")
    step = tracker.step(JointTarget(tracker.q + 1.0))
    assert step.status is TrackerStatus.LIMITED
    assert step.qp_solver == "proxqp, then daqp"


def test_failed_calls_change_nothing(robot: Robot) -> None:
    tracker, twin = Tracker(robot), Tracker(robot)
    pose = line(robot)[100]
    tracker.step(pose)
    twin.step(pose)
    for call in (
        lambda: tracker.reset(robot.home, v=np.ones(6)),
        lambda: tracker.reset([np.nan] * 6),
        lambda: tracker.step(),
        lambda: tracker.step(pose, twist=np.zeros(6)),
        lambda: tracker.step(twist=np.zeros(5)),
        lambda: tracker.step(twist=np.full(6, np.nan)),
        lambda: tracker.step(twist=np.zeros(6), reference="tool"),
        lambda: tracker.step(np.full((4, 4), np.nan)),
        lambda: tracker.step(pin.SE3(np.eye(3) * 2.0, np.zeros(3))),
        lambda: tracker.step(pin.SE3(np.diag([1.0, 1.0, -1.0]), np.zeros(3))),
        lambda: tracker.step(pin.SE3(np.eye(3), np.array([np.inf, 0.0, 0.0]))),
        lambda: tracker.step([1.0, 2.0]),
        lambda: tracker.step("home"),
    ):
        with pytest.raises(InvalidInputError):
            call()
    assert np.array_equal(tracker.step(pose).q, twin.step(pose).q)


@pytest.mark.parametrize(
    ("entry", "value", "message"),
    [
        ((0, 3), np.nan, "target must be finite"),
        ((3, 3), np.nan, "target must be finite"),
        ((3, 0), 0.1, "target: the last row must be 0 0 0 1"),
        ((3, 3), 2.0, "target: the last row must be 0 0 0 1"),
        ((0, 0), 1.1, "target is not a rotation"),
    ],
)
def test_an_array_that_is_no_pose_is_refused_by_name(
    robot: Robot, entry: tuple[int, int], value: float, message: str
) -> None:
    matrix = np.eye(4)
    matrix[entry] = value
    for given in (matrix, matrix.tolist(), np.asfortranarray(matrix)):
        with pytest.raises(InvalidInputError, match=f"^{message}"):
            Tracker(robot).step(given)


def test_a_pose_that_was_refused_is_forgotten(robot: Robot) -> None:
    tracker, twin = Tracker(robot), Tracker(robot)
    bad, place = np.diag([1.0, 1.0, 2.0, 1.0]), [PositionTarget([0.3, 0.3, 0.5])]
    for budget in (None, 1e-9):  # in no time, too
        with pytest.raises(InvalidInputError, match="not a rotation"):
            tracker.step(bad, budget=budget)
    for _ in range(3):
        assert np.array_equal(tracker.step(place).q, twin.step(place).q)


def test_a_pose_that_is_nearly_rigid_is_made_so(robot: Robot) -> None:
    tracker, twin = Tracker(robot), Tracker(robot)
    for pose in line(robot, 5):
        matrix = pose.homogeneous.astype(np.float32).astype(np.float64)
        step, other = tracker.step(matrix), twin.step(poses.checked_matrix("pose", matrix.copy()))
        assert np.array_equal(step.q, other.q)
        assert step.orientation_error == other.orientation_error


def test_what_is_asked_between_ticks_changes_nothing(robot: Robot) -> None:
    """A tick looks back at the one before, whatever the kernels were given since."""
    tracker, twin = Tracker(robot), Tracker(robot)
    several = [PositionTarget([0.3, 0.3, 0.5]), JointTarget(robot.home), PositionTarget([0.3, 0.2, 0.5])]
    for pose in line(robot, 20):
        assert np.array_equal(tracker.step(pose).q, twin.step(pose).q)
        tracker.measure(several)
        with pytest.raises(InvalidInputError, match="finite"):
            tracker.step(np.full((4, 4), np.nan))


def test_poses_are_followed_alike_however_they_are_given(robot: Robot) -> None:
    poses = line(robot)[:20]
    ways: list[Callable[[pin.SE3], ArrayLike]] = [
        lambda pose: np.asarray(pose.homogeneous),
        lambda pose: np.asfortranarray(pose.homogeneous),
        lambda pose: pose.homogeneous.tolist(),
        lambda pose: pose.homogeneous.astype(np.longdouble),
    ]
    expected = Tracker(robot)
    for pose in poses:
        expected.step(pose)
    for way in ways:
        tracker = Tracker(robot)
        for pose in poses:
            tracker.step(way(pose))
        np.testing.assert_allclose(tracker.q, expected.q, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ({"dt": 0.0}, "dt must be a positive number"),
        ({"dt": -0.01}, "dt must be a positive number"),
        ({"dt": 5e-324}, "dt must be at least 1e-06 s, got 4.94066e-324 s"),
        ({"dt": 9e-7}, "dt must be at least 1e-06 s"),
        ({"dt": np.nan}, "dt must be a positive number"),
        ({"dt": "fast"}, "dt must be a positive number"),
        ({"velocity_limit": [0.5] * 5}, r"velocity_limit must have shape \(6,\)"),
        ({"velocity_limit": [0.5, 0.5, -0.1, 0.5, 0.5, 0.5]}, "velocity_limit must be positive"),
        ({"velocity_limit": np.inf}, "velocity_limit must be finite"),
        ({"acceleration_limit": 0.0}, "acceleration_limit must be positive"),
        ({"position_tolerance": 0.0}, "position_tolerance"),
        ({"posture": [0.0] * 5}, "posture"),
        ({"objectives": ["manipulability"]}, "objectives"),
        ({"objectives": 3}, "objectives must be a list"),
        ({"frame": "link_base"}, "fixed to the base"),
        ({"q": [1e17, 2.9, 1.0, 4.2, 1.4, 1.3]}, r"q: joint_1 = 1e\+17 rad is too far from zero"),
        ({"q": np.ma.masked_array([4.8, 2.9, 1.0, 4.2, 1.4, 1.3], mask=[False] * 6)}, "q must be 6 numbers"),
        ({"dt": True}, "dt must be a positive number"),
        ({"dt": np.timedelta64(1, "s")}, "dt must be a positive number"),
        ({"velocity_limit": "0.5"}, "velocity_limit must be one number or 6"),
        ({"velocity_limit": True}, "velocity_limit must be one number or 6"),
        ({"acceleration_limit": np.datetime64("2026-01-01")}, "acceleration_limit must be one number or 6"),
        ({"tool": np.zeros((4, 4))}, "tool"),
    ],
)
def test_wrong_arguments_are_refused_before_the_first_tick(robot: Robot, arguments: dict[str, Any], match: str) -> None:
    with pytest.raises(InvalidInputError, match=match):
        Tracker(robot, **arguments)


def test_unknown_names_are_listed(robot: Robot) -> None:
    with pytest.raises(UnknownNameError, match="end_effector"):
        Tracker(robot, "end_efector")
    with pytest.raises(UnknownNameError, match="daqp"):
        Tracker(robot, qp_solver="simplex")
    with pytest.raises(UnknownNameError, match="local_world_aligned"):
        Tracker(robot).step(twist=np.zeros(6), reference="tool")
    with pytest.raises(InvalidInputError, match="load_robot"):
        Tracker("j2n6s300")  # type: ignore[arg-type]  # wrong on purpose


def test_a_description_without_velocity_limits_asks_for_them() -> None:
    from jacokin.model.descriptions import bundled

    path = Path(bundled.urdf_folder()) / "j2n6s300.xml"
    robot = jacokin.load_robot(path)
    with pytest.raises(InvalidInputError, match="no velocity limits for joint_1"):
        Tracker(robot)
    tracker = Tracker(robot, velocity_limit=0.6)
    step = tracker.step(robot.forward_kinematics(robot.home))
    assert step.status is TrackerStatus.OK


@pytest.mark.parametrize("name", ["j2n6s200", "j2s6s300", "m1n6s300"])
def test_other_members_of_the_family_follow_too(bundled: Any, name: str) -> None:
    robot = bundled(name)
    start = robot.forward_kinematics(robot.home)
    tracker = Tracker(robot, acceleration_limit=np.inf)
    for way in np.linspace(0.0, 0.03, 100):
        step = tracker.step(pin.SE3(start.rotation, start.translation - np.array([0.0, 0.0, way])))
        assert step.status is TrackerStatus.OK
        assert robot.within_limits(step.q)


def test_threads_may_each_have_a_tracker_of_one_robot(robot: Robot, rng: np.random.Generator) -> None:
    targets = [robot.forward_kinematics(q) for q in robot.sample(rng, 4)]
    scene = Scene([Sphere("ball", 0.05, (0.4, 0.1, 0.6))])

    def follow(number: int) -> NDArray[np.float64]:
        tracker = Tracker(robot, dt=DT, scene=scene)
        return np.array([tracker.step(targets[number]).q for _ in range(40)])

    together: dict[int, NDArray[np.float64]] = {}
    run_in_threads(lambda number: together.update({number: follow(number)}), len(targets))
    for number, rows in together.items():
        np.testing.assert_array_equal(rows, follow(number))
    assert len(together) == len(targets)


def test_a_tracker_shows_what_it_moves(robot: Robot) -> None:
    assert repr(Tracker(robot, dt=0.02)) == "Tracker('j2n6s300', frame='end_effector', dt=0.02)"
