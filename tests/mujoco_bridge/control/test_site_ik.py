"""set_site_to_xpos: any base pose, the nearest branch within the limits, and no change on failure."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

import jacokin
from jacokin import Robot
from jacokin.errors import InvalidInputError, ModelError, PhysicsError, UnknownNameError
from jacokin.ik.closed_form import NearestBranch
from jacokin.model.angles import circular_distance
from jacokin.mujoco_bridge import DOWN_QUATERNION, Arena, JacoArm, JacoHand, Physics, robots
from jacokin.mujoco_bridge.props import Primitive
from tests.mujoco_bridge.scenes import jaco_scene

REACHED = 1e-6  # [m], [rad] the tolerance of a success
TILTED = (0.8, 0.1, -0.5, 0.3)  # wxyz, not yet of norm 1
LIMITED = [1, 2]
FREE = [0, 3, 4, 5]


def scene(
    base: tuple[float, float, float] = robots.ARM_OFFSET,
    base_quat: NDArray[np.float64] | None = None,
    crowded: bool = False,
) -> tuple[Physics, JacoArm, JacoHand]:
    arena = Arena()
    if crowded:
        arena.add_free_entity(Primitive(name="cube"), position=(0.5, 0.5, 0.5))
        other = JacoArm(name="other")
        other.attach(JacoHand())
        arena.attach(other, position=(1.5, 0.0, 0.0))
    physics, _, arm, hand = jaco_scene(arena=arena, position=base, quaternion=base_quat)
    return physics, arm, hand


def unit(quaternion: Any) -> NDArray[np.float64]:
    q = np.array(quaternion, dtype=np.float64)
    return np.asarray(q / np.linalg.norm(q))


def quaternion_of(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(matrix).ravel())
    return quaternion


def reachable_pose(physics: Physics, arm: JacoArm, site: Any, rng: np.random.Generator) -> tuple[Any, Any]:
    """Pose of a site at a random configuration within the limits; the simulation does not change."""
    twin = physics.copy()
    arm.randomize_arm_joints(twin, rng)
    bound = twin.bind(site)
    return bound.xpos.copy(), quaternion_of(bound.xmat)


def assert_reached(physics: Physics, arm: JacoArm, site: Any, position: Any, quaternion: Any) -> None:
    """Checked with kinematics that MuJoCo computes anew."""
    fresh = mujoco.MjData(physics.model)
    fresh.qpos[:] = physics.data.qpos
    fresh.mocap_pos[:], fresh.mocap_quat[:] = physics.data.mocap_pos, physics.data.mocap_quat
    mujoco.mj_kinematics(physics.model, fresh)
    where = fresh.site(site.name)
    assert np.linalg.norm(where.xpos - position) <= REACHED
    turn = np.empty(4)
    rotation = np.empty(3)
    mujoco.mju_negQuat(turn, quaternion_of(where.xmat))
    mujoco.mju_mulQuat(turn, unit(quaternion), turn.copy())
    mujoco.mju_quat2Vel(rotation, turn, 1.0)
    assert np.linalg.norm(rotation) <= REACHED
    np.testing.assert_array_equal(physics.data.site_xpos, fresh.site_xpos)
    np.testing.assert_array_equal(physics.data.xmat, fresh.xmat)
    joints = physics.bind(arm.joints)
    lower, upper = joints.range[LIMITED].T
    assert (joints.qpos[LIMITED] >= lower).all()
    assert (joints.qpos[LIMITED] <= upper).all()
    assert (joints.qpos[FREE] >= 0.0).all()
    assert (joints.qpos[FREE] < 2.0 * np.pi).all()


@pytest.mark.one_quick
@pytest.mark.parametrize("base_quat", [None, unit((0.3, -0.2, 0.9, 0.1))], ids=["upright", "tilted"])
@pytest.mark.parametrize("crowded", [False, True], ids=["alone", "crowded"])
@pytest.mark.parametrize("count", [2, pytest.param(6, marks=pytest.mark.slow)])
def test_every_reachable_pose_is_reached(base_quat: Any, crowded: bool, count: int) -> None:
    physics, arm, hand = scene((0.3, -0.2, 0.1), base_quat, crowded)
    rng = np.random.default_rng(1)
    arm_rows = [int(physics.model.joint(joint.name).qposadr[0]) for joint in arm.joints]
    assert len(np.delete(physics.data.qpos, arm_rows)) == (19 if crowded else 3)  # fingers, cube, another arm and hand
    for site in (hand.pinch_site, hand.grip_site, arm.wrist_site, hand.tool_center_point):
        for _ in range(count):
            position, quaternion = reachable_pose(physics, arm, site, rng)
            physics.data.qvel[:] = rng.uniform(-0.1, 0.1, physics.model.nv)
            physics.data.ctrl[:] = rng.uniform(-0.1, 0.1, physics.model.nu)
            kept = physics.data.qvel.copy(), physics.data.ctrl.copy(), physics.data.time
            before = physics.data.qpos.copy()
            assert arm.set_site_to_xpos(physics, rng, site, position, quaternion)
            assert_reached(physics, arm, site, position, quaternion)
            np.testing.assert_array_equal(physics.data.qvel, kept[0])
            np.testing.assert_array_equal(physics.data.ctrl, kept[1])
            assert physics.data.time == kept[2]
            np.testing.assert_array_equal(np.delete(physics.data.qpos, arm_rows), np.delete(before, arm_rows))


POSES = ("xpos", "xmat", "xipos", "site_xpos", "site_xmat", "geom_xpos", "geom_xmat", "cam_xpos", "light_xpos", "cdof")
EVERYTHING_ELSE = ("cvel", "qfrc_bias", "ncon", "crb", "actuator_length", "actuator_velocity", "qacc", "sensordata")


def moved_scene() -> tuple[Physics, JacoArm, JacoHand, mujoco.MjData, Physics]:
    """A scene whose arm has just been moved, its data kept from before, and a copy after a forward pass."""
    physics, arm, hand = scene(crowded=True)
    physics.data.qvel[:] = 0.1
    physics.data.ctrl[:6] = 0.2
    physics.forward()
    rng = np.random.default_rng(11)
    position, quaternion = reachable_pose(physics, arm, hand.pinch_site, rng)
    held = physics.data
    assert arm.set_site_to_xpos(physics, rng, hand.pinch_site, position, quaternion)
    fresh = physics.copy()
    fresh.forward()
    return physics, arm, hand, held, fresh


def test_poses_and_jacobians_are_fresh_at_once_afterwards_even_in_data_that_were_kept() -> None:
    physics, _, hand, held, fresh = moved_scene()
    for name in POSES:
        np.testing.assert_array_equal(getattr(held, name), getattr(fresh.data, name))
    jacobian, expected = np.empty((2, 6, physics.model.nv))
    for each, data in ((jacobian, held), (expected, fresh.data)):
        mujoco.mj_jacSite(physics.model, data, each[:3], each[3:], physics.model.site(hand.pinch_site.name).id)
    np.testing.assert_array_equal(jacobian, expected)


def test_a_site_that_was_moved_away_from_the_frame_of_its_body_is_reached_at_once() -> None:
    """MuJoCo has a shortcut for a site in its body's place, which must not be taken then."""
    physics, arm, _ = scene()
    site, offset, rng = "jaco_arm/joint_6_site", np.array((0.0, 0.1, 0.1)), np.random.default_rng(12)
    assert physics.model.site(site).sameframe
    twin = physics.copy()
    arm.randomize_arm_joints(twin, rng)
    link = twin.bind(arm.wrist_site.parent)
    position, quaternion = link.xpos + link.xmat.reshape(3, 3) @ offset, link.xquat.copy()
    physics.bind(site).pos = offset
    held = physics.data
    assert arm.set_site_to_xpos(physics, rng, site, position, quaternion)
    np.testing.assert_allclose(held.site(site).xpos, position, rtol=0.0, atol=REACHED)


