"""Entities: names, attaching in any order, detaching, poses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest

from jacokin.errors import InvalidInputError, ModelError, UnknownNameError
from jacokin.mujoco_bridge import Arena, JacoArm, JacoHand, ModelWrapperEntity, Physics
from jacokin.mujoco_bridge.props import Primitive

EXACT = 1e-12
QUARTER_TURN = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))  # about z, wxyz


def names(entity: JacoArm | JacoHand) -> list[str]:
    return [joint.name for joint in entity.joints]


def build(order: str, **arm_options: Any) -> tuple[Arena, JacoArm, JacoHand]:
    arena, arm, hand = Arena(), JacoArm(**arm_options), JacoHand()
    if order == "hand first":
        arm.attach(hand)
        arena.attach(arm, position=(0.0, 0.4, 0.0))
    else:
        arena.attach(arm, position=(0.0, 0.4, 0.0))
        arm.attach(hand)
    return arena, arm, hand


@pytest.mark.parametrize("order", ["hand first", "arm first"])
def test_both_orders_give_the_same_scene(order: str) -> None:
    arena, arm, hand = build(order)
    assert names(arm) == [f"jaco_arm/joint_{i}" for i in range(1, 7)]
    assert [a.name for a in arm.actuators] == names(arm)
    assert [s.name for s in arm.joint_torque_sensors] == [f"jaco_arm/joint_{i}_torque" for i in range(1, 7)]
    assert [s.objname for s in arm.joint_torque_sensors] == [f"jaco_arm/joint_{i}_site" for i in range(1, 7)]
    assert names(hand) == [f"jaco_arm/jaco_hand/finger_{i}" for i in (1, 2, 3)]
    assert hand.pinch_site.name == "jaco_arm/jaco_hand/pinchsite"
    assert (arena.prefix, arm.prefix, hand.prefix) == ("", "jaco_arm/", "jaco_arm/jaco_hand/")
    assert (hand.parent, arm.parent, arena.parent) == (arm, arena, None)
    assert hand.root is arena
    assert list(arena.iter_entities()) == [arena, arm, hand]
    assert list(arena.iter_entities(exclude_self=True)) == [arm, hand]

    physics = Physics.from_entity(arena)
    reference = Physics.from_entity(build("hand first")[0])
    assert (physics.model.nq, physics.model.nu, physics.model.nsensor) == (9, 9, 6)
    for field in ("body_pos", "body_quat", "body_mass", "jnt_range", "site_pos", "actuator_ctrlrange"):
        np.testing.assert_array_equal(getattr(physics.model, field), getattr(reference.model, field))
    np.testing.assert_allclose(physics.bind(arm.root_body).xpos, (0.0, 0.4, 0.0), atol=EXACT)
    arm.set_home(physics)
    assert physics.data.ncon == 0


def test_names_before_attaching_and_with_other_names() -> None:
    arm, hand = JacoArm(name="left"), JacoHand("gripper")
    assert names(arm) == [f"joint_{i}" for i in range(1, 7)]
    assert [a.name for a in arm.actuators] == [f"joint_{i}" for i in range(1, 7)]
    assert (arm.name, arm.prefix) == ("left", "")
    arm.attach(hand)
    assert hand.pinch_site.name == "gripper/pinchsite"
    Arena("room").attach(arm)
    assert hand.pinch_site.name == "left/gripper/pinchsite"
    assert names(arm)[0] == "left/joint_1"


def test_two_arms_in_one_arena() -> None:
    arena = Arena()
    arms = [JacoArm(name=name) for name in ("left", "right")]
    for arm, x in zip(arms, (-0.5, 0.5), strict=True):
        arena.attach(arm, position=(x, 0.0, 0.0))
        arm.attach(JacoHand())
    physics = Physics.from_entity(arena)
    for arm in arms:
        arm.set_home(physics)
    left, right = (physics.bind(arm.wrist_site).xpos for arm in arms)
    np.testing.assert_allclose(right - left, (1.0, 0.0, 0.0), atol=EXACT)
    arena_of_twins = Arena()
    arena_of_twins.attach(JacoArm(name="left"))
    with pytest.raises(InvalidInputError, match=r"'left' is attached here already.*name="):
        arena_of_twins.attach(JacoArm(name="left"))


def test_the_frame_returned_places_the_entity() -> None:
    arena, arm, cube = Arena(), JacoArm(), Primitive()
    frame = arena.attach(arm)
    frame.pos = (0.1, 0.2, 0.3)
    frame.quat = QUARTER_TURN
    held = arena.attach_offset(cube, (0.0, 0.0, 0.5))
    slide = held.add_joint(name="rail", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(1.0, 0.0, 0.0))
    assert frame is arm.root_body
    assert frame.name == "jaco_arm/"
    physics = Physics.from_entity(arena)
    np.testing.assert_allclose(physics.bind(frame).xpos, (0.1, 0.2, 0.3), atol=EXACT)
    np.testing.assert_allclose(physics.bind(frame).xquat, QUARTER_TURN, atol=EXACT)
    physics.bind(slide).qpos = 0.25
    np.testing.assert_allclose(physics.bind(cube.geom).xpos, (0.25, 0.0, 0.5), atol=EXACT)


def test_position_and_quaternion_are_in_the_frame_of_the_site() -> None:
    arm, tool = JacoArm(), Primitive("cylinder", (0.01, 0.05))
    arm.attach(tool, position=(0.0, 0.1, 0.2), quaternion=QUARTER_TURN)
    physics = Physics.from_entity(arm)
    arm.set_home(physics)
    wrist, held = physics.bind(arm.wrist_site), physics.bind(tool.root_body)
    axes = wrist.xmat.reshape(3, 3)
    np.testing.assert_allclose(held.xpos, wrist.xpos + axes @ (0.0, 0.1, 0.2), atol=EXACT)
    np.testing.assert_allclose(held.xmat.reshape(3, 3)[:, 0], axes[:, 1], atol=EXACT)


def test_sites_in_frames_with_any_orientation() -> None:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="wall", pos=(0.0, 0.0, 1.0))
    shelf = body.add_frame(pos=(0.0, 1.0, 0.0))
    site = body.add_site(name="hook", pos=(0.5, 0.0, 0.0))
    site.set_frame(shelf)
    site.alt.type = mujoco.mjtOrientation.mjORIENTATION_EULER
    site.alt.euler = (0.0, 90.0, 0.0)  # degrees, as the spec's compiler says
    wall, cube = ModelWrapperEntity(spec, name="wall"), Primitive()
    wall.attach(cube, site, position=(0.0, 0.0, 0.1))
    physics = Physics.from_entity(wall)
    np.testing.assert_allclose(physics.bind(cube.root_body).xpos, (0.6, 1.0, 1.0), atol=EXACT)
    np.testing.assert_allclose(physics.bind(cube.root_body).xmat, physics.bind(site).xmat, atol=EXACT)


def test_the_arenas_options_and_bounds_apply() -> None:
    arena, arm, _ = build("arm first")
    model = Physics.from_entity(arena).model
    assert model.opt.timestep == 0.002
    assert model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert (model.opt.impratio, model.opt.noslip_iterations, model.opt.noslip_tolerance) == (3.0, 50, 1e-12)
    theirs = Physics.from_entity(Arena(contact="dm_control")).model.opt
    assert (theirs.impratio, theirs.noslip_iterations, theirs.noslip_tolerance) == (1.0, 5, 0.0)
    with pytest.raises(UnknownNameError, match="Valid: firm, dm_control"):
        Arena(contact="soft")
    assert model.body("jaco_arm/link_6").mass == 1e-5
    alone = Physics.from_entity(JacoArm()).model
    assert alone.body("link_6").mass == 1e-9
    ground = model.geom("ground")
    np.testing.assert_array_equal(ground.friction, (0.4, 0.005, 0.0001))
    np.testing.assert_array_equal(ground.solref, (0.002, 1.0))
    np.testing.assert_array_equal(ground.solimp[:3], (0.95, 0.99, 0.001))
    assert arm.prefix == "jaco_arm/"


@pytest.mark.parametrize("order", ["hand first", "arm first"])
def test_detaching_and_attaching_again(order: str) -> None:
    arena, arm, hand = build(order)
    arm.observables.joints_pos.enabled = False
    hand.observables.pinch_site_pos.configure(enabled=True, update_interval=5)
    hand.detach()
    assert hand.parent is None
    assert list(arena.iter_entities()) == [arena, arm]
    assert names(hand) == ["finger_1", "finger_2", "finger_3"]
    assert hand.tool_center_point is hand.grip_site
    arm.attach(hand, quaternion=QUARTER_TURN)
    arm.detach()  # with the hand on it
    assert names(arm)[0] == "joint_1"
    assert hand.parent is arm
    assert hand.pinch_site.name == "jaco_hand/pinchsite"
    arena.attach(arm)
    assert hand.pinch_site.name == "jaco_arm/jaco_hand/pinchsite"

    physics = Physics.from_entity(arena)
    assert (physics.model.nq, physics.model.nu, physics.model.nsensor, physics.model.nexclude) == (9, 9, 6, 7)
    arm.set_home(physics)
    position, quaternion = hand.get_pose(physics)
    np.testing.assert_allclose(position, 0.0, atol=EXACT)
    wrist = physics.bind(arm.wrist_site).xmat.reshape(3, 3)
    held = physics.bind(hand.root_body).xmat.reshape(3, 3)
    np.testing.assert_allclose(held[:, 0], wrist[:, 1], atol=EXACT)
    assert quaternion.shape == (4,)
    assert hand.observables.pinch_site_pos.enabled
    assert hand.observables.pinch_site_pos.update_interval == 5
    np.testing.assert_array_equal(hand.observables.pinch_site_pos(physics), physics.bind(hand.pinch_site).xpos)


def test_an_entity_can_move_to_another_tree() -> None:
    first, arm, _ = build("arm first")
    second = Arena()
    arm.detach()
    second.attach(arm)
    assert Physics.from_entity(first).model.nq == 0
    physics = Physics.from_entity(second)
    arm.set_home(physics)
    assert physics.model.nq == 9


def test_what_cannot_be_attached() -> None:
    arena, arm, hand = build("arm first")
    other = JacoArm()
    with pytest.raises(InvalidInputError, match="attached to 'jaco_arm' already"):
        other.attach(hand)
    with pytest.raises(InvalidInputError, match="attached to 'jaco_arm' already"):
        arm.attach(hand)
    with pytest.raises(InvalidInputError, match="attached to 'arena' already"):
        hand.attach(arm)
    with pytest.raises(InvalidInputError, match="to itself"):
        hand.attach(arena)
    with pytest.raises(InvalidInputError, match="must be an Entity"):
        arm.attach(mujoco.MjSpec())
    with pytest.raises(InvalidInputError, match=r"must be a site of 'jaco_arm'.*jaco_arm/wristsite"):
        arm.attach(JacoHand(name="second"), other.wrist_site)
    for wrong in ({"position": (0.0, 1.0)}, {"quaternion": (2.0, 0.0, 0.0, 0.0)}):
        with pytest.raises(InvalidInputError):
            arena.attach(other, **wrong)
    assert other.parent is None
    assert Physics.from_entity(arena).model.nq == 9
    with pytest.raises(InvalidInputError, match="not attached to anything"):
        other.detach()


def test_a_tree_may_change_after_compiling_and_be_compiled_again() -> None:
    arena, arm, hand = build("hand first")
    old = Physics.from_entity(arena)
    arm.set_home(old)
    position = old.bind(hand.pinch_site).xpos.copy()
    site, cube = hand.pinch_site, Primitive(name="cube")
    arena.add_free_entity(cube, position=(0.5, 0.5, 0.5))
    with pytest.raises(InvalidInputError, match="added after this one was compiled"):
        cube.get_pose(old)
    new = Physics.from_entity(arena)
    arm.set_home(new)
    assert (old.model.nq, new.model.nq) == (9, 16)
    np.testing.assert_array_equal(new.bind(site).xpos, position)

    hand.detach()
    without = Physics.from_entity(arena)
    assert without.model.nq == 13
    with pytest.raises(InvalidInputError, match="not part of this physics"):
        without.bind(hand.pinch_site)
    arm.attach(hand)
    again = Physics.from_entity(arena)
    arm.set_home(again)
    np.testing.assert_array_equal(again.bind(hand.pinch_site).xpos, position)
    with pytest.raises(InvalidInputError, match="not part of this physics"):
        old.bind(hand.pinch_site)  # another element by now
    for physics in (old, new, without, again):
        physics.step(5)
    np.testing.assert_array_equal(old.bind(arm.joints).qpos, again.bind(arm.joints).qpos)

    cube.detach()  # MuJoCo has free joints at the top level only
    outer = Arena("outer")
    outer.attach(arena, position=(0.0, 0.0, 1.0))
    raised = Physics.from_entity(outer)
    arm.set_home(raised)
    np.testing.assert_allclose(raised.bind(hand.pinch_site).xpos, position + np.array((0.0, 0.0, 1.0)), atol=EXACT)


def test_what_mujoco_refuses_to_join_leaves_the_tree_as_it_was() -> None:
    arena = Arena()
    held_elsewhere = mujoco.MjSpec()
    held_elsewhere.worldbody.add_body(name="thing")
    holder = mujoco.MjSpec()
    holder.attach(held_elsewhere, frame=holder.worldbody.add_frame(), prefix="x/")
    bodies = len(arena.mjcf_model.bodies)
    with pytest.raises(ModelError, match="MuJoCo cannot attach 'thing/'"):
        arena.attach(ModelWrapperEntity(held_elsewhere, name="thing"))
    assert len(arena.mjcf_model.bodies) == bodies
    assert list(arena.iter_entities()) == [arena]


def test_elements_that_mujoco_would_lose_are_an_error() -> None:
    arena, arm, _ = build("arm first")
    arm.root_body.add_camera(name="eye")
    assert Physics.from_entity(arena).model.ncam == 2


Add = Callable[[mujoco.MjSpec], Any]


@pytest.mark.parametrize(
    ("add", "kind"),
    [
        (lambda spec: spec.worldbody.add_camera(name="more"), "cameras.*root_body"),
        (lambda spec: spec.worldbody.add_geom(name="more", size=(0.1, 0.1, 0.1)), "geoms.*root_body"),
        (lambda spec: spec.worldbody.add_body(name="more"), "bodies.*root_body"),
        (lambda spec: spec.add_sensor(name="more", type=mujoco.mjtSensor.mjSENS_CLOCK), "sensors.*before attaching"),
        (lambda spec: spec.add_actuator(name="more", target="joint_1"), "actuators"),
        (lambda spec: spec.add_equality(name="more", name1="joint_1"), "equalities"),
        (lambda spec: spec.add_tendon(name="more"), "tendons"),
        (lambda spec: spec.add_material(name="more"), "materials"),
        (lambda spec: spec.add_exclude(name="more", bodyname1="link_1", bodyname2="link_2"), "excludes"),
        (lambda spec: spec.add_key(name="more"), "keys"),
        (lambda spec: spec.add_numeric(name="more", data=[1.0]), "numerics"),
    ],
)
def test_what_is_added_to_the_spec_of_an_attached_entity_is_refused_by_name(add: Add, kind: str) -> None:
    arena, arm, _ = build("hand first")
    add(arm.mjcf_model)
    with pytest.raises(InvalidInputError, match=rf"'more' \({kind}"):
        Physics.from_entity(arena)
    with pytest.raises(InvalidInputError, match="'jaco_arm'"):
        Physics.from_entity(arena)


def test_keyframes_of_before_are_kept() -> None:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="bob")
    body.add_joint(name="swing")
    body.add_geom(size=(0.1, 0.1, 0.1))
    spec.add_key(name="up", qpos=[0.5])
    arena = Arena()
    arena.attach(ModelWrapperEntity(spec, name="pendulum"))
    physics = Physics.from_entity(arena)
    physics.reset("pendulum/up")
    assert physics.data.qpos[0] == 0.5
