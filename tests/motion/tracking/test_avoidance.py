"""Shapes kept apart: full-speed passes by obstacles, starts inside one, self-collision, and wrong scenes."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

import jacokin
from benchmarks.smooth import jolts
from jacokin import Robot, Tracker
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.ik import Box, Capsule, Floor, Obstacle, Scene, Sphere
from jacokin.kernels.tracking.reach import CLOSE
from jacokin.model import to_mujoco
from jacokin.model.mujoco_twin import to_spec
from jacokin.model.own_shapes import kept_less
from jacokin.motion import PoseTarget, PositionTarget, TrackerStatus
from jacokin.motion.tracking.avoidance import NEARER, make_guard
from jacokin.motion.tracking.joint_limits import JointLimits
from jacokin.motion.tracking.targets import Kinematics, TaskFactory
from jacokin.motion.tracking.ticks import JointState, TickSolver
from tests.coal_shapes import collision_pairs
from tests.near_neighbours import CLEARANCE, NEIGHBOURS, near_neighbours, of_neighbours_and_others

DISTANCE = 0.01  # [m]
TOLERANCE = 1e-4  # [m]
HORIZON = 0.2  # [m] the referee does not look farther
Find = Callable[[str], Robot]


class Referee:
    """Distances by brute force: every pair, every time."""

    def __init__(self, robot: Robot, scene: Scene, *, self_collision: bool = True) -> None:
        spec = to_spec(robot, geometry=True)
        for obstacle in scene.obstacles:
            obstacle.add_to(spec.worldbody)
        self.model = spec.compile()
        self.pairs = collision_pairs(self.model, scene.obstacles, self_collision=self_collision)
        self.data = mujoco.MjData(self.model)

    def least(self, q: NDArray[np.float64], links: Collection[str] = (), *, without: Collection[str] = ()) -> float:
        """Of all pairs [m], or of those whose second shape is of some links, or not of some."""
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        fromto, found = np.zeros(6), HORIZON
        for a, b in self.pairs:
            link = "_".join(self.model.geom(b).name.split("_")[:2])
            if (not links or link in links) and link not in without:
                found = min(found, mujoco.mj_geomDistance(self.model, self.data, a, b, HORIZON, fromto))
        return found


def obstacle(kind: int, centre: NDArray[np.float64], rng: np.random.Generator) -> Obstacle:
    pose = pin.SE3(pin.exp3(rng.normal(size=3)), centre)
    if kind == 0:
        return Box("box", rng.uniform(0.04, 0.2, 3), pose)
    if kind == 1:
        return Sphere("ball", rng.uniform(0.03, 0.1), centre)
    return Capsule("rod", 0.03, 0.2, pose)


@pytest.mark.slow
@pytest.mark.parametrize("count", [6, pytest.param(30, marks=pytest.mark.slow)])
def test_passes_at_full_speed_keep_the_distance(robot: Robot, rng: np.random.Generator, count: int) -> None:
    start = robot.forward_kinematics(robot.home).translation
    passes, closest, at_speed, near = 0, np.inf, 0, 0
    while passes < count:
        centre = start + rng.uniform(-0.2, 0.2, 3)
        scene = Scene([obstacle(passes % 3, centre, rng)])
        referee = Referee(robot, scene, self_collision=False)
        if referee.least(robot.home) < 0.03:
            continue
        passes += 1
        tracker = Tracker(robot, scene=scene, clearance=DISTANCE, self_collision=False, acceleration_limit=np.inf)
        # Beyond the obstacle, so that the way there leads through it.
        target = centre + 0.3 * (centre - start) / np.linalg.norm(centre - start)
        for _ in range(120):
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
    assert at_speed > 10 * count
    assert near > 2.5 * count


@pytest.mark.parametrize("number", [*range(3), *(pytest.param(n, marks=pytest.mark.slow) for n in range(3, 9))])
def test_an_arm_inside_an_obstacle_moves_out(robot: Robot, number: int) -> None:
    rng = np.random.default_rng(number)
    pose = robot.forward_kinematics(robot.home)
    scene = Scene([obstacle(number % 3, pose.translation, rng)])
    referee = Referee(robot, scene)
    assert referee.least(robot.home) < 0.0
    tracker = Tracker(robot, scene=scene, clearance=DISTANCE)
    named = False
    for _ in range(200):
        step = tracker.step(pose)
        assert robot.within_limits(step.q)
        named |= any("~" in name for name in step.limiting)
    assert referee.least(step.q) >= DISTANCE - TOLERANCE
    assert step.status is not TrackerStatus.OK
    assert named


def pedestal(top: float) -> Scene:
    """A block around the base, up to a height [m]."""
    return Scene([Box("pedestal", [0.3, 0.3, 0.5], [0.0, 0.0, top - 0.25])])


@pytest.mark.parametrize("far", [False, True])
def test_an_arm_that_no_motion_takes_out_of_an_obstacle_does_not_shake(bundled: Find, far: bool) -> None:
    """The second joint swung for ever, with its hub in a block around the base."""
    gen3 = bundled("gen3")
    scene = pedestal(0.236)  # 80 mm above the lower end of its first link
    tracker, pose = Tracker(gen3, scene=scene, clearance=DISTANCE), gen3.forward_kinematics(gen3.home)
    target = pin.SE3(
        pose.rotation, np.array([2.0, 0.5, 0.6]) if far else pose.translation + np.array([-0.1, 0.1, 0.05])
    )
    referee = Referee(gen3, scene, self_collision=False)
    inside = {"link_1", "link_2"}
    start, steps = referee.least(gen3.home, inside), [tracker.step(target) for _ in range(700)]
    assert start < -0.07
    assert all(referee.least(step.q, inside) >= start - NEARER for step in steps[::10])
    assert all(referee.least(step.q, without=inside) >= DISTANCE - TOLERANCE for step in steps[::10])
    assert steps[-1].status is (TrackerStatus.HELD if far else TrackerStatus.OK)
    assert np.abs(steps[-1].v).max() < 1e-5
    assert "no motion parts" in steps[-1].message
    assert "pedestal~link_1" in steps[-1].message
    assert jolts(np.array([step.v for step in steps]), gen3.velocity_limit / 0.3, 0.01) <= 4


@pytest.mark.parametrize("name", ["j2n6s300", "gen3"])
def test_a_table_that_the_first_link_stands_in_is_not_touched_by_others(bundled: Find, name: str) -> None:
    """While one link was in an obstacle the others were free: a hand went 25 mm deep into the table."""
    robot, scene = bundled(name), Scene([Box("table", [2.0, 2.0, 0.1], [0.0, 0.0, 0.12])])
    pose, referee = robot.forward_kinematics(robot.home), Referee(robot, scene, self_collision=False)
    tracker, nearest = Tracker(robot, scene=scene, clearance=DISTANCE, self_collision=False), np.inf
    target = pin.SE3(pose.rotation, np.array([*pose.translation[:2], 0.05]))  # below the table's top
    for _ in range(300):
        nearest = min(nearest, referee.least(tracker.step(target).q, without={"link_1"}))
    assert DISTANCE - TOLERANCE <= nearest < 2.0 * DISTANCE


def test_what_no_motion_parts_comes_no_nearer_as_obstacles_come_and_go(bundled: Find) -> None:
    gen3 = bundled("gen3")
    scene, target = pedestal(0.236), pin.SE3(np.eye(3), np.array([0.9, 0.9, 0.1]))
    tracker, referee = Tracker(gen3, scene=scene), Referee(gen3, scene, self_collision=False)
    start = referee.least(gen3.home, {"link_2"})
    for tick in range(300):
        moon = Sphere("moon", 0.1, [5.0, 5.0, 5.0]) if tick % 2 == 0 else None
        step = tracker.step(target, obstacles={"moon": moon})
        assert referee.least(step.q, {"link_2"}) >= start - NEARER


def test_an_obstacle_that_comes_into_the_shoulder_and_stays_does_not_shake_the_arm(bundled: Find) -> None:
    gen3 = bundled("gen3")
    tracker, pose = Tracker(gen3, scene=pedestal(0.1)), gen3.forward_kinematics(gen3.home)
    for tick in range(500):
        top = min(0.1 + 0.001 * tick, 0.236)
        late = 1e-9 if tick % 7 == 0 else None  # [s]
        step = tracker.step(pose, obstacles={"pedestal": [0.0, 0.0, top - 0.25]}, budget=late)
    assert step.status is TrackerStatus.OK
    assert np.abs(step.v).max() < 1e-5
    for _ in range(2):
        step = tracker.step(pose, obstacles={"pedestal": [0.0, 0.0, -1.0]})
    assert not step.message


#: Blocks beside a shoulder: the arm, edge lengths and centre [m], yaw [rad], and how far off targets may stay [m].
BESIDE = {
    "clear": ("gen3", [0.138, 0.115, 0.168], [-0.128, -0.009, 0.154], -3.073, [1e-4, 1e-4, 0.04]),
    "touching": ("gen3", [0.194, 0.189, 0.138], [-0.043, 0.148, 0.223], 1.856, [1e-4, 1e-4, 1e-4]),
    "inside": ("gen3", [0.162, 0.118, 0.186], [-0.005, 0.128, 0.244], 1.613, [1e-4, 1e-4, 1e-4]),
    "many": ("j2s7s300", [0.166, 0.173, 0.16], [-0.126, 0.028, 0.224], 2.92, [1e-4, 1e-4, 1e-4]),
    "many inside": ("j2s7s300", [0.176, 0.176, 0.168], [0.063, -0.121, 0.249], -1.091, [0.01, 0.09, 0.01]),
}
#: [rad] from home to the targets beside these.
AWAY = {
    "clear": [
        [0.18, 0.79, -0.35, 0.23, -0.59, -0.13, -0.56],
        [0.53, 0.29, -0.79, -0.28, -0.68, -0.39, 0.23],
        [0.09, -0.6, 0.12, -0.3, 0.37, 0.04, -0.08],
    ],
    "touching": [
        [-0.27, -0.19, -0.7, -0.3, 0.77, 0.09, -0.13],
        [-0.36, 0.1, 0.2, 0.69, 0.65, -0.13, 0.62],
        [-0.46, -0.21, 0.26, -0.09, 0.24, 0.3, 0.5],
    ],
    "inside": [
        [-0.2, -0.3, -0.16, 0.39, -0.23, 0.55, -0.43],
        [-0.15, -0.26, 0.16, 0.59, 0.68, 0.43, -0.18],
        [0.01, -0.45, 0.72, 0.06, 0.31, 0.03, -0.38],
    ],
    "many": [
        [0.0, 0.4, 0.26, 0.67, -0.57, 0.57, 0.3],
        [-0.38, 0.6, -0.72, 0.34, 0.68, 0.24, -0.75],
        [0.0, 0.4, 0.08, -0.23, -0.8, 0.44, 0.36],
    ],
    "many inside": [
        [0.61, 0.22, -0.71, 0.54, 0.0, 0.05, -0.21],
        [0.15, 0.63, 0.53, 0.14, 0.04, -0.32, -0.77],
        [0.25, 0.28, -0.51, 0.68, 0.56, -0.26, -0.69],
    ],
}


@pytest.mark.parametrize("case", BESIDE)
def test_a_block_beside_the_shoulder_neither_holds_nor_shakes_the_arm(bundled: Find, case: str) -> None:
    """Shapes that can move apart, but hardly, held the arm up to 0.3 m away, or turned its first joint to and fro."""
    name, size, place, yaw, off = BESIDE[case]
    robot, scene = bundled(name), Scene([Box("block", size, jacokin.pose(place, rpy=[0.0, 0.0, yaw]))])
    start = robot.clearance(robot.home, scene)
    assert start < DISTANCE
    for away, most in zip(AWAY[case], off, strict=True):
        tracker, target = Tracker(robot, scene=scene), robot.forward_kinematics(robot.home + np.array(away))
        steps = [tracker.step(target) for _ in range(900)]
        least = min(step.clearance for step in steps if step.clearance is not None)
        assert least >= start - NEARER
        assert least > 0.0 or start < 0.0
        assert steps[-1].position_error < most
        assert np.abs(steps[-1].v).max() < 1e-5
        assert jolts(np.array([step.v for step in steps]), robot.velocity_limit / 0.3, 0.01) <= 4


@pytest.mark.parametrize("moves", [False, True])
def test_what_stays_too_near_is_named_until_it_is_away(bundled: Find, moves: bool) -> None:
    gen3 = bundled("gen3")
    _, size, place, yaw, _ = BESIDE["clear"]
    block = Box("block", size, jacokin.pose(place, rpy=[0.0, 0.0, yaw]))
    tracker, pose = Tracker(gen3, scene=Scene([block])), gen3.forward_kinematics(gen3.home)
    messages = []
    for tick in range(120):
        there = jacokin.pose([*place[:2], place[2] + 1e-6 * (tick % 2)], rpy=[0.0, 0.0, yaw])
        messages.append(tracker.step(pose, obstacles={"block": there} if moves else None).message)
    assert "no motion parts" not in messages[30]
    # One that is told to be elsewhere all the time is waited for anew.
    assert ("no motion parts block~link_1" in messages[-1]) is not moves
    for _ in range(2):
        gone = tracker.step(pose, obstacles={"block": [0.0, 0.0, -1.0]})
    assert "no motion parts" not in gone.message


def test_the_floor_is_not_touched(robot: Robot) -> None:
    referee = Referee(robot, Scene([Floor()]), self_collision=False)
    tracker = Tracker(robot, scene=Scene([Floor()]), self_collision=False)
    start = robot.forward_kinematics(robot.home).translation
    for _ in range(400):
        step = tracker.step(np.array([start[0], start[1] - 0.1, -0.2]))
        assert referee.least(step.q) >= DISTANCE - TOLERANCE
    assert referee.least(step.q) < 2 * DISTANCE
    assert any(name.startswith("floor~") for name in step.limiting)


@pytest.mark.slow
@pytest.mark.parametrize("targets", [8, pytest.param(12, marks=pytest.mark.slow)])
def test_the_arm_does_not_touch_itself(robot: Robot, rng: np.random.Generator, targets: int) -> None:
    referee = Referee(robot, Scene())
    tracker = Tracker(robot, collision="reject", clearance=0.005)
    nearest = np.inf
    for _ in range(targets):
        target = robot.forward_kinematics(robot.sample(rng))
        for tick in range(200):
            step = tracker.step(target)
            assert robot.within_limits(step.q)
            if tick % 10 == 9:
                distance = referee.least(step.q)
                assert distance >= 0.005 - TOLERANCE
                nearest = min(nearest, distance)
    assert nearest < 0.03


def test_clearance_holds_with_acceleration_limits_too(robot: Robot) -> None:
    start = robot.forward_kinematics(robot.home).translation
    scene = Scene([Sphere("ball", 0.05, start + np.array([0.0, 0.0, 0.25]))])
    referee = Referee(robot, scene, self_collision=False)
    tracker = Tracker(robot, scene=scene, self_collision=False, acceleration_limit=2.0)
    for _ in range(150):
        step = tracker.step(start + np.array([0.0, 0.0, 0.5]))
        assert referee.least(step.q) >= DISTANCE - TOLERANCE


def test_shapes_that_are_near_everywhere_change_nothing() -> None:
    robot = jacokin.load_robot("gen3_lite")  # its fingers are 23 mm from the link before the wrist
    plain, guarded = Tracker(robot), Tracker(robot, collision="reject", clearance=0.03)
    pose = robot.forward_kinematics(robot.home)
    for tick in range(60):
        there = pin.SE3(pose.rotation, pose.translation + np.array([0.0, 0.0, 5e-4 * tick]))
        np.testing.assert_allclose(guarded.step(there).q, plain.step(there).q, rtol=0.0, atol=1e-12)  # rounding


def test_neighbours_nearer_than_the_clearance_follow_until_they_would_touch(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    robot = near_neighbours(tmp_path)
    kept = kept_less(robot, None, CLEARANCE)[NEIGHBOURS]
    rows = robot.sample(rng, 200)
    away, others = of_neighbours_and_others(robot, rows)
    starts, near = rows[(away > 0.5 * CLEARANCE) & (others > 2.0 * CLEARANCE)][:6], []
    for start in starts:
        turned = start + np.linspace(0.0, np.pi, 200)[:, None] * np.eye(6)[4]  # the fifth joint, until they are nearest
        goal = turned[np.argmin(of_neighbours_and_others(robot, turned)[0])]
        tracker = Tracker(robot, dt=0.01, clearance=CLEARANCE, q=start)
        steps = [tracker.step(robot.forward_kinematics(goal)) for _ in range(500)]
        away, others = of_neighbours_and_others(robot, np.array([step.q for step in steps]))
        near.append(away.min())
        assert away.min() > kept - TOLERANCE
        assert others.min() > CLEARANCE - TOLERANCE
    assert min(near) < 0.5 * CLEARANCE - 3.0 * NEARER  # much nearer than they were


def test_far_obstacles_change_nothing(robot: Robot) -> None:
    pose = robot.forward_kinematics(robot.home)
    pose = pin.SE3(pose.rotation, pose.translation + np.array([0.0, 0.0, 0.02]))
    plain = Tracker(robot)
    guarded = Tracker(robot, scene=Scene([Sphere("moon", 0.1, [5.0, 5.0, 5.0])]), self_collision=False)
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
    tracker = Tracker(robot, scene=Scene([ball]), pairs=[("ball", base)])
    assert tracker.step(pose).status is TrackerStatus.OK  # the hand is inside the ball, but only link 2 is kept away


def test_shapes_are_kept_apart_where_anything_says_so(robot: Robot) -> None:
    pose = robot.forward_kinematics(robot.home)
    assert Tracker(robot).step(pose).clearance is None
    assert Tracker(robot, collision="ignore").step(pose).clearance is None
    itself = [Tracker(robot, collision="reject"), Tracker(robot, clearance=0.01), Tracker(robot, scene=Scene())]
    assert len({tracker.step(pose).clearance for tracker in itself}) == 1


def test_fingers_stand_as_the_scene_says(robot: Robot) -> None:
    """A ball where closed fingers are, and open ones are not."""
    angle = 1.2  # [rad]
    closed = jacokin.load_robot(finger_angle=angle)
    data = mujoco.MjData(to_mujoco(closed, geometry=True))
    data.qpos[:] = robot.home
    mujoco.mj_kinematics(data.model, data)
    names = [data.model.geom(index).name for index in range(data.model.ngeom)]
    tip = data.geom_xpos[next(index for index, name in enumerate(names) if "tip" in name)]
    ball = Sphere("ball", 0.005, tip)
    pose = robot.forward_kinematics(robot.home)
    for finger_angle, inside in ((None, False), (angle, True)):
        scene = Scene([ball], finger_angle=finger_angle)
        distance = Tracker(robot, scene=scene, clearance=0.0, self_collision=False).measure(pose).clearance
        assert distance is not None
        assert (distance < 0.0) is inside


@pytest.mark.parametrize(
    ("options", "error", "match"),
    [
        ({"pairs": [("link_9", "link_1_ring")]}, UnknownNameError, "unknown shape 'link_9'"),
        ({"pairs": ["link_1_ring"]}, InvalidInputError, "pairs of shape names"),
        ({"pairs": [("link_1_ring", "link_1_column")]}, InvalidInputError, "same link"),
        ({"clearance": "far"}, InvalidInputError, "clearance must be"),
        ({"clearance": -0.01}, InvalidInputError, "clearance must be"),
        ({"clearance": np.nan}, InvalidInputError, "clearance must be"),
        ({"scene": [Floor()]}, InvalidInputError, "scene must be a Scene"),
        ({"scene": Scene([Box("link_1_ring", [0.1] * 3, [5.0] * 3)])}, InvalidInputError, "a shape of the"),
        ({"scene": Scene(), "self_collision": "no"}, InvalidInputError, "self_collision must be True or False"),
        ({"collision": "report"}, UnknownNameError, "Valid: ignore, reject"),
        ({"collision": True}, UnknownNameError, "unknown collision"),
        ({"collision": "ignore", "scene": Scene()}, InvalidInputError, "scene has no effect with collision='ignore'"),
        ({"collision": "ignore", "clearance": 0.0}, InvalidInputError, "clearance has no effect"),
        ({"collision": "ignore", "pairs": []}, InvalidInputError, "pairs has no effect"),
    ],
)
def test_wrong_scenes_are_refused_before_the_first_tick(
    robot: Robot, options: dict[str, Any], error: type[Exception], match: str
) -> None:
    with pytest.raises(error, match=match):
        Tracker(robot, **options)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: Scene(Floor()), "obstacles must be a list"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: Scene(["floor"]), "obstacles must be shapes with a name"),  # type: ignore[list-item]  # wrong on purpose
        (lambda: Scene([Floor(name="")]), "name of an obstacle must be a word"),
        (lambda: Scene([Floor(), Floor(-0.1)]), "'floor' is used by two"),
        (lambda: Sphere("a", 0.0, [0.0] * 3), "a: radius"),
        (lambda: Box("b", [0.1, -0.1, 0.1], [0.0] * 3), "b: size"),
        (lambda: Box("b", [0.1, 0.1], [0.0] * 3), "b: size"),
        (lambda: Box("b", [0.1] * 3, [np.nan] * 3), "b: pose"),
        (lambda: Capsule("c", 0.1, np.inf, [0.0] * 3), "c: length"),
        (lambda: Floor(np.nan), "floor: height"),
        (lambda: Box("b", ["0.1"] * 3, [0.0] * 3), "b: size must be one number or 3"),
        (lambda: Box("b", [True] * 3, [0.0] * 3), "b: size must be one number or 3"),
        (lambda: Box("b", np.array(["2026-01-01"] * 3, "M8[D]"), [0.0] * 3), "b: size must be"),
        (lambda: Box("b", [0.1] * 3, "here"), "b: pose must be a pose or a position"),
        (lambda: Sphere("a", True, [0.0] * 3), "a: radius must be a positive number"),
        (lambda: Sphere("a", "1", [0.0] * 3), "a: radius must be"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: Capsule("c", 0.1, False, [0.0] * 3), "c: length must be a positive number"),
    ],
)
def test_shapes_that_are_none_are_refused(make: Callable[[], object], match: str) -> None:
    with pytest.raises(InvalidInputError, match=match):
        make()


@pytest.mark.slow
def test_the_tracker_sees_true_distances_and_how_they_change(robot: Robot, rng: np.random.Generator) -> None:
    places = rng.normal(size=(3, 3))
    places *= rng.uniform(0.6, 0.9, (3, 1)) / np.linalg.norm(places, axis=1, keepdims=True)
    scene = Scene([Floor(-0.4), *(obstacle(kind, place, rng) for kind, place in enumerate(places))])
    limits = JointLimits(robot, robot.velocity_limit, np.full(robot.dof, np.inf), 0.05)
    guard = make_guard(
        robot, limits, 0.05, scene=scene, clearance=0.03, collision=None, self_collision=True, pairs=None
    )  # with a larger clearance not all pairs count: links of the wrist are 3 cm apart
    assert guard is not None
    kinematics = Kinematics(robot, robot.default_frame, None)
    ticks, nothing = TickSolver(kinematics, limits, 0.05, 1e-5, (1e-4, 1e-3)), TaskFactory(kinematics).nothing
    ticks.among(guard.work)
    referee = Referee(robot, scene)
    steps, compared = 1e-5 * np.eye(robot.dof), 0
    for q in robot.sample(rng, 100):
        now = guard.start(q)
        if (now.distance < 1e-3).any():
            continue
        if now.near.size:
            assert now.distance.min() == pytest.approx(referee.least(q), abs=1e-6)
        around = [[guard.start(q + sign * step).bound[now.near] for step in steps] for sign in (1.0, -1.0)]
        forward, backward = (np.transpose(some) for some in around)
        guard.take(now)
        ticks.linearise(JointState(q, np.zeros(robot.dof)), nothing)
        rows, _ = ticks.inequalities
        slope = np.empty((0, robot.dof)) if rows is None else -rows
        # Where the nearest points jump from corner to corner, the slopes to both sides differ.
        smooth = np.abs(forward + backward - 2.0 * now.distance[:, None]).max(axis=1) < 2e-8
        numeric = (forward - backward) / 2e-5
        np.testing.assert_allclose(slope[smooth], numeric[smooth], atol=2e-3)
        compared += int(smooth.sum())
    assert compared > 20


@pytest.mark.one_quick
@pytest.mark.parametrize("acceleration_limit", [None, np.inf])
@pytest.mark.parametrize("asked", ["poses", "posture", "twist", "priorities"])
def test_distances_that_are_not_measured_do_not_matter(
    robot: Robot, rng: np.random.Generator, asked: str, acceleration_limit: float | None
) -> None:
    """The motion is that of a tracker which measures every pair in every tick, and bounds hold all along."""
    home = robot.forward_kinematics(robot.home)
    places = home.translation + np.array([[0.16, 0.03, 0.08], [-0.2, 0.2, -0.1], [0.1, -0.1, -0.25]])
    scene = Scene([Floor(-0.02), *(obstacle(kind, place, rng) for kind, place in enumerate(places))])
    posture = robot.home + 0.5 if asked == "posture" else None
    ours, every = (
        Tracker(robot, dt=0.01, scene=scene, acceleration_limit=acceleration_limit, posture=posture) for _ in range(2)
    )
    guard, held = every._guard, 0
    assert guard is not None
    guard.work.numbers[CLOSE] = np.inf
    every.reset()
    for tick in range(150):
        x = 0.03 * tick
        way = np.array([0.25 * np.sin(2.0 * x), 0.25 * np.sin(3.0 * x), -0.3 * abs(np.sin(1.5 * x))])
        target = pin.SE3(home.rotation, home.translation + way)
        told = {"box": (places[0] - [0.05 * np.sin(x), 0.0, 0.0], [-0.15 * np.cos(x), 0.0, 0.0, 0.0, 0.0, 0.0])}
        ends = []
        for tracker in (ours, every):
            if asked == "twist":
                ends.append(tracker.step(twist=[*(0.8 * way), 0.0, 0.3 * np.sin(x), 0.0], obstacles=told))
            elif asked == "priorities":
                levels = [PositionTarget(target.translation), PoseTarget(home, priority=1)]
                ends.append(tracker.step(levels, obstacles=told))
            else:
                ends.append(tracker.step(target, obstacles=told))
        np.testing.assert_allclose(ends[0].q, ends[1].q, atol=1e-6)
        assert ends[0].clearance == pytest.approx(ends[1].clearance, abs=1e-6)
        held += any("~" in name for name in ends[0].limiting)
        mine, known = ours._state.distances, every._state.distances
        assert mine is not None
        assert known is not None
        assert (mine.bound <= known.bound + 1e-6)[known.near].all()
        assert len(mine.near) <= len(known.near)
    assert held > 10  # something was in the way