@pytest.mark.one_quick
@pytest.mark.parametrize("name", EVERYTHING_ELSE)
def test_everything_else_is_fresh_when_it_is_read(name: str) -> None:
    physics, _, _, held, fresh = moved_scene()
    assert physics.data is held
    np.testing.assert_allclose(getattr(held, name), getattr(fresh.data, name), rtol=1e-6, atol=1e-6)


def test_everything_else_is_fresh_in_bindings_observables_and_steps() -> None:
    physics, arm, _, _, fresh = moved_scene()
    bias = physics.bind(arm.joints).qfrc_bias
    np.testing.assert_allclose(bias, fresh.bind(arm.joints).qfrc_bias, rtol=1e-6)
    physics, arm, _, _, fresh = moved_scene()
    np.testing.assert_allclose(arm.observables.joints_torque(physics), arm.observables.joints_torque(fresh), rtol=1e-6)
    physics, _, _, held, fresh = moved_scene()
    physics.step()
    fresh.step()
    assert physics.get_state().tobytes() == fresh.get_state().tobytes()
    np.testing.assert_array_equal(held.sensordata, fresh.data.sensordata)


@pytest.mark.parametrize("count", [200, pytest.param(1000, marks=pytest.mark.slow)])
def test_tool_down_in_the_workspace_of_the_tasks(robot: Robot, count: int) -> None:
    """Everywhere but in the outermost corner, 0.3 % of the box, which no configuration reaches."""
    physics, arm, hand = scene()
    solver = jacokin.IKSolver(robot, frame="pinchsite")
    rng = np.random.RandomState(0)
    missed = 0
    for _ in range(count):
        position = rng.uniform((-0.2, -0.2, 0.02), (0.2, 0.2, 0.4))
        if not arm.set_site_to_xpos(physics, rng, hand.pinch_site, position):
            missed += 1
            target = jacokin.pose(position - robots.ARM_OFFSET, DOWN_QUATERNION)
            assert len(solver.solve_all(target).q_within_limits) == 0
            continue
        assert_reached(physics, arm, hand.pinch_site, position, DOWN_QUATERNION)
        np.testing.assert_allclose(hand.observables.pinch_site_pos(physics), position, rtol=0.0, atol=REACHED)
        down = hand.observables.pinch_site_rmat(physics).reshape(3, 3)
        np.testing.assert_allclose(down @ (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), rtol=0.0, atol=REACHED)
    assert missed <= max(1, 0.003 * count)


