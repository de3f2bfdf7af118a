"""`plan_place`: what a pick left in the hand is put down, refereed by MuJoCo; on six, five and seven joints."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver, Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, JacokinError, UnknownNameError
from jacokin.ik import Box, Scene
from jacokin.model import Gripper
from jacokin.model.mujoco_twin import shapes_of_links
from jacokin.motion import Pick, PutDown, grasps, plan_motion, plan_pick, plan_place
from tests.gripper_arms import load
from tests.motion.contact_by_mujoco import Referee

TABLE = Box("table", [0.6, 1.2, 0.05], [0.5, 0.0, -0.025])
CUP = Box("cup", [0.06, 0.08, 0.12], jacokin.pose([0.45, 0.2, 0.06], rpy=[0.0, 0.0, 0.4]))
CRATE = Box("crate", [0.2, 0.1, 0.12], [0.45, 0.0, 0.06])
SCENE = Scene([TABLE, CUP, CRATE])
THERE = jacokin.pose([0.42, -0.25, 0.06], rpy=[0.0, 0.0, 0.4])
VERTICAL = np.array([0.0, 0.0, 1.0])
ANY_YAW = FreeAxis(THERE, axis=VERTICAL)


class Held(NamedTuple):
    """An arm that has picked something up."""

    solver: IKSolver
    pick: Pick

    @property
    def lifted(self) -> Array:
        """(dof,) after the lift [rad]."""
        assert self.pick.lift is not None
        return np.asarray(self.pick.lift.q[-1])


@pytest.fixture(scope="module")
def cup(robot: Robot) -> Held:
    """The cup, which stood on its table, in the hand of a Jaco."""
    solver = IKSolver(robot, scene=SCENE)
    pick = plan_pick(solver, robot.home, grasps.box(CUP.size, CUP.pose), obstacle="cup", time_limit=20.0)
    assert pick.success, pick.message
    return Held(solver, pick)


def pose_of_object(robot: Robot, held: Scene, q: Array) -> pin.SE3:
    """T_base_object of what is held, by forward kinematics."""
    shape = held.attached[0].shape
    assert isinstance(shape, Box)
    return robot.forward_kinematics(q, frame=held.attached[0].to) * shape.pose


def check_place(robot: Robot, start: Array, pick: Pick, place: PutDown, supports: set[str], distance: float) -> None:
    """Where each part leads, and that nothing touches on it but the object what it stood on and is put on."""
    assert place.success, place.message
    assert place.lower is not None
    assert place.bring is not None
    assert place.retreat is not None
    assert place.pose is not None
    assert place.scene is not None
    assert pick.held is not None
    name = pick.held.attached[0].name
    # One part begins where the one before ends.
    np.testing.assert_array_equal(place.carry.q[0], start)
    np.testing.assert_allclose(place.lower.q[0], place.carry.q[-1], atol=1e-9)
    np.testing.assert_array_equal(place.bring.q[-1], place.lower.q[-1])
    np.testing.assert_allclose(place.retreat.q[0], place.lower.q[-1], atol=1e-9)
    assert place.bring.duration == pytest.approx(place.carry.duration + place.lower.duration)
    # The object comes straight down, turned as it is.
    at = [pose_of_object(robot, pick.held, q) for q in place.lower.q]
    np.testing.assert_allclose([each.translation[:2] for each in at], [at[-1].translation[:2]] * len(at), atol=1e-5)
    np.testing.assert_allclose([each.rotation for each in at], [at[-1].rotation] * len(at), atol=1e-4)
    assert (np.diff([each.translation[2] for each in at]) < 1e-9).all()
    np.testing.assert_allclose(at[-1].homogeneous, place.pose.homogeneous, atol=1e-9)
    # The hand goes straight back against the axis along which it came.
    tool = [robot.forward_kinematics(q) for q in place.retreat.q[[0, -1]]]
    ahead = pick.grasp.gripper.pads.rotation[:, 2] if pick.grasp is not None and pick.grasp.gripper else VERTICAL
    np.testing.assert_allclose(tool[0].actInv(tool[1].translation), -distance * ahead, atol=1e-5)
    # The object stands there, and is no longer held.
    assert not place.scene.attached
    stands = {each.name: each for each in place.scene.obstacles}[name]
    assert isinstance(stands, Box)
    assert isinstance(stands.pose, pin.SE3)
    np.testing.assert_allclose(stands.pose.homogeneous, place.pose.homogeneous, atol=1e-12)
    assert place.opening == place.scene.finger_angle == pick.opening
    # Contact, on every part.
    holding, alone = Referee(robot, pick.held, opening=shut_on(robot, place)), Referee(robot, place.scene)
    assert holding.contacts(place.carry.q) == {}
    assert holding.contacts(place.lower.q[::-1]) == {}
    bottom = dict(zip(holding.pairs, holding.distances(place.lower.q[-1:])[0], strict=True))
    touching = {pair for pair, far in bottom.items() if far <= 1e-6}
    assert all(name in pair and not supports.isdisjoint(pair) for pair in touching), touching
    hand = shapes_of_links(robot).get("hand", frozenset())  # of a Jaco, whose fingers bend around the object
    apart = [pair for pair in alone.pairs if name in pair and not hand.isdisjoint(pair)]
    meets = alone.contacts(place.retreat.q)
    assert {pair for pair in meets if pair not in apart} == set()
    for rows in (place.carry.q, place.lower.q):
        assert np.min(robot.clearance(rows, Scene(finger_angle=place.opening), self_collision=True)) > 0.0
    assert np.min(robot.clearance(place.retreat.q[-1], place.scene, self_collision=True)) > 0.0
    # As the fingers open.
    for opening in np.linspace(shut_on(robot, place), place.scene.finger_angle or 0.0, 25):
        fingers = Referee(robot, place.scene, opening=float(opening))
        near = dict(zip(fingers.pairs, fingers.distances(place.lower.q[-1:])[0], strict=True))
        assert {pair for pair, far in near.items() if far <= 0.0} == set()


def shut_on(robot: Robot, place: PutDown) -> float:
    """The opening [rad], or [m], from which on the fingers touch the object that stands at its place."""
    assert place.lower is not None
    assert place.scene is not None
    assert place.opening is not None
    free = place.opening
    for opening in np.linspace(free, Gripper.of(robot).openings[0], 81)[1:].tolist():
        fingers = Referee(robot, place.scene, opening=opening)
        near = dict(zip(fingers.pairs, fingers.distances(place.lower.q[-1:])[0], strict=True))
        if min(far for pair, far in near.items() if place.scene.names[-1] in pair) <= 0.0:
            break
        free = opening
    return free


@pytest.mark.one_quick
@pytest.mark.parametrize("target", [THERE, ANY_YAW], ids=["pose", "any yaw"])
def test_a_cup_is_put_down(robot: Robot, cup: Held, target: pin.SE3 | FreeAxis) -> None:
    place = plan_place(cup.solver, cup.lifted, cup.pick, target, time_limit=20.0)
    check_place(robot, cup.lifted, cup.pick, place, {"table"}, 0.1)
    assert place.pose is not None
    assert place.target == 0
    np.testing.assert_allclose(place.pose.translation, THERE.translation, atol=1e-6)
    if isinstance(target, pin.SE3):
        np.testing.assert_allclose(place.pose.rotation, target.rotation, atol=1e-6)
    np.testing.assert_allclose(place.pose.rotation[:, 2], VERTICAL, atol=1e-6)
    assert place.kinova_fingers == cup.pick.kinova_fingers
    assert len(repr(place)) < 600
    # What comes next goes on without the cup.
    assert place.retreat is not None
    home = plan_motion(cup.solver.in_scene(place.scene), place.retreat.q[-1], robot.home, time_limit=20.0)
    assert home.success, home.message


@pytest.mark.slow
def test_a_start_on_the_table_is_left(robot: Robot, cup: Held) -> None:
    assert cup.pick.reach is not None
    start = cup.pick.reach.q[-1]
    place = plan_place(cup.solver, start, cup.pick, ANY_YAW, time_limit=20.0)
    check_place(robot, start, cup.pick, place, {"table"}, 0.1)
    assert "table and cup touch at the start and come apart first" in place.message


@pytest.mark.slow
def test_a_clearance_that_the_table_does_not_have(robot: Robot, cup: Held) -> None:
    """It is kept from everything but what the cup is put on, also on the line down."""
    solver = IKSolver(robot, scene=SCENE, clearance=0.005)
    place = plan_place(solver, cup.lifted, cup.pick, ANY_YAW, time_limit=20.0)
    check_place(robot, cup.lifted, cup.pick, place, {"table"}, 0.1)
    assert place.lower is not None
    assert cup.pick.held is not None
    others = cup.pick.held.allowing(("table", "cup"))
    assert np.min(robot.clearance(place.lower.q, others, self_collision=True)) > 0.005


def test_any_of_several_targets_will_do(cup: Held) -> None:
    far = jacokin.pose([1.5, 0.0, 0.06])
    place = plan_place(cup.solver, cup.lifted, cup.pick, [far, ANY_YAW], height=0.05, distance=0.07, time_limit=20.0)
    assert place.success, place.message
    assert place.target == 1
    assert place.lower is not None
    assert place.retreat is not None
    tool = [cup.solver.robot.forward_kinematics(q) for q in place.lower.q[[0, -1]]]
    assert tool[0].translation[2] - tool[1].translation[2] == pytest.approx(0.05, abs=1e-6)


@pytest.mark.slow
def test_a_scene_in_which_it_is_held_will_do(robot: Robot, cup: Held) -> None:
    """As after another motion, or of one's own: the gripper is that of the arm."""
    assert cup.pick.held is not None
    first = plan_place(cup.solver, cup.lifted, cup.pick, ANY_YAW, time_limit=20.0)
    place = plan_place(cup.solver, cup.lifted, cup.pick.held, ANY_YAW, obstacle="cup", time_limit=20.0)
    assert place.success, place.message
    assert place.lower is not None
    assert first.lower is not None
    np.testing.assert_array_equal(place.lower.q, first.lower.q)
    assert place.opening == cup.pick.opening


