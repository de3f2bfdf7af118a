"""Obstacles that move: evaded, measured where they are, and refused where they are not."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from jacokin import Robot, Tracker
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.ik import Box, Capsule, Floor, Obstacle, Scene, Sphere
from jacokin.model.obstacles import pose_of
from jacokin.model.poses import quat_wxyz
from jacokin.motion import TrackerStatus
from jacokin.motion.tracking.moving import MovableShapes
from tests.motion.tracking.test_avoidance import Referee

DT = 0.01  # [s]
DISTANCE = 0.01  # [m]


def put(referee: Referee, name: str, pose: pin.SE3) -> None:
    """Move an obstacle of the referee's MuJoCo model."""
    geom = referee.model.geom(name).id
    referee.model.geom_pos[geom] = pose.translation
    referee.model.geom_quat[geom] = quat_wxyz(pose.rotation)


def after(pose: pin.SE3, twist: NDArray[np.float64], time: float) -> pin.SE3:
    return pin.SE3(pin.exp3(time * twist[3:]) @ pose.rotation, pose.translation + time * twist[:3])


def flight(robot: Robot, rng: np.random.Generator, kind: int) -> tuple[Obstacle, NDArray[np.float64]]:
    """A shape that flies through the hand, slowly enough to be evaded, and its twist."""
    while True:
        shape, twist = arrival(robot, rng, kind)
        if robot.clearance(robot.home, Scene([shape])) > 0.06:
            return shape, twist


def arrival(robot: Robot, rng: np.random.Generator, kind: int) -> tuple[Obstacle, NDArray[np.float64]]:
    """Any shape that flies through the hand."""
    way = rng.normal(size=3)
    way[2] = abs(way[2])
    way /= np.linalg.norm(way)
    hand = robot.forward_kinematics(robot.home).translation
    pose = pin.SE3(pin.exp3(rng.normal(size=3)), hand + 0.4 * way)
    twist = np.concatenate([-rng.uniform(0.1, 0.3) * way, rng.uniform(-1.0, 1.0, 3)])
    shapes: list[Obstacle] = [
        Sphere("it", 0.05, pose.translation),
        Box("it", [0.06, 0.08, 0.05], pose),
        Capsule("it", 0.03, 0.08, pose),
    ]
    return shapes[kind], twist


def fly(robot: Robot, number: int, acceleration_limit: float | None = np.inf) -> float:
    """The least distance [m] of a standing arm that evades a flight, everything else checked on the way."""
    rng = np.random.default_rng(number)
    shape, twist = flight(robot, rng, number % 3)
    scene = Scene([shape])
    referee = Referee(robot, scene, self_collision=False)
    start, home = pose_of(shape), robot.forward_kinematics(robot.home)
    tracker = Tracker(
        robot, dt=DT, scene=scene, clearance=DISTANCE, self_collision=False, acceleration_limit=acceleration_limit
    )
    nearest = without = np.inf
    for tick in range(round(0.8 / np.linalg.norm(twist[:3]) / DT)):
        step = tracker.step(home, obstacles={"it": (after(start, twist, tick * DT), twist)})
        put(referee, "it", after(start, twist, (tick + 1) * DT))
        least = referee.least(step.q)
        if 0.0 < least < 2 * DISTANCE:
            assert step.clearance == pytest.approx(least, abs=1e-5)
        assert robot.within_limits(step.q)
        assert (np.abs(step.v) <= robot.velocity_limit + 1e-9).all()
        nearest, without = min(nearest, least), min(without, referee.least(robot.home))
    assert without < 0.0  # an arm that had stayed would have been hit
    tracker.step(home, obstacles={"it": after(start, np.full(6, 2.0), 1.0)})
    for _ in range(600):
        away = tracker.step(home)
    assert away.status in (TrackerStatus.OK, TrackerStatus.HELD)
    return nearest


@pytest.mark.one_quick
@pytest.mark.parametrize("number", [0, 1, 2])
def test_what_flies_at_the_arm_is_evaded(robot: Robot, number: int) -> None:
    assert fly(robot, number) > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("acceleration_limit", [None, np.inf], ids=["default", "none"])
def test_most_flights_are_evaded_and_none_goes_deep(robot: Robot, acceleration_limit: float | None) -> None:
    nearest = np.array([fly(robot, number, acceleration_limit) for number in range(10)])
    assert (nearest > 0.0).sum() >= 8
    assert nearest.min() > -0.04  # [m]


