"""The initializer that places the tool centre point free of collisions."""

from __future__ import annotations

import copy
from collections import Counter
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

import jacokin
from jacokin.errors import EpisodeInitializationError, InvalidInputError, PhysicsError, UnknownNameError
from jacokin.ik import IKSolver
from jacokin.model import MeasuredArm
from jacokin.mujoco_bridge import DOWN_QUATERNION, Arena, JacoArm, JacoHand, Physics
from jacokin.mujoco_bridge.control.initializers import BRANCHES, TcpInitializer, ToolCenterPointInitializer
from jacokin.mujoco_bridge.control.site_ik import canonical
from jacokin.mujoco_bridge.distributions import QuaternionFromAxisAngle, Uniform, UniformQuaternion, uniform_box
from jacokin.mujoco_bridge.entity import rotation_matrix
from jacokin.mujoco_bridge.props import Primitive
from tests.mujoco_bridge.scenes import jaco_parts

BOX = ((-0.2, -0.2, 0.02), (0.2, 0.2, 0.4))  # [m]
REACHED = 1e-6  # [m]


def scene(*walls: tuple[tuple[float, float, float], tuple[float, float, float]]) -> tuple[Physics, JacoArm, JacoHand]:
    """The arm, a free cube near its path, and walls: half-lengths and position each [m]."""
    arena, arm, hand = jaco_parts()
    arena.add_free_entity(Primitive(name="cube"), position=(0.0, 0.0, 0.1))
    for number, (size, position) in enumerate(walls):
        arena.attach(Primitive("box", size, name=f"wall_{number}"), position=position)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    return physics, arm, hand


def robot_contacts(physics: Physics) -> list[tuple[str, str]]:
    """Contacts between the arm and itself, its hand, or what does not move; judged by names."""
    physics.forward()
    found = []
    for contact in physics.data.contact:
        pair = tuple(physics.model.geom(geom).name for geom in (contact.geom1, contact.geom2))
        robot = [name.startswith("jaco_arm/") for name in pair]
        hand = [name.startswith("jaco_arm/jaco_hand/") for name in pair]
        if any(robot) and not all(hand) and not any("cube" in name for name in pair) and contact.dist <= 0.0:
            found.append(pair)
    return found


@pytest.mark.parametrize("kind", [np.random.RandomState, np.random.default_rng])
def test_poses_are_reached_free_of_collisions(kind: Any) -> None:
    physics, arm, hand = scene()
    initializer = TcpInitializer(hand, arm, uniform_box(*BOX))
    rng = kind(0)
    fingers = physics.bind(hand.joints).qpos.copy()
    positions = []
    for _ in range(60):
        initializer(physics, rng)
        site = physics.bind(hand.pinch_site)
        positions.append(site.xpos.copy())
        assert (site.xpos >= np.array(BOX[0]) - REACHED).all()
        assert (site.xpos <= np.array(BOX[1]) + REACHED).all()
        np.testing.assert_allclose(site.xmat.reshape(3, 3)[:, 2], (0.0, 0.0, -1.0), atol=REACHED)
        assert robot_contacts(physics) == []
    assert np.std(positions, axis=0).min() > 0.05
    np.testing.assert_array_equal(physics.bind(hand.joints).qpos, fingers)


def test_other_branches_are_tried_before_another_pose() -> None:
    """One fixed pose with something in the way of the nearest branch: the random state is not asked again."""
    goal = (-0.04, 0.03, 0.4)
    physics, arm, hand = scene()
    assert arm.set_site_to_xpos(physics, np.random.default_rng(0), hand.pinch_site, goal)
    nearest = physics.bind(arm.joints).qpos.copy()
    x, y, z = physics.data.body("jaco_arm/link_4").xpos.tolist()
    walled, arm, hand = scene(((0.02, 0.02, 0.02), (x, y, z)))
    asked = []

    def position(random_state: Any) -> Any:
        asked.append(1)
        return goal

    TcpInitializer(hand, arm, position, branch="nearest")(walled, np.random.default_rng(0))
    assert len(asked) == 1
    np.testing.assert_allclose(walled.bind(hand.pinch_site).xpos, goal, atol=REACHED)
    assert robot_contacts(walled) == []
    assert np.abs(walled.bind(arm.joints).qpos - nearest).max() > 0.1
    TcpInitializer(hand, arm, goal, ignore_collisions=True)(walled, np.random.default_rng(0))