def test_the_nearest_branch_within_the_limits_is_taken(robot: Robot) -> None:
    arm = JacoArm()
    physics = Physics.from_entity(arm)
    solver = jacokin.IKSolver(robot, frame="wristsite")
    rng = np.random.default_rng(2)
    several = 0
    for _ in range(40):
        present = robot.sample(rng)
        physics.bind(arm.joints).qpos = present
        target = robot.forward_kinematics(robot.sample(rng), "wristsite")
        assert arm.set_site_to_xpos(physics, rng, arm.wrist_site, target.translation, quaternion_of(target.rotation))
        chosen = physics.bind(arm.joints).qpos
        within = solver.solve_all(target, present).q_within_limits
        several += len(within) > 1
        distances = circular_distance(within, present, robot.unlimited)
        assert circular_distance(chosen, present, robot.unlimited) == pytest.approx(distances.min(), abs=1e-6)
    assert several > 20


def test_failure_changes_nothing_at_all(robot: Robot) -> None:
    physics, arm, hand = scene(crowded=True)
    rng = np.random.default_rng(3)
    physics.step(5)
    physics.data.qpos[:6] += 0.01  # stale: a forward pass would show in the warm start
    before = physics.get_state().tobytes()
    derived = physics.data.xpos.copy()
    draws = rng.bit_generator.state
    assert not arm.set_site_to_xpos(physics, rng, hand.pinch_site, (0.0, 0.4, 2.0))
    beyond = robot.home.copy()
    beyond[1] = robot.lower[1] - 0.4  # joint_2 beyond its limit, and no other branch reaches it
    failures = 0
    solver = jacokin.IKSolver(robot, frame="wristsite")
    for _ in range(200):
        q = robot.sample(rng)
        q[1] = robot.lower[1] - 0.4
        target = robot.forward_kinematics(q, "wristsite")
        if len(solver.solve_all(target).q_within_limits):
            continue
        failures += 1
        draws = rng.bit_generator.state
        position = target.translation + robots.ARM_OFFSET
        assert not arm.set_site_to_xpos(physics, rng, arm.wrist_site, position, quaternion_of(target.rotation))
        if failures == 10:
            break
    assert failures == 10
    assert physics.get_state().tobytes() == before
    np.testing.assert_array_equal(physics.data.xpos, derived)
    assert rng.bit_generator.state == draws  # the closed form needs no randomness