def test_with_acceleration_limits_slow_obstacles_are_evaded_and_the_limits_kept(robot: Robot) -> None:
    hand, home = robot.forward_kinematics(robot.home).translation, robot.forward_kinematics(robot.home)
    twist = np.array([0.0, 0.0, -0.1, 0.0, 0.0, 0.0])
    scene = Scene([Sphere("ball", 0.05, np.add(hand, [0.0, 0.0, 0.3]))])
    referee = Referee(robot, scene, self_collision=False)
    tracker = Tracker(robot, dt=DT, scene=scene, clearance=DISTANCE, self_collision=False, acceleration_limit=3.0)
    before = tracker.v
    for tick in range(500):
        place = pin.SE3(np.eye(3), np.add(hand, [0.0, 0.0, 0.3 - 0.1 * tick * DT]))
        step = tracker.step(home, obstacles={"ball": (place, twist)})
        put(referee, "ball", after(place, twist, DT))
        assert referee.least(step.q) > 0.0
        assert (np.abs(step.v - before) <= 3.0 * DT + 1e-9).all()
        before = step.v
    assert "ball" in " ".join(tracker.summary.limiting)


def approach(robot: Robot, way: list[float], speed: float, *, told: bool) -> tuple[float, float]:
    """The least distance [m] of a standing arm from a ball that comes to the hand, and when the arm moves first [s]."""
    home, along = robot.forward_kinematics(robot.home), np.array(way) / np.linalg.norm(way)
    twist, begin = np.append(-speed * along, np.zeros(3)), home.translation + 0.4 * along
    scene = Scene([Sphere("ball", 0.05, begin)])
    referee, tracker = Referee(robot, scene, self_collision=False), Tracker(robot, dt=DT, scene=scene)
    least, first = np.inf, np.inf
    for tick in range(round(0.4 / speed / DT)):
        here = begin + tick * DT * twist[:3]
        step = tracker.step(home, obstacles={"ball": (here, twist) if told else here})
        put(referee, "ball", pin.SE3(np.eye(3), here + DT * twist[:3]))
        least = min(least, referee.least(step.q))
        if np.isinf(first) and np.abs(step.v).max() > 0.01:
            first = tick * DT
    return least, first


@pytest.mark.one_quick
@pytest.mark.parametrize("way", [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
def test_what_comes_at_a_known_velocity_is_evaded_earlier_and_kept_away(robot: Robot, way: list[float]) -> None:
    (nearest, known), (touched, unknown) = (approach(robot, way, 0.3, told=told) for told in (True, False))
    assert known < unknown - 0.3  # [s]
    assert nearest >= DISTANCE
    assert touched < 0.0  # without its velocity, it is too fast for the arm


@pytest.mark.one_quick
@pytest.mark.parametrize("speed", [0.05, 0.1, 0.2])
def test_the_clearance_is_kept_from_what_the_arm_can_outrun(robot: Robot, speed: float) -> None:
    for way in ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 1.0], [1.0, -1.0, 0.5]):
        nearest, _ = approach(robot, way, speed, told=True)
        assert nearest >= DISTANCE - 1e-4


def test_a_new_obstacle_comes_with_its_velocity(robot: Robot) -> None:
    home = robot.forward_kinematics(robot.home)
    begin, twist = np.add(home.translation, [0.0, 0.0, 0.4]), np.array([0.0, 0.0, -0.3, 0.0, 0.0, 0.5])
    known = Tracker(robot, dt=DT, scene=Scene([Box("cup", [0.06, 0.08, 0.1], begin)]), self_collision=False)
    new = Tracker(robot, dt=DT, scene=Scene(), self_collision=False)
    for tick in range(150):
        here = pin.SE3(pin.exp3(tick * DT * twist[3:]), begin + tick * DT * twist[:3])
        told = known.step(home, obstacles={"cup": (here, twist)})
        shown = new.step(home, obstacles={"cup": (Box("cup", [0.06, 0.08, 0.1], here), twist)})
        np.testing.assert_allclose(shown.q, told.q, atol=1e-9)
    assert np.abs(told.q - robot.home).max() > 0.05
    new.step(home, obstacles={"cup": None})
    gone = new.step(home)
    assert gone.clearance == np.inf
    assert (told.clearance or 0.0) < np.inf


