"""Shapes kept apart: full-speed passes by obstacles, starts inside one, self-collision, and wrong scenes."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from jacokin import Robot, Tracker
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.ik import Box, Capsule, Floor, Obstacle, Sphere
from jacokin.model.mujoco_twin import to_spec
from jacokin.motion import Clearance, TrackerStatus
from jacokin.motion.tracking.avoidance import compile_with

DISTANCE = 0.01  # [m]
TOLERANCE = 1e-4  # [m]
HORIZON = 0.2  # [m] the referee does not look farther


class Referee:
    """Distances by brute force: every pair, every time."""

    def __init__(self, robot: Robot, clearance: Clearance) -> None:
        self.model, self.pairs = compile_with(robot, clearance)
        self.data = mujoco.MjData(self.model)

    def least(self, q: NDArray[np.float64]) -> float:
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        fromto = np.zeros(6)
        return float(min(mujoco.mj_geomDistance(self.model, self.data, a, b, HORIZON, fromto) for a, b in self.pairs))


def obstacle(kind: int, centre: NDArray[np.float64], rng: np.random.Generator) -> Obstacle:
    pose = pin.SE3(pin.exp3(rng.normal(size=3)), centre)
    if kind == 0:
        return Box("box", rng.uniform(0.04, 0.2, 3), pose)
    if kind == 1:
        return Sphere("ball", rng.uniform(0.03, 0.1), centre)
    return Capsule("rod", 0.03, 0.2, pose)


@pytest.mark.slow
def test_two_hundred_passes_at_full_speed_keep_the_distance(robot: Robot, rng: np.random.Generator) -> None:
    start = robot.forward_kinematics(robot.home).translation
    passes, closest, at_speed, near = 0, np.inf, 0, 0
    while passes < 200:
        centre = start + rng.uniform(-0.2, 0.2, 3)
        clearance = Clearance(DISTANCE, [obstacle(passes % 3, centre, rng)], self_collision=False)
        referee = Referee(robot, clearance)
        if referee.least(robot.home) < 0.03:
            continue
        passes += 1
        tracker = Tracker(robot, collision=clearance)
        # Beyond the obstacle, so that the way there leads through it.
        target = centre + 0.3 * (centre - start) / np.linalg.norm(centre - start)
        for _ in range(40):
            step = tracker.step(target)
            distance = referee.least(step.q)
            assert distance >= DISTANCE - TOLERANCE
            assert step.clearance is not None
            assert step.clearance <= distance + 1e-6
            if distance < 2 * DISTANCE:
                assert step.clearance == pytest.approx(distance, abs=1e-6)
            assert robot.within_limits(step.q)
            assert (np.abs(step.v) <= robot.velocity_limit + 1e-9).all()
            closest = min(closest, distance)
            at_speed += bool((np.abs(step.v) > 0.999 * robot.velocity_limit).any())
            near += distance < 2 * DISTANCE
    assert closest < 1.2 * DISTANCE  # the passes did come near
    assert at_speed > 2_000
    assert near > 500


@pytest.mark.parametrize("number", range(12))
def test_an_arm_inside_an_obstacle_moves_out(robot: Robot, number: int) -> None:
    rng = np.random.default_rng(number)
    pose = robot.forward_kinematics(robot.home)
    clearance = Clearance(DISTANCE, [obstacle(number % 3, pose.translation, rng)])
    referee = Referee(robot, clearance)
    assert referee.least(robot.home) < 0.0
    tracker = Tracker(robot, collision=clearance)
    for _ in range(200):
        step = tracker.step(pose)
        assert robot.within_limits(step.q)
    assert referee.least(step.q) >= DISTANCE - TOLERANCE
    assert step.status is not TrackerStatus.OK
    assert any("~" in name for name in step.limiting)


def test_the_floor_is_not_touched(robot: Robot) -> None:
    clearance = Clearance(DISTANCE, [Floor()], self_collision=False)
    referee = Referee(robot, clearance)
    tracker = Tracker(robot, collision=clearance)
    start = robot.forward_kinematics(robot.home).translation
    for _ in range(250):
        step = tracker.step(np.array([start[0], start[1] - 0.1, -0.2]))
        assert referee.least(step.q) >= DISTANCE - TOLERANCE
    assert referee.least(step.q) < 2 * DISTANCE
    assert any(name.startswith("floor~") for name in step.limiting)


def test_the_arm_does_not_touch_itself(robot: Robot, rng: np.random.Generator) -> None:
    clearance = Clearance(0.005)
    referee = Referee(robot, clearance)
    tracker = Tracker(robot, collision=clearance)
    nearest = np.inf
    for _ in range(12):
        target = robot.forward_kinematics(robot.sample(rng))
        for tick in range(100):
            step = tracker.step(target)
            assert robot.within_limits(step.q)
            if tick % 10 == 9:
                distance = referee.least(step.q)
                assert distance >= 0.005 - TOLERANCE
                nearest = min(nearest, distance)
    assert nearest < 0.03


def test_clearance_holds_with_acceleration_limits_too(robot: Robot) -> None:
    start = robot.forward_kinematics(robot.home).translation
    clearance = Clearance(DISTANCE, [Sphere("ball", 0.05, start + np.array([0.0, 0.0, 0.25]))], self_collision=False)
    referee = Referee(robot, clearance)
    tracker = Tracker(robot, collision=clearance, acceleration_limit=2.0)
    for _ in range(150):
        step = tracker.step(start + np.array([0.0, 0.0, 0.5]))
        assert referee.least(step.q) >= DISTANCE - TOLERANCE


def test_far_obstacles_change_nothing(robot: Robot) -> None:
    pose = robot.forward_kinematics(robot.home)
    pose = pin.SE3(pose.rotation, pose.translation + np.array([0.0, 0.0, 0.02]))
    plain = Tracker(robot)
    guarded = Tracker(
        robot, collision=Clearance(DISTANCE, [Sphere("moon", 0.1, [5.0, 5.0, 5.0])], self_collision=False)
    )
    for _ in range(30):
        assert np.array_equal(plain.step(pose).q, guarded.step(pose).q)
    seen = guarded.step(pose).clearance
    assert seen is not None
    assert 0.1 < seen < 9.0


def test_named_pairs_only(robot: Robot) -> None:
    pose = robot.forward_kinematics(robot.home)
    ball = Sphere("ball", 0.05, pose.translation)
    shapes = [geom.name for geom in to_spec(robot, geometry=True).geoms]
    base = next(name for name in shapes if name.startswith("link_2"))
    tracker = Tracker(robot, collision=Clearance(DISTANCE, [ball], pairs=[("ball", base)]))
    assert tracker.step(pose).status is TrackerStatus.OK  # the hand is inside the ball, but only link 2 is kept away


@pytest.mark.parametrize(
    ("make", "error", "match"),
    [
        (lambda: Clearance(pairs=[("link_9", "link_1_ring")]), UnknownNameError, "unknown shape 'link_9'"),
        (
            lambda: Clearance(pairs=["link_1_ring"]),  # type: ignore[list-item]  # wrong on purpose
            InvalidInputError,
            "pairs of shape names",
        ),
        (lambda: Clearance(pairs=[("link_1_ring", "link_1_column")]), InvalidInputError, "same link"),
        (lambda: Clearance("far"), InvalidInputError, "distance must be"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: Clearance(obstacles=Floor()), InvalidInputError, "obstacles must be a list"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: Clearance(obstacles=["floor"]), InvalidInputError, "each be a shape with a name"),  # type: ignore[list-item]  # wrong on purpose
        (lambda: Clearance(obstacles=[Floor(name="")]), InvalidInputError, "must have a name"),
        (lambda: Clearance(-0.01), InvalidInputError, "distance must be"),
        (lambda: Clearance(np.nan), InvalidInputError, "distance must be"),
        (lambda: Clearance(obstacles=[Sphere("a", 0.0, [0.0] * 3)]), InvalidInputError, "a: radius"),
        (lambda: Clearance(obstacles=[Box("b", [0.1, -0.1, 0.1], [0.0] * 3)]), InvalidInputError, "b: size"),
        (lambda: Clearance(obstacles=[Box("b", [0.1, 0.1], [0.0] * 3)]), InvalidInputError, "b: size"),
        (lambda: Clearance(obstacles=[Box("b", [0.1] * 3, [np.nan] * 3)]), InvalidInputError, "b: pose"),
        (lambda: Clearance(obstacles=[Capsule("c", 0.1, np.inf, [0.0] * 3)]), InvalidInputError, "c: length"),
        (lambda: Clearance(obstacles=[Floor(np.nan)]), InvalidInputError, "floor: height"),
        (lambda: Box("b", ["0.1"] * 3, [0.0] * 3), InvalidInputError, "b: size must be one number or 3"),
        (lambda: Box("b", [True] * 3, [0.0] * 3), InvalidInputError, "b: size must be one number or 3"),
        (lambda: Box("b", np.array(["2026-01-01"] * 3, "M8[D]"), [0.0] * 3), InvalidInputError, "b: size must be"),
        (lambda: Box("b", [0.1] * 3, "here"), InvalidInputError, "b: pose must be a pose or a position"),
        (lambda: Sphere("a", True, [0.0] * 3), InvalidInputError, "a: radius must be a positive number"),
        (lambda: Sphere("a", "1", [0.0] * 3), InvalidInputError, "a: radius must be"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: Capsule("c", 0.1, False, [0.0] * 3), InvalidInputError, "c: length must be a positive number"),
        (lambda: Clearance(self_collision="no"), InvalidInputError, "self_collision must be True or False"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: Clearance(obstacles=[Box("link_1_ring", [0.1] * 3, [5.0] * 3)]), InvalidInputError, "a shape of the"),
        (lambda: Clearance(obstacles=[Floor(), Floor(-0.1)]), InvalidInputError, "'floor' is used by two"),
    ],
)
def test_wrong_scenes_are_refused_before_the_first_tick(
    robot: Robot, make: Any, error: type[Exception], match: str
) -> None:
    with pytest.raises(error, match=match):
        Tracker(robot, collision=make())
