"""Whatever a tracker is asked for, limits hold exactly, and what is refused or interrupted changes nothing."""

from __future__ import annotations

import copy
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import jacokin
from jacokin import Robot, Tracker
from jacokin.errors import InvalidInputError
from jacokin.ik import Scene, Sphere
from jacokin.motion import AxisTarget, OrientationTarget, PositionTarget, RegionTarget

PACKAGE = str(Path(jacokin.__file__).parent)
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


class InterruptAt:
    """A trace function that interrupts at the n-th line that runs in the package's inverse kinematics."""

    def __init__(self, line: int) -> None:
        self.left = line

    def __call__(self, frame: FrameType, event: str, argument: object) -> InterruptAt | None:
        if PACKAGE not in frame.f_code.co_filename:
            return None
        self.left -= event == "line"
        if self.left == 0 and event == "line":
            raise KeyboardInterrupt
        return self


BALL = Scene([Sphere("ball", 0.05, [0.25, -0.2, 0.62])])


@pytest.mark.one_quick
@pytest.mark.parametrize("stride", [61, pytest.param(7, marks=pytest.mark.slow)])
@pytest.mark.parametrize("use_twist", [False, True], ids=["pose", "twist"])
@pytest.mark.parametrize(
    "options", [{}, {"acceleration_limit": 2.0}, {"scene": BALL}], ids=["plain", "acceleration", "collision"]
)
def test_an_interrupted_tick_leaves_the_old_state_or_the_new_one(
    robot: Robot, options: dict[str, Any], use_twist: bool, stride: int
) -> None:
    """Interrupted at every so many lines of a tick; the ticks that follow move no joint faster than its limit."""
    target = robot.forward_kinematics(robot.home + 0.3)

    def tick(tracker: Tracker) -> NDArray[np.float64]:
        if use_twist:
            return tracker.step(twist=[0.05, 0.0, 0.05, 0.0, 0.1, 0.0]).q
        return tracker.step(target).q

    start = Tracker(robot, **options)
    for _ in range(8):
        start.step(target)
    after = copy.deepcopy(start)
    tick(after)
    for line in range(1, 2_000, stride):
        tracker = copy.deepcopy(start)
        before = sys.gettrace()
        sys.settrace(InterruptAt(line))
        try:
            tick(tracker)
            break  # the tick has fewer lines
        except KeyboardInterrupt:
            pass
        finally:
            sys.settrace(before)
        unmoved = np.array_equal(tracker.q, start.q)
        twin = copy.deepcopy(start if unmoved else after)
        assert np.array_equal(tracker.q, twin.q)
        for _ in range(3):
            from_here = tracker.q
            step = tick(tracker)
            assert np.array_equal(step, tick(twin))
            assert (np.abs(step - from_here) <= (robot.velocity_limit + ROUNDING) * tracker.dt).all()
    assert line > 100


@given(past=st.floats(0.0, 100.0), number=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_joint_past_its_limit_moves_only_inwards(robot: Robot, past: float, number: int) -> None:
    """Up to 1e-6 rad it is put on its limit."""
    assume(abs(past - 1e-6) > 1e-9)
    q = robot.home.copy()
    q[1] = robot.upper[1] + past
    tracker, rng = Tracker(robot, q=q), np.random.default_rng(number)
    outside = tracker.q[1] > robot.upper[1]
    assert outside == (past > 1e-6)
    for _ in range(4):
        target = robot.forward_kinematics(robot.sample(rng))
        for _ in range(25):
            before = max(float(tracker.q[1]), float(robot.upper[1]))
            step = tracker.step(target)
            assert step.q[1] <= before
            assert (np.abs(step.v) <= robot.velocity_limit + ROUNDING).all()
            assert ("joint_2 is" in step.message) == bool(step.q[1] > robot.upper[1])