def test_without_a_hand_the_wrist_is_placed() -> None:
    arm, arena = JacoArm(), Arena()
    arena.attach(arm)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    turned = (0.0, 1.0, 0.0, 0.0)
    TcpInitializer(None, arm, (0.3, 0.1, 0.4), turned)(physics, np.random.default_rng(0))
    np.testing.assert_allclose(physics.bind(arm.wrist_site).xpos, (0.3, 0.1, 0.4), atol=REACHED)
    np.testing.assert_allclose(physics.bind(arm.wrist_site).xmat, (1, 0, 0, 0, -1, 0, 0, 0, -1), atol=REACHED)


def test_failure_is_an_error_and_changes_nothing() -> None:
    physics, arm, hand = scene()
    before = physics.get_state().tobytes()
    asked = []

    def position(random_state: Any) -> Any:
        asked.append(random_state)
        return (0.0, 0.0, 3.0)

    with pytest.raises(PhysicsError, match="none of 7 poses"):
        TcpInitializer(hand, arm, position, max_rejection_samples=7)(physics, np.random.default_rng(0))
    assert len(asked) == 7
    with pytest.raises(PhysicsError, match="none of 10 poses"):  # in the floor
        TcpInitializer(hand, arm, (0.0, 0.1, -0.1))(physics, np.random.default_rng(0))
    low = TcpInitializer(hand, arm, (0.0, 0.0, -0.1), branch="nearest_to_random", max_ik_attempts=3)
    with pytest.raises(EpisodeInitializationError, match="none of 10 poses"):  # collides from every start
        low(physics, np.random.default_rng(0))
    assert physics.get_state().tobytes() == before


def test_what_is_nearest_to_a_random_start_is_so_by_the_solver_to_the_last_bit(rng: np.random.Generator) -> None:
    """Whether the target can be reached or not; the initializer looks at the nearest branch alone."""
    physics, arm, hand = scene()
    sites, bounds = arm.site_solver(physics, hand.tool_center_point), arm.sampling_bounds(physics)
    chain = sites.chain()
    solver = IKSolver(chain.robot, collision="ignore")
    reached = 0
    for position in rng.uniform((-0.3, -0.3, 0.02), (0.3, 0.3, 0.6), (200, 3)):  # [m] some of it is out of reach
        target = np.eye(4)
        target[:3, :3] = rotation_matrix(UniformQuaternion()(None, None, rng))
        target[:3, 3] = position - physics.data.xpos[chain.base_body]  # upright
        start = copy.deepcopy(rng).uniform(*bounds)
        result = solver.solve(target, start, closest=False)
        found = list(sites.nearest_to_random(position, target[:3, :3], bounds, rng, 1))
        assert bool(found) == result.success
        for rows, q in found:
            assert (rows == chain.qpos).all()
            np.testing.assert_array_equal(q, canonical(result.q, np.flatnonzero(chain.robot.unlimited).tolist()))
            reached += 1
    assert 20 < reached < 180


def test_bad_arguments() -> None:
    physics, arm, hand = scene()
    for wrong in (
        lambda: TcpInitializer(arm, arm, (0.0, 0.0, 0.3)),  # type: ignore[arg-type]
        lambda: TcpInitializer(hand, hand, (0.0, 0.0, 0.3)),  # type: ignore[arg-type]
        lambda: TcpInitializer(hand, arm, (0.0, 0.0, 0.3), max_ik_attempts=0),
        lambda: TcpInitializer(hand, arm, (0.0, 0.0, 0.3), max_rejection_samples=0),
        lambda: uniform_box((0.0, 0.0, 1.0), (1.0, 1.0, 0.0)),
        lambda: uniform_box((0.0, 0.0), (1.0, 1.0)),
        lambda: TcpInitializer(hand, arm, (0.0, 0.3))(physics, np.random.default_rng(0)),
        lambda: TcpInitializer(hand, arm, (0.0, 0.0, 0.3), lambda r: (0.0,) * 4)(physics, np.random.default_rng(0)),
    ):
        with pytest.raises(InvalidInputError):
            wrong()
    assert DOWN_QUATERNION.shape == (4,)