@pytest.mark.parametrize(
    "change",
    [lambda q: q + 2e-6 * np.eye(6)[0], lambda q: q + 2.0 * np.pi * np.eye(6)[1]],
    ids=["off the target", "outside a limit"],
)
def test_what_mujoco_does_not_confirm_is_no_success_and_changes_nothing(
    change: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    physics, arm, hand = scene(crowded=True)
    rng = np.random.default_rng(15)
    physics.step(5)
    physics.forward()
    position, quaternion = reachable_pose(physics, arm, hand.pinch_site, rng)
    nearest = NearestBranch.__call__
    monkeypatch.setattr(NearestBranch, "__call__", lambda branch: change(nearest(branch)))
    held, state = physics.data, physics.get_state().tobytes()
    before = {name: np.array(getattr(held, name)) for name in (*POSES, *EVERYTHING_ELSE)}
    assert not arm.set_site_to_xpos(physics, rng, hand.pinch_site, position, quaternion)
    assert physics.data is held
    assert physics.get_state().tobytes() == state
    for name, value in before.items():
        np.testing.assert_array_equal(getattr(held, name), value)
    monkeypatch.undo()
    assert arm.set_site_to_xpos(physics, rng, hand.pinch_site, position, quaternion)


def test_the_arm_is_unmoved_when_mujoco_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    physics, arm, hand = scene()
    rng = np.random.default_rng(16)
    position, quaternion = reachable_pose(physics, arm, hand.pinch_site, rng)
    before = physics.get_state().tobytes()

    def give_up(*_: Any) -> None:
        raise mujoco.FatalError("mj_stackAlloc: out of memory")

    monkeypatch.setattr(mujoco, "mj_fwdKinematics", give_up)
    with pytest.raises(PhysicsError, match="more memory"):
        arm.set_site_to_xpos(physics, rng, hand.pinch_site, position, quaternion)
    assert physics.get_state().tobytes() == before
    monkeypatch.undo()
    assert arm.set_site_to_xpos(physics, rng, hand.pinch_site, position, quaternion)


def test_base_moved_while_simulating() -> None:
    physics, arm, hand = scene()
    rng = np.random.default_rng(4)
    for _ in range(5):
        arm.set_pose(physics, rng.uniform(-0.3, 0.3, 3), unit(rng.normal(size=4)))
        position, quaternion = reachable_pose(physics, arm, hand.pinch_site, rng)
        assert arm.set_site_to_xpos(physics, rng, hand.pinch_site, position, quaternion)
        assert_reached(physics, arm, hand.pinch_site, position, quaternion)


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", ["mocap", "free"])
def test_base_that_moves_with_the_state(kind: str) -> None:
    arena, arm, hand = Arena(), JacoArm(), JacoHand()
    nail = hand.mjcf_model.body("link_finger_tip_3").add_site(name="nail", pos=(0.03, 0.0, 0.0))
    arm.attach(hand)
    if kind == "free":
        arena.add_free_entity(arm)
    else:
        arena.attach(arm).mocap = True
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    rng = np.random.default_rng(17)
    for _ in range(5):
        arm.set_pose(physics, rng.uniform(-0.3, 0.3, 3), unit(rng.normal(size=4)))
        hand.set_grasp(physics, rng.uniform())
        for site in (hand.pinch_site, nail):
            position, quaternion = reachable_pose(physics, arm, site, rng)
            assert arm.set_site_to_xpos(physics, rng, site, position, quaternion)
            assert_reached(physics, arm, site, position, quaternion)


def test_sites_limits_and_hands_moved_while_simulating() -> None:
    physics, arm, hand = scene()
    rng = np.random.default_rng(14)
    changes: list[Any] = [
        lambda: hand.set_pose(physics, (0.0, 0.02, 0.05)),
        lambda: setattr(physics.bind(hand.pinch_site), "pos", (0.0, 0.0, -0.25)),
        lambda: setattr(physics.bind(arm.joints[1]), "range", (2.0, 4.0)),
    ]
    for change in changes:
        position, quaternion = reachable_pose(physics, arm, hand.pinch_site, rng)
        assert arm.set_site_to_xpos(physics, rng, hand.pinch_site, position, quaternion)
        change()
        for _ in range(5):
            position, quaternion = reachable_pose(physics, arm, hand.pinch_site, rng)
            assert arm.set_site_to_xpos(physics, rng, hand.pinch_site, position, quaternion)
            assert_reached(physics, arm, hand.pinch_site, position, quaternion)
    assert 2.0 <= physics.bind(arm.joints[1]).qpos[0] <= 4.0


def test_site_on_a_finger_moves_with_it() -> None:
    arm, hand = JacoArm(), JacoHand()
    nail = hand.mjcf_model.body("link_finger_tip_1").add_site(name="nail", pos=(0.03, 0.0, 0.0))
    arm.attach(hand)
    physics = Physics.from_entity(arm)
    arm.set_home(physics)
    rng = np.random.default_rng(5)
    for grasp in (0.0, 0.4, 1.0, 0.0):
        hand.set_grasp(physics, grasp)
        position, quaternion = reachable_pose(physics, arm, nail, rng)
        assert arm.set_site_to_xpos(physics, rng, nail, position, quaternion)
        assert_reached(physics, arm, nail, position, quaternion)
        np.testing.assert_allclose(physics.bind(hand.joints).qpos, 0.15 + 1.2 * grasp)


def test_site_halfway_up_the_arm() -> None:
    """Three joints move it: no closed form, and the joints after it stay."""
    physics, arm, _ = scene()
    rng = np.random.default_rng(6)
    site = physics.model.site("jaco_arm/joint_3_site").name
    kept = physics.bind(arm.joints[3:]).qpos.copy()
    element = next(s for s in arm.root.mjcf_model.sites if s.name == site)
    for _ in range(5):
        position, quaternion = reachable_pose(physics, arm, element, rng)
        assert arm.set_site_to_xpos(physics, rng, site, position, quaternion)
        np.testing.assert_allclose(physics.data.site(site).xpos, position, rtol=0.0, atol=REACHED)
        np.testing.assert_array_equal(physics.bind(arm.joints[3:]).qpos, kept)


def test_equal_questions_have_equal_answers() -> None:
    physics, arm, hand = scene()
    rng = np.random.default_rng(7)
    position, quaternion = reachable_pose(physics, arm, hand.pinch_site, rng)
    start = physics.get_state()
    answers = []
    for site, target_quat in (
        (hand.pinch_site, quaternion),
        (hand.pinch_site.name, quaternion),
        (hand.pinch_site, -quaternion),
        (hand.pinch_site, 1.009 * quaternion),
    ):
        physics.set_state(start)
        assert arm.set_site_to_xpos(physics, rng, site, list(position), tuple(target_quat))
        answers.append(physics.bind(arm.joints).qpos.copy())
    np.testing.assert_allclose(answers, np.tile(answers[0], (4, 1)), rtol=0.0, atol=1e-9)


def test_bad_input_changes_nothing() -> None:
    physics, arm, hand = scene()
    rng = np.random.default_rng(8)
    other = JacoArm(name="elsewhere")
    before = physics.get_state().tobytes()
    good: dict[str, Any] = {"random_state": rng, "site": hand.pinch_site, "target_pos": (0.0, 0.0, 0.3)}
    for error, message, change in (
        (InvalidInputError, "Sites:.*jaco_arm/jaco_hand/pinchsite", {"site": 3}),
        (InvalidInputError, "Sites:", {"site": None}),
        (InvalidInputError, "site must be", {"site": arm.joints[0]}),
        (UnknownNameError, "unknown site 'pinchsite'.*jaco_arm/jaco_hand/pinchsite", {"site": "pinchsite"}),
        (InvalidInputError, "not part of this physics", {"site": other.wrist_site}),
        (InvalidInputError, r"target_pos must have shape \(3,\)", {"target_pos": (0.0, 0.0)}),
        (InvalidInputError, "target_pos must be finite", {"target_pos": (0.0, np.nan, 0.0)}),
        (InvalidInputError, "target_pos must be 3 numbers", {"target_pos": "here"}),
        (InvalidInputError, "norm 0", {"target_quat": (0.0, 0.0, 0.0, 0.0)}),
        (InvalidInputError, "norm 1.0", {"target_quat": (1.02, 0.0, 0.0, 0.0)}),
        (InvalidInputError, "target_quat", {"target_quat": (1.0, 0.0, 0.0)}),
        (InvalidInputError, "target_quat", {"target_quat": (np.inf, 0.0, 0.0, 0.0)}),
        (InvalidInputError, "max_ik_attempts", {"max_ik_attempts": 0}),
        (InvalidInputError, "max_ik_attempts", {"max_ik_attempts": -3}),
        (InvalidInputError, "max_ik_attempts", {"max_ik_attempts": 1.5}),
        (InvalidInputError, "random_state", {"random_state": 0}),
    ):
        with pytest.raises(error, match=message):
            arm.set_site_to_xpos(physics, **{**good, **change})
    assert physics.get_state().tobytes() == before
    with pytest.raises(ValueError, match="site must be"):
        arm.set_site_to_xpos(physics, rng, object(), (0.0, 0.0, 0.3))


@pytest.mark.parametrize("field", ["qpos", "qvel"])
@pytest.mark.parametrize("is_known", [False, True])
def test_a_scene_that_is_not_finite_is_refused(field: str, is_known: bool) -> None:
    arm, arena = JacoArm(), Arena()
    arena.attach(arm)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    rng = np.random.default_rng(1)
    if is_known:
        arm.set_site_to_xpos(physics, rng, arm.wrist_site, [0.4, 0.0, 0.5])
    getattr(physics.bind(arm.joints), field)[2] = np.nan
    before = physics.get_state()
    with pytest.raises(PhysicsError, match=f"not finite in {field}"):
        arm.set_site_to_xpos(physics, rng, arm.wrist_site, [0.4, 0.0, 0.5])
    assert physics.get_state().tobytes() == before.tobytes()
    physics.reset()
    arm.set_home(physics)
    assert arm.set_site_to_xpos(physics, rng, arm.wrist_site, [0.4, 0.0, 0.5])


@pytest.mark.slow
def test_a_scene_without_memory_for_its_contacts_is_refused_when_they_are_computed() -> None:
    refused = 0
    for memory in (250_000, 300_000, 400_000):  # [bytes] enough for the scene as it is compiled
        arm, arena = JacoArm(), Arena()
        arena.attach(arm)
        cubes = [Primitive("box", name=f"cube_{i}") for i in range(40)]
        for number, cube in enumerate(cubes):
            arena.add_free_entity(cube, position=(1.0 + number, 0.0, 0.5))
        arena.mjcf_model.memory = memory
        physics = Physics.from_entity(arena)
        arm.set_home(physics)
        for number, cube in enumerate(cubes):  # side by side in the floor
            cube.set_pose(physics, (0.6 + 0.05 * (number % 8), 0.05 * (number // 8), 0.019))
        assert arm.set_site_to_xpos(physics, np.random.default_rng(0), arm.wrist_site, (0.4, 0.0, 0.5))
        state = physics.get_state()
        try:
            assert physics.data.ncon
        except PhysicsError:
            refused += 1
            assert physics.get_state().tobytes() == state.tobytes()
            with pytest.raises(PhysicsError):  # not only the first time
                _ = physics.data
            with pytest.raises(PhysicsError):
                physics.step()
            physics.reset()
            assert physics.data.ncon
    assert refused


def test_a_site_that_the_arm_does_not_move() -> None:
    arm, cube, arena = JacoArm(), Primitive(name="cube"), Arena()
    site = cube.mjcf_model.worldbody.add_site(name="top")
    arena.attach(arm)
    arena.attach(cube, position=(0.5, 0.0, 0.0))
    physics = Physics.from_entity(arena)
    with pytest.raises(ModelError, match="none of the arm's joints moves site 'cube/top'"):
        arm.set_site_to_xpos(physics, np.random.default_rng(0), site, (0.0, 0.0, 0.3))


def test_a_prepared_arm_has_its_solver(rng: np.random.Generator) -> None:
    physics, arm, hand = scene()
    arm.set_home(physics)
    before = physics.data.qpos.copy()
    arm.prepare(physics)
    arm.prepare(physics, hand.tool_center_point)
    solver = arm.site_solver(physics, hand.tool_center_point)
    assert arm.site_solver(physics, hand.tool_center_point) is solver
    np.testing.assert_array_equal(physics.data.qpos, before)
    with pytest.raises(UnknownNameError):
        arm.prepare(physics, "no such site")