def test_on_top_of_something(robot: Robot, cup: Held) -> None:
    """A slab that reaches to the crate: the cup is put on both."""
    slab = Box("slab", [0.2, 0.1, 0.12], [0.45, -0.1, 0.06])
    assert cup.pick.held is not None
    held = cup.pick.held.adding(slab)
    on = FreeAxis(jacokin.pose([0.45, -0.05, 0.18]), axis=VERTICAL)
    place = plan_place(cup.solver, cup.lifted, held, on, time_limit=20.0)
    assert place.success, place.message
    assert place.lower is not None
    assert place.carry.q.shape[1] == robot.dof
    referee = Referee(robot, held)
    assert referee.contacts(place.carry.q) == {}
    assert referee.contacts(place.lower.q[::-1]) == {}


@pytest.mark.slow
def test_five_joints(tmp_path: Path) -> None:
    robot = load("so101", tmp_path)
    cube = Box("cube", [0.02, 0.02, 0.04], [0.2, 0.05, 0.02])
    scene = Scene([Box("table", [0.3, 0.6, 0.02], [0.25, 0.0, -0.01]), cube])
    solver = IKSolver(robot, scene=scene, orientation_tolerance=1e-5)
    ways = grasps.box(cube.size, cube.pose, gripper=Gripper.of(robot))
    pick = plan_pick(solver, robot.home, ways, obstacle="cube", distance=0.04, lift=0.04, time_limit=20.0)
    assert pick.success, pick.message
    assert pick.lift is not None
    there = FreeAxis(jacokin.pose([0.2, -0.06, 0.02]), axis=VERTICAL)
    place = plan_place(solver, pick.lift.q[-1], pick, there, height=0.04, distance=0.04, time_limit=20.0)
    check_place(robot, pick.lift.q[-1], pick, place, {"table"}, 0.04)
    assert place.pose is not None
    np.testing.assert_allclose(place.pose.translation, [0.2, -0.06, 0.02], atol=1e-6)
    np.testing.assert_allclose(place.pose.rotation[:, 2], VERTICAL, atol=2e-5)
    # A yaw that the arm has nowhere there is not met.
    yawed = jacokin.pose([0.2, -0.06, 0.02], rpy=[0.4, 0.3, 1.0])
    place = plan_place(solver, pick.lift.q[-1], pick, yawed, height=0.04, distance=0.04, time_limit=5.0)
    assert not place.success
    assert place.carry.outcome == "UNREACHABLE"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["j2s7s300", "panda"])