def elbow_and_wrist(robot: jacokin.Robot, q: Any) -> tuple[bool, ...]:
    """Which way the arm faces its target, the side of the elbow, and the turns of axes 4 and 5."""
    x, y, _ = robot.forward_kinematics(q, "pinchsite").translation
    facing = np.cos(q[0] - np.arctan2(y, x)) > 0.0
    return bool(facing), bool(q[2] > np.pi), bool(np.sin(q[3]) > 0.0), bool(np.sin(q[4]) > 0.0)


def entropy(labels: Any) -> float:
    """Of the frequencies of labels [bit]."""
    counts = np.array(list(Counter(labels).values()))
    shares = counts / counts.sum()
    return float(-(shares * np.log2(shares)).sum())


@pytest.mark.slow
def test_initial_poses_spread_over_the_branches(robot: jacokin.Robot) -> None:
    """In 600 episodes the reference's initializer has 2.27 bits, from random arms; from the last pose, 0.23."""
    physics, arm, hand = scene()
    found = {}
    for branch in BRANCHES:
        initializer = ToolCenterPointInitializer(hand, arm, uniform_box(*BOX), branch=branch)
        rng = np.random.RandomState(0)
        labels = []
        for _ in range(600):
            initializer(physics, rng)
            labels.append(elbow_and_wrist(robot, physics.bind(arm.joints).qpos))
        found[branch] = entropy(labels)
    assert found["random"] > 2.2
    assert found["nearest_to_random"] > 2.2
    assert found["nearest"] < 0.5


def test_each_branch_is_equally_likely(robot: jacokin.Robot) -> None:
    physics, arm, hand = scene()
    goal = (0.05, -0.05, 0.3)
    target = jacokin.pose(np.subtract(goal, (0.0, 0.4, 0.0)), quat_wxyz=DOWN_QUATERNION)
    branches = IKSolver(robot, frame="pinchsite").solve_all(target)
    within = branches.q[branches.within_limits]
    initializer = ToolCenterPointInitializer(hand, arm, goal, ignore_collisions=True)
    rng = np.random.default_rng(0)
    counts: Counter[int] = Counter()
    for _ in range(100 * len(within)):
        initializer(physics, rng)
        distance = np.abs(np.sin((within - physics.bind(arm.joints).qpos) / 2.0)).max(axis=1)
        assert distance.min() < 1e-6
        counts[int(distance.argmin())] += 1
    assert len(counts) == len(within) >= 4
    # Of 100 expected each, 4.5 standard deviations.
    assert min(counts.values()) > 55
    assert max(counts.values()) < 145


@pytest.mark.parametrize("branch", BRANCHES)
def test_a_seed_gives_the_same_configuration(branch: str) -> None:
    physics, arm, hand = scene()
    initializer = ToolCenterPointInitializer(hand, arm, uniform_box(*BOX), branch=branch)
    found = []
    for _ in range(2):
        arm.set_home(physics)
        rng = np.random.RandomState(5)
        for _ in range(5):
            initializer(physics, rng)
        found.append(physics.bind(arm.joints).qpos.copy())
    np.testing.assert_array_equal(found[0], found[1])


def test_positions_and_orientations_are_drawn_as_the_reference_draws_them() -> None:
    physics, arm, hand = scene()
    position, angle = Uniform((-0.1, -0.1, 0.2), (0.1, 0.1, 0.3)), Uniform(3.0, 3.2)
    initializer = ToolCenterPointInitializer(
        hand, arm, position, QuaternionFromAxisAngle((0.0, 1.0, 0.0), angle), ignore_collisions=True
    )
    rng, twin = np.random.RandomState(2), np.random.RandomState(2)
    initializer(physics, rng)
    site = physics.bind(hand.pinch_site)
    np.testing.assert_allclose(site.xpos, position(random_state=twin), atol=REACHED)
    turn = angle(random_state=twin)
    np.testing.assert_allclose(
        site.xmat[[0, 2, 6, 8]], (np.cos(turn), np.sin(turn), -np.sin(turn), np.cos(turn)), atol=1e-5
    )


