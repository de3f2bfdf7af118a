"""Whatever a tracker is asked for, limits hold exactly, and what is refused or interrupted changes nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from jacokin import Robot, Tracker
from jacokin.errors import InvalidInputError
from jacokin.ik import AxisTarget, Clearance, OrientationTarget, PositionTarget, RegionTarget, Sphere

ROUNDING = 1e-9  # [rad/s] positions are subtracted and divided by dt

Command = Callable[[Tracker], Any]

lengths = st.floats(-1e6, 1e6)
vectors = st.tuples(lengths, lengths, lengths).map(np.array)
near_vectors = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)
rotations = st.tuples(*[st.floats(-4.0, 4.0)] * 3).map(lambda v: pin.exp3(np.array(v)))
positions = vectors | near_vectors
twists = st.tuples(*[st.floats(-1e3, 1e3)] * 6).map(np.array)


def to_pose(rotation: NDArray[np.float64], position: NDArray[np.float64]) -> Command:
    return lambda tracker: tracker.step(pin.SE3(rotation, position))


def to_axis(direction: NDArray[np.float64]) -> Command:
    return lambda tracker: tracker.step(AxisTarget(direction))


commands: st.SearchStrategy[Command] = st.one_of(
    st.builds(to_pose, rotations, positions),
    positions.map(lambda p: lambda tracker: tracker.step(p)),
    positions.map(lambda p: lambda tracker: tracker.step(PositionTarget(p, frame="link_4"))),
    rotations.map(lambda r: lambda tracker: tracker.step(OrientationTarget(r))),
    near_vectors.filter(lambda v: np.linalg.norm(v) > 1e-3).map(to_axis),
    near_vectors.map(lambda p: lambda tracker: tracker.step(RegionTarget(p - 0.1, p + 0.1))),
    twists.map(lambda t: lambda tracker: tracker.step(twist=t)),
)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    sequence=st.lists(st.tuples(commands, st.integers(1, 8)), min_size=1, max_size=5),
    dt=st.sampled_from([1e-3, 0.01, 0.1, 1.0]),
    speed=st.floats(1e-3, 10.0),
    acceleration=st.none() | st.floats(0.1, 100.0),
    number=st.integers(0, 2**32 - 1),
)
def test_limits_hold_for_any_sequence_of_commands(
    robot: Robot, sequence: list[tuple[Command, int]], dt: float, speed: float, acceleration: float | None, number: int
) -> None:
    start = robot.sample(np.random.default_rng(number))
    tracker = Tracker(robot, dt=dt, q=start, velocity_limit=speed, acceleration_limit=acceleration)
    for command, ticks in sequence:
        for _ in range(ticks):
            q_before, v_before = tracker.q, tracker.v
            step = command(tracker)
            assert robot.within_limits(step.q)
            assert step.q is tracker.q
            assert np.allclose(step.v, (step.q - q_before) / dt, atol=1e-12)
            assert (np.abs(step.v) <= speed + ROUNDING).all()
            if acceleration is not None:
                assert (np.abs(step.v - v_before) <= acceleration * dt + ROUNDING / dt).all()
            assert np.isfinite([step.position_error, step.orientation_error]).all()


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(command=commands, number=st.integers(0, 2**32 - 1))
def test_what_is_measured_or_refused_changes_nothing(robot: Robot, command: Command, number: int) -> None:
    start = robot.sample(np.random.default_rng(number))
    tracker, twin = Tracker(robot, q=start), Tracker(robot, q=start)
    target = robot.forward_kinematics(robot.home)
    for one in (tracker, twin):
        one.step(target)
    tracker.measure(target)
    for refused in (lambda: tracker.step(np.full(3, np.nan)), lambda: tracker.reset(robot.lower - 1.0)):
        with pytest.raises(InvalidInputError):
            refused()
    assert np.array_equal(command(tracker).q, command(twin).q)


class Interrupting:
    """An objective that is interrupted, like anything that runs during a tick."""

    def __init__(self) -> None:
        self.armed = False

    def velocity(self, robot: Robot, frame: str, q: NDArray[np.float64]) -> NDArray[np.float64]:
        if self.armed:
            raise KeyboardInterrupt
        return np.zeros(robot.dof)


def interrupt_at(function: Callable[..., Any], call: int) -> Callable[..., Any]:
    """The function, interrupted after its n-th call from now on."""
    calls = 0

    def wrapped(*arguments: Any, **options: Any) -> Any:
        nonlocal calls
        result = function(*arguments, **options)
        calls += 1
        if calls == call:
            raise KeyboardInterrupt
        return result

    return wrapped


@pytest.mark.parametrize("acceleration", [None, 2.0])
@pytest.mark.parametrize("call", [1, 2, 3])
@pytest.mark.parametrize("what", ["_try", "_report", "_nearer", "_descend"])
def test_an_interrupted_tick_leaves_the_state_of_before(
    robot: Robot, monkeypatch: pytest.MonkeyPatch, acceleration: float | None, call: int, what: str
) -> None:
    """The tick after the interrupt moves no joint faster than its limit."""
    ball = Clearance(0.01, [Sphere("ball", 0.05, [0.5, 0.0, 0.5])])
    arguments: dict[str, Any] = {"acceleration_limit": acceleration, "collision": ball}
    tracker, twin = Tracker(robot, **arguments), Tracker(robot, **arguments)
    target = robot.forward_kinematics(robot.home + 0.3)
    for _ in range(5):
        tracker.step(target)
        twin.step(target)
    with monkeypatch.context() as patch:
        patch.setattr(tracker, what, interrupt_at(getattr(tracker, what), call))
        try:
            tracker.step(target)
            twin.step(target)  # that call happens less often in a tick
        except KeyboardInterrupt:
            assert np.array_equal(tracker.q, twin.q)
    for _ in range(20):
        before = tracker.q
        step = tracker.step(target)
        assert (np.abs(step.q - before) <= (robot.velocity_limit + ROUNDING) * tracker.dt).all()
        assert np.array_equal(step.q, twin.step(target).q)
        assert np.array_equal(step.v, tracker.v)


def test_an_interrupted_objective_leaves_the_state_of_before(robot: Robot) -> None:
    objective = Interrupting()
    tracker, twin = Tracker(robot, objectives=[objective]), Tracker(robot, objectives=[Interrupting()])
    target = np.array([0.3, -0.2, 0.5])
    objective.armed = True
    with pytest.raises(KeyboardInterrupt):
        tracker.step(target)
    objective.armed = False
    assert np.array_equal(tracker.step(target).q, twin.step(target).q)


@given(scale=st.floats(-100.0, 100.0))
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_starts_outside_the_limits_are_refused_and_noise_is_removed(robot: Robot, scale: float) -> None:
    assume(abs(scale) > 1e-6)
    q = robot.home.copy()
    q[1] = robot.upper[1] + abs(scale)
    tracker = Tracker(robot)
    if abs(scale) <= 0.01:
        tracker.reset(q)
        assert tracker.q[1] == robot.upper[1]
    else:
        with pytest.raises(InvalidInputError, match="joint_2"):
            tracker.reset(q)
        assert np.array_equal(tracker.q, robot.home)