def test_a_known_shape_given_again_has_only_moved(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is built for it; another size, or another kind of shape, is another obstacle."""
    home, built = robot.forward_kinematics(robot.home), 0
    tracker = Tracker(robot, scene=Scene([Box("cup", [0.1] * 3, [0.6, 0.0, 0.9]), Sphere("ball", 0.1, [1.0] * 3)]))
    make = tracker._make_guard

    def counted(**given: Any) -> Any:
        nonlocal built
        built += 1
        return make(**given)

    monkeypatch.setattr(tracker, "_make_guard", counted)
    place = np.add(home.translation, [0.0, 0.0, 0.22])
    shown = tracker.step(home, obstacles={"cup": Box("cup", [0.1] * 3, place), "ball": Sphere("ball", 0.1, [2.0] * 3)})
    assert built == 0
    expected = Tracker(robot, scene=Scene([Box("cup", [0.1] * 3, place)])).step(home)
    assert shown.clearance == pytest.approx(expected.clearance, abs=1e-9)
    tracker.step(home, obstacles={"cup": Box("cup", [0.1, 0.1, 0.2], place)})
    tracker.step(home, obstacles={"cup": Sphere("cup", 0.1, place)})
    tracker.step(home, obstacles={"cup": (Sphere("cup", 0.1, place), np.zeros(6))})
    assert built == 2


def test_an_obstacle_goes_on_until_told_otherwise(robot: Robot) -> None:
    far = Sphere("ball", 0.05, [2.0, 0.0, 0.5])
    home = robot.forward_kinematics(robot.home)
    tracker = Tracker(robot, dt=DT, scene=Scene([far]), self_collision=False)
    told = Tracker(robot, dt=DT, scene=Scene([far]), self_collision=False)
    twist = np.array([-1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    tracker.step(home, obstacles={"ball": (far.position, twist)})
    for _ in range(99):
        tracker.step(home)
    for tick in range(100):
        place = np.asarray(far.position) + tick * DT * twist[:3]
        step = told.step(home, obstacles={"ball": (place, twist)})
    assert tracker.step(home).clearance == pytest.approx(told.step(home).clearance, abs=1e-9)
    standing = tracker.step(home, obstacles={"ball": [3.0, 0.0, 0.5]}).clearance
    assert tracker.step(home).clearance == pytest.approx(standing, abs=1e-12)
    tracker.reset()
    assert tracker.step(home).clearance == Tracker(robot, scene=Scene([far]), self_collision=False).step(home).clearance
    assert step.status is TrackerStatus.OK


def test_copies_and_measuring_leave_obstacles_where_they_are(robot: Robot) -> None:
    home = robot.forward_kinematics(robot.home)
    near = np.add(home.translation, [0.0, 0.0, 0.12])
    tracker = Tracker(robot, dt=DT, scene=Scene([Sphere("ball", 0.05, [2.0, 0.0, 0.5])]), self_collision=False)
    tracker.step(home, obstacles={"ball": near})
    for other in (pickle.loads(pickle.dumps(tracker)), copy.deepcopy(tracker)):
        here = copy.deepcopy(tracker)
        assert other.measure(home).clearance == here.measure(home).clearance
        for _ in range(5):
            assert np.array_equal(other.step(home).q, here.step(home).q)


def test_shapes_move_no_farther_and_no_faster_than_said(robot: Robot, rng: np.random.Generator) -> None:
    """Bounds of travel and speed against points on the surface."""
    pose = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
    scene = Scene([Floor(-1.0), Box("box", [0.2, 0.1, 0.3], pose), Sphere("ball", 0.1, [0.5, 0.0, 0.5])])
    shapes = MovableShapes(scene.obstacles, scene.contact(robot))
    corners = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1) * np.array([[0.1], [0.05], [0.15]])
    for _ in range(50):
        twist = rng.normal(size=6)
        where = shapes.told(shapes.start, {"box": (pose, twist)})
        later = where.after(float(rng.uniform(0.0, 1.0)))
        there = later.poses[0, :, :3] @ corners + later.poses[0, :, 3:]
        here = where.poses[0, :, :3] @ corners + where.poses[0, :, 3:]
        assert np.linalg.norm(there - here, axis=0).max() <= shapes.travel(where, later)[0] + 1e-12
        speed = twist[:3, None] + np.cross(twist[3:], (here - where.poses[0, :, 3:]).T).T
        assert np.linalg.norm(speed, axis=0).max() <= where.speeds[0] + 1e-12
        assert shapes.travel(where, later)[1] == 0.0


@pytest.mark.parametrize(
    ("given", "error", "match"),
    [
        ({"bal": [0.0] * 3}, UnknownNameError, "unknown obstacle 'bal'. Did you mean 'ball'"),
        ({"floor": [0.0] * 3}, InvalidInputError, "'floor' has no pose and cannot move"),
        ({"ball": [0.0] * 2}, InvalidInputError, r"obstacles\['ball'\] must have shape \(3,\)"),
        ({"ball": [np.nan] * 3}, InvalidInputError, r"obstacles\['ball'\] must be finite"),
        ({"ball": ([0.0] * 3, [np.nan] * 6)}, InvalidInputError, r"obstacles\['ball'\]: twist must be finite"),
        ({"ball": (Sphere("ball", 0.05, [0.0] * 3), [0.0] * 5)}, InvalidInputError, r"twist must have shape \(6,\)"),
        ({"cup": (Sphere("ball", 0.05, [0.0] * 3), [0.0] * 6)}, InvalidInputError, "'cup'.* has the name 'ball'"),
        ({"cup": (Sphere("cup", 0.05, [0.0] * 3), [np.inf] * 6)}, InvalidInputError, "twist must be finite"),
        ({"floor": (Floor(-0.5), [0.0] * 6)}, InvalidInputError, "which have a pose"),
        ({"ball": (None, [0.0] * 6)}, InvalidInputError, r"obstacles\['ball'\] must be"),
        ({"ball": "near"}, InvalidInputError, r"obstacles\['ball'\] must be"),
        ([0.0] * 3, InvalidInputError, "obstacles must be a dict of poses by name"),
    ],
)
def test_wrong_obstacles_change_nothing(robot: Robot, given: Any, error: type[Exception], match: str) -> None:
    scene = Scene([Sphere("ball", 0.05, [0.5, 0.0, 0.5]), Floor(-0.5)])
    tracker, twin = (Tracker(robot, scene=scene) for _ in range(2))
    home = robot.forward_kinematics(robot.home)
    with pytest.raises(error, match=match):
        tracker.step(home, obstacles=given)
    step, same = tracker.step(home), twin.step(home)
    assert np.array_equal(step.q, same.q)
    assert step.clearance == same.clearance


def test_obstacles_without_a_scene_are_refused(robot: Robot) -> None:
    with pytest.raises(InvalidInputError, match="obstacles has no effect without a scene"):
        Tracker(robot).step(robot.forward_kinematics(robot.home), obstacles={"ball": [0.0] * 3})


def test_another_robot_that_moves_is_for_another_tracker(robot: Robot) -> None:
    """What the refusal says to do goes on with the motion, among the moved robot."""
    base = pin.SE3(np.eye(3), np.array([1.2, 0.0, 0.0]))
    scene = Scene([Floor(-0.5)]).adding_robot(robot, robot.home, name="left", base=base)
    tracker, up = Tracker(robot, scene=scene), robot.forward_kinematics(robot.home)
    up.translation = up.translation + np.array([0.0, 0.0, 0.05])
    for _ in range(10):
        tracker.step(up)
    q = robot.home + 0.2
    with pytest.raises(InvalidInputError, match=r"the robot 'left' stands still .*scene\.moving\(\{'left': q\}\)"):
        tracker.step(up, obstacles={"left": q})
    onwards = Tracker(robot, scene=scene.moving({"left": q}), state=tracker.state)
    assert np.array_equal(onwards.v, tracker.v)
    np.testing.assert_allclose(onwards.step(up).q, tracker.step(up).q, atol=1e-12)


def test_the_referee_moves_shapes(robot: Robot) -> None:
    referee = Referee(robot, Scene([Sphere("ball", 0.05, [2.0, 0.0, 0.5])]), self_collision=False)
    put(referee, "ball", robot.forward_kinematics(robot.home))
    assert referee.least(robot.home) < 0.0
    assert isinstance(referee.model, mujoco.MjModel)