def test_seven_joints(name: str, tmp_path: Path) -> None:
    robot = load(name, tmp_path) if name == "panda" else jacokin.load_robot(name)
    size = [0.03, 0.03, 0.06] if name == "panda" else [0.06, 0.06, 0.12]
    box = Box("box", size, [0.45, 0.1, 0.5 * size[2]])
    solver = IKSolver(robot, scene=Scene([TABLE, box]))
    ways = grasps.box(box.size, box.pose, gripper=Gripper.of(robot))
    pick = plan_pick(solver, robot.home, ways, obstacle="box", time_limit=20.0)
    assert pick.success, pick.message
    assert pick.lift is not None
    there = FreeAxis(jacokin.pose([0.45, -0.2, 0.5 * size[2]]), axis=VERTICAL, range=(-1.0, 1.0))
    place = plan_place(solver, pick.lift.q[-1], pick, there, time_limit=20.0)
    check_place(robot, pick.lift.q[-1], pick, place, {"table"}, 0.1)


def test_why_there_is_no_way(robot: Robot, cup: Held) -> None:
    def place(target: pin.SE3, height: float = 0.1, distance: float = 0.1) -> PutDown:
        found = plan_place(cup.solver, cup.lifted, cup.pick, target, height=height, distance=distance, time_limit=5.0)
        assert not found.success
        assert found.lower is None
        assert found.bring is None
        assert found.retreat is None
        assert found.pose is None
        assert found.scene is None
        assert "no way" in repr(found)
        np.testing.assert_array_equal(found.carry.q[0], cup.lifted)
        return found

    far = place(jacokin.pose([1.5, 0.0, 0.06]))
    assert "cup cannot be put down: " in far.message
    assert far.carry.outcome == "UNREACHABLE"
    sunk = place(pin.SE3(THERE.rotation, THERE.translation - [0.0, 0.0, 0.02]))
    assert sunk.carry.outcome == "GOAL_IN_CONTACT"
    assert "table and cup would overlap by 0.02 m, more than 0.01 m" in sunk.message
    assert "try a smaller distance" in place(THERE, distance=0.6).message
    assert "try a smaller height" in place(THERE, height=0.9).message