@pytest.mark.parametrize(
    ("position", "quat_wxyz", "with_hand"),
    [((0.1, 0.2, 0.3), DOWN_QUATERNION, True), ((0.0, -0.1, 0.5), (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0), False)],
)
def test_a_fixed_pose_is_reached(position: Any, quat_wxyz: Any, with_hand: bool) -> None:
    physics, arm, hand = scene()
    ToolCenterPointInitializer(hand if with_hand else None, arm, position, quat_wxyz)(physics, np.random.RandomState(0))
    site = physics.bind(hand.tool_center_point if with_hand else arm.wrist_site)
    expected = np.empty(9)
    mujoco.mju_quat2Mat(expected, np.asarray(quat_wxyz))
    np.testing.assert_allclose(site.xpos, position, atol=REACHED)
    np.testing.assert_allclose(site.xmat, expected, atol=REACHED)


def test_fixed_things_are_in_the_way_and_free_ones_are_not() -> None:
    goal = (0.1, 0.2, 0.3)
    for is_free in (False, True):
        arena, arm, hand = jaco_parts()
        ball, lower, upper = Primitive("sphere", (0.3,), name="ball"), Primitive(name="lower"), Primitive(name="upper")
        (arena.add_free_entity if is_free else arena.attach)(ball, position=goal)
        arena.attach(lower, position=(10.0, 0.0, 0.0))  # these two touch, far from the robot
        arena.add_free_entity(upper, position=(10.0, 0.0, 0.03))
        physics = Physics.from_entity(arena)
        arm.set_home(physics)
        initializer = ToolCenterPointInitializer(hand, arm, goal)
        if is_free:
            initializer(physics, np.random.RandomState(0))
        else:
            with pytest.raises(EpisodeInitializationError, match="none of 10 poses"):
                initializer(physics, np.random.RandomState(0))
            ToolCenterPointInitializer(hand, arm, goal, ignore_collisions=True)(physics, np.random.RandomState(0))
        np.testing.assert_allclose(physics.bind(hand.pinch_site).xpos, goal, atol=REACHED)
        physics.forward()
        pairs = [{physics.model.geom(geom).name for geom in (c.geom1, c.geom2)} for c in physics.data.contact]
        assert any("ball/geom" in pair and any("jaco_hand" in name for name in pair) for pair in pairs)


@pytest.mark.parametrize("with_hand", [False, True])
def test_self_collision_is_rejected(with_hand: bool) -> None:
    """The wrist or the hand would be in the base of the arm."""
    physics, arm, hand = scene()
    tool = hand if with_hand else None
    goal, quat_wxyz = (0.0, 0.5, 0.1), (-np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
    with pytest.raises(EpisodeInitializationError):
        ToolCenterPointInitializer(tool, arm, goal, quat_wxyz)(physics, np.random.RandomState(0))
    ToolCenterPointInitializer(tool, arm, goal, quat_wxyz, True)(physics, np.random.RandomState(0))
    assert robot_contacts(physics)


def test_the_numerical_solver_starts_from_random_configurations() -> None:
    """A robot without a closed form: its last two joints turn about one axis."""

    class Bent(JacoArm):
        def _build(
            self,
            name: str | None = None,
            robot: str = "j2n6s300",
            calibration: str | Path | MeasuredArm | None = None,
            actuation: str = "velocity",
        ) -> None:
            super()._build(name, robot, calibration, actuation)
            self._mjcf_root.body("link_6").pos, self._mjcf_root.body("link_6").quat = (0, 0, 0), (1, 0, 0, 0)

    arm, arena = Bent(), Arena()
    arena.attach(arm)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    assert not arm.site_solver(physics, arm.wrist_site).lists_all
    goal = physics.bind(arm.wrist_site).xpos.copy()
    quat_wxyz = np.empty(4)
    mujoco.mju_mat2Quat(quat_wxyz, physics.bind(arm.wrist_site).xmat)
    found = set()
    for seed in range(6):
        ToolCenterPointInitializer(None, arm, goal, quat_wxyz, True)(physics, np.random.RandomState(seed))
        np.testing.assert_allclose(physics.bind(arm.wrist_site).xpos, goal, atol=REACHED)
        found.add(tuple(np.round(physics.bind(arm.joints).qpos, 3)))
    assert len(found) > 1


def test_unknown_branches_and_samplers_are_refused() -> None:
    _, arm, hand = scene()
    with pytest.raises(UnknownNameError, match="Valid: random, nearest"):
        ToolCenterPointInitializer(hand, arm, (0, 0, 0.3), branch="first")
    with pytest.raises(InvalidInputError, match="position must take"):
        ToolCenterPointInitializer(hand, arm, lambda: (0, 0, 0.3))
    assert TcpInitializer is ToolCenterPointInitializer