@pytest.mark.slow
def test_fingers_that_would_touch_the_table(robot: Robot) -> None:
    """Around a small box the fingers reach down to the table, though not where they are open."""
    box = Box("box", [0.03, 0.03, 0.06], [0.45, 0.1, 0.03])
    solver = IKSolver(robot, scene=Scene([TABLE, box]))
    pick = plan_pick(solver, robot.home, grasps.box(box.size, box.pose), obstacle="box", time_limit=20.0)
    assert pick.success, pick.message
    assert pick.lift is not None
    assert pick.reach is not None
    assert pick.opening is not None
    there = FreeAxis(jacokin.pose([0.45, -0.1, 0.03]), axis=VERTICAL)
    place = plan_place(solver, pick.lift.q[-1], pick, there, time_limit=20.0)
    assert not place.success
    assert "table and link_finger" in place.message
    touched = set()
    for opening in np.linspace(pick.opening, Gripper.of(robot).openings[0], 25):
        fingers = Referee(robot, solver.verifier.options.scene or Scene(), opening=float(opening))
        near = dict(zip(fingers.pairs, fingers.distances(pick.reach.q[-1:])[0], strict=True))
        met = {pair[0] for pair, far in near.items() if far <= 0.0}
        touched |= met - {"box"}
        if "box" in met:
            break
    assert touched == {"table"}


@pytest.mark.slow
def test_the_time_is_held(cup: Held) -> None:
    plan_place(cup.solver, cup.lifted, cup.pick, ANY_YAW)  # what is made once
    begun = time.monotonic()
    place = plan_place(cup.solver, cup.lifted, cup.pick, [ANY_YAW] * 200, time_limit=0.2)
    assert time.monotonic() - begun < 5.0
    assert place.success or "time" in place.message
    assert "time" in plan_place(cup.solver, cup.lifted, cup.pick, ANY_YAW, time_limit=1e-6).message


def test_mistakes(robot: Robot, cup: Held, tmp_path: Path) -> None:
    held = cup.pick.held
    assert held is not None

    def refused(match: str, kind: type[JacokinError] = InvalidInputError, **options: object) -> None:
        given: dict[str, Any] = {"solver": cup.solver, "start": cup.lifted, "held": cup.pick, "target": THERE} | options
        with pytest.raises(kind, match=match):
            plan_place(**given)

    refused("held must be a Scene", held="cup")
    refused("holds nothing", held=SCENE)
    failed = plan_pick(cup.solver, robot.home, grasps.box(CUP.size, [1.5, 0.0, 0.1]), obstacle="cup")
    refused("held is a pick that holds nothing", held=failed)
    refused("unknown held object 'mug'. Valid: cup", UnknownNameError, obstacle="mug")
    refused("the arm holds cup, mug: say which", held=held.attach(Box("mug", [0.1, 0.1, 0.1], [0, 0, 0.1])))
    refused("mug is held by 'link_2', which does not move with 'end_effector'", obstacle="mug",
            held=held.attach(Box("mug", [0.1, 0.1, 0.1], [0, 0, 0.1]), to="link_2"))  # fmt: skip
    refused("target is empty", target=[])
    refused("target must be a pin.SE3", target=[0.4, 0.1, 0.1])
    refused("height must be", height=0.0)
    refused("distance must be", distance=-0.1)
    refused("speed must be", speed=np.nan)
    refused("time_limit must be", time_limit=0.0)
    refused("gripper must be a Gripper", gripper="hand")
    other = Gripper.of(load("panda", tmp_path))
    refused("the gripper poses the frame 'hand_tcp', but the solver poses 'end_effector'", gripper=other)
    refused("unknown link 'palm'", UnknownNameError, hand="palm")
    refused("start must", start=[0.0])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_in_clutter(robot: Robot, seed: int) -> None:
    """Boxes of any size and place around; the cup is put on the table or on one of them."""
    rng = np.random.default_rng(seed)
    spot = np.array([[0.42, 0.25], [0.42, -0.25]]) + rng.uniform(-0.06, 0.06, (2, 2))
    size, boxes = rng.uniform([0.04, 0.04, 0.07], [0.07, 0.07, 0.14]), list[Box]()
    while len(boxes) < 6:
        edges, at = rng.uniform(0.04, 0.25, 3), rng.uniform([0.2, -0.5], [0.65, 0.5])
        if np.linalg.norm(spot - at, axis=1).min() > 0.5 * np.linalg.norm(edges[:2]) + 0.06:
            pose = jacokin.pose([*at, 0.5 * edges[2]], rpy=[0.0, 0.0, rng.uniform(-3.0, 3.0)])
            boxes.append(Box(f"box_{len(boxes)}", edges, pose))
    high = rng.choice([0.0, 0.06])
    if high:
        boxes.append(Box("plinth", [0.1, 0.1, high], [*spot[1], 0.5 * high]))
    thing = Box("thing", size, jacokin.pose([*spot[0], 0.5 * size[2]], rpy=[0.0, 0.0, rng.uniform(-3.0, 3.0)]))
    solver = IKSolver(robot, scene=Scene([TABLE, thing, *boxes]))
    pick = plan_pick(solver, robot.home, grasps.box(size, thing.pose), obstacle="thing", time_limit=10.0)
    assert pick.success, pick.message
    assert pick.lift is not None
    there = FreeAxis(jacokin.pose([*spot[1], 0.5 * size[2] + high]), axis=VERTICAL)
    place = plan_place(solver, pick.lift.q[-1], pick, there, time_limit=10.0)
    check_place(robot, pick.lift.q[-1], pick, place, {"table", "plinth"}, 0.1)
