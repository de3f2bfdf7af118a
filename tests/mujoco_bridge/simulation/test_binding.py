"""Physics.bind: live arrays, their shapes, and what cannot be bound."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.mujoco_bridge import JacoArm, JacoHand, ModelWrapperEntity, Physics
from jacokin.mujoco_bridge.props import Primitive
from tests.mujoco_bridge.scenes import jaco_parts


def scene() -> tuple[Physics, JacoArm, JacoHand, Primitive]:
    arena, arm, hand = jaco_parts()
    cube = Primitive("box", name="cube")
    arena.add_free_entity(cube, position=(0.3, 0.0, 0.5))
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    return physics, arm, hand, cube


def test_shapes() -> None:
    physics, arm, hand, cube = scene()
    joints, joint = physics.bind(arm.joints), physics.bind(arm.joints[1])
    assert joints.qpos.shape == joints.qvel.shape == joints.type.shape == (6,)
    assert joints.range.shape == (6, 2)
    assert joints.axis.shape == joints.xaxis.shape == (6, 3)
    assert joint.qpos.shape == joint.limited.shape == (1,)
    assert joint.range.shape == (2,)
    assert physics.bind(hand.pinch_site).xpos.shape == (3,)
    assert physics.bind([hand.pinch_site]).xpos.shape == (1, 3)
    assert physics.bind([hand.pinch_site, hand.grip_site]).xmat.shape == (2, 9)
    assert physics.bind(arm.joint_torque_sensors).sensordata.shape == (6, 3)
    assert physics.bind(arm.joint_torque_sensors[2]).sensordata.shape == (3,)
    free = cube.root_body.joints[0]
    assert physics.bind(free).qpos.shape == (7,)
    assert physics.bind([free]).qvel.shape == (1, 6)
    assert physics.bind([free, arm.joints[0]]).qpos.shape == (8,)  # ragged: all in one row
    assert physics.bind(arm.joints[0].parent).xfrc_applied.shape == (6,)
    assert physics.bind(arm.actuators).ctrlrange.shape == (6, 2)
    assert physics.bind(arm.actuators).act.shape == (0,)


def test_arrays_are_mujocos_own_memory() -> None:
    physics, arm, hand, cube = scene()
    address = [int(physics.model.joint(joint.name).qposadr[0]) for joint in arm.joints]
    for elements, rows in (
        (arm.joints, address),
        (arm.joints[::-1], address[::-1]),
        (arm.joints[::2], address[::2]),
        ([arm.joints[0], hand.joints[2]], [address[0], address[5] + 3]),
    ):
        q = physics.bind(elements).qpos
        assert np.shares_memory(q, physics.data.qpos)
        physics.data.qpos[rows] = np.arange(len(rows)) + 0.5
        np.testing.assert_array_equal(q, np.arange(len(rows)) + 0.5)
        q[1] = 9.0
        assert physics.data.qpos[rows[1]] == 9.0
    site = physics.bind(hand.pinch_site)
    held = site.xpos
    physics.bind(arm.joints).qpos[1] = 2.5
    np.testing.assert_array_equal(held, site.xpos)
    cube.set_pose(physics, position=(0.0, 0.0, 2.0))
    np.testing.assert_array_equal(physics.data.body("cube/").xpos, (0.3, 0.0, 0.5))  # not through bind: the old one
    np.testing.assert_array_equal(physics.bind(cube.root_body).xpos, (0.0, 0.0, 2.0))


ANY_ORDER = [0, 3, 4, 1]


def in_any_order(physics: Physics, arm: JacoArm) -> Any:
    return physics.bind([arm.joints[i] for i in ANY_ORDER])


@pytest.mark.parametrize("field", ["qpos", "damping"])
def test_elements_in_any_order_are_live_too(field: str) -> None:
    physics, arm, _, _ = scene()
    source = physics.data.qpos if field == "qpos" else physics.model.dof_damping
    bound = in_any_order(physics, arm)
    array = getattr(bound, field)
    np.testing.assert_array_equal(array, source[ANY_ORDER])

    array[2] = 1.25
    assert source[4] == 1.25
    array[1:3] = 0.5
    np.testing.assert_array_equal(source[[3, 4]], 0.5)
    array[1:][0] = 0.75
    assert source[3] == 0.75
    array += 1.0
    np.testing.assert_array_equal(array, source[ANY_ORDER])
    assert source[3] == 1.75
    setattr(bound, field, 2.0)
    np.testing.assert_array_equal(source[ANY_ORDER], 2.0)
    setattr(bound, field, np.array([1.0, 2.0, 3.0, 4.0]))
    assert source[1] == 4.0
    array[array > 2.5] = 0.0
    assert source[1] == 0.0
    np.multiply(array, 3.0, out=array)
    assert source[0] == 3.0

    source[0] = 8.0
    assert array[0] == 8.0
    assert (array + 0.0)[0] == 8.0
    assert np.max(array) == 8.0
    assert next(iter(array)) == 8.0
    copied = array.copy()
    copied[0] = -1.0
    assert source[0] == 8.0
    source[0] = 7.0
    np.testing.assert_array_equal(getattr(bound, field), source[ANY_ORDER])


def test_writes_to_elements_in_any_order_are_noticed() -> None:
    physics, arm, hand, _ = scene()
    site = physics.bind(hand.pinch_site)
    before = site.xpos.copy()
    in_any_order(physics, arm).qpos[3] += 0.3
    assert np.linalg.norm(site.xpos - before) > 0.05
    old = physics.bind(arm.joints).qacc.copy()
    in_any_order(physics, arm).armature[:] = 1.0
    assert np.abs(physics.bind(arm.joints).qacc - old).max() > 1e-3


def test_vectors_of_elements_in_any_order() -> None:
    physics, arm, _, _ = scene()
    bound = physics.bind([arm.joints[i].parent for i in ANY_ORDER])
    ids = list(bound.element_ids)
    np.testing.assert_array_equal(bound.xpos, physics.data.xpos[ids])
    bound.xfrc_applied[1, 3:] = (1.0, 2.0, 3.0)
    np.testing.assert_array_equal(physics.data.xfrc_applied[ids[1], 3:], (1.0, 2.0, 3.0))
    bound.xfrc_applied[:, 2] = 5.0
    np.testing.assert_array_equal(physics.data.xfrc_applied[ids, 2], 5.0)
    with pytest.raises(InvalidInputError, match="computed by MuJoCo"):
        bound.xpos = 0.0


def test_broadcast_and_whole_writes() -> None:
    physics, arm, _, _ = scene()
    bound = physics.bind(arm.actuators)
    bound.ctrl = 0.25
    np.testing.assert_array_equal(physics.data.ctrl[:6], 0.25)
    bound.ctrlrange = (-0.1, 0.1)
    np.testing.assert_array_equal(physics.model.actuator_ctrlrange[:6], np.tile((-0.1, 0.1), (6, 1)))
    bound.ctrlrange[:, 1] *= 2.0
    np.testing.assert_array_equal(physics.model.actuator_ctrlrange[:6, 1], 0.2)
    wrong: Any
    for wrong in (np.zeros(5), "fast", [[0.0]] * 7, arm):
        with pytest.raises(InvalidInputError, match=r"ctrl of 6 actuators must fit shape \(6,\)"):
            bound.ctrl = wrong


def test_derived_fields_cannot_be_written() -> None:
    physics, arm, _, _ = scene()
    with pytest.raises(InvalidInputError, match="computed by MuJoCo"):
        physics.bind(arm.wrist_site).xpos = (0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="read-only"):
        physics.bind(arm.wrist_site).xpos[0] = 1.0
    physics.bind(arm.joints).qacc = 1.0  # for the inverse dynamics
    np.testing.assert_array_equal(physics.data.qacc[:6], 1.0)


def test_bindings_are_kept_and_names_are_short_or_full() -> None:
    physics, arm, _, _ = scene()
    assert physics.bind(arm.joints) is physics.bind(list(arm.joints))
    assert physics.bind(arm.joints[0]) is physics.bind(arm.joints[0])
    bound = physics.bind(arm.joints)
    assert np.shares_memory(bound.range, bound.jnt_range)
    assert np.shares_memory(bound.armature, bound.dof_armature)
    assert np.shares_memory(physics.bind(arm.wrist_site).xpos, physics.bind(arm.wrist_site).site_xpos)
    assert physics.bind(arm.joints[2]).element_id == 2
    np.testing.assert_array_equal(bound.element_id, range(6))
    assert "qpos" in dir(bound)
    assert hasattr(bound, "qpos")
    assert not hasattr(bound, "xpos")


def test_unknown_fields_list_the_valid_ones() -> None:
    physics, arm, _, _ = scene()
    with pytest.raises(UnknownNameError, match=r"unknown joint field 'qposs'. Did you mean 'qpos'"):
        _ = physics.bind(arm.joints).qposs
    with pytest.raises(AttributeError):
        physics.bind(arm.joints).force = 1.0


def test_what_cannot_be_bound() -> None:
    physics, arm, hand, _ = scene()
    other = JacoArm()
    twin = scene()[1]
    with pytest.raises(InvalidInputError, match="one kind, got joint and site"):
        physics.bind([arm.joints[0], arm.wrist_site])
    with pytest.raises(InvalidInputError, match="'joint_1' is not part of this physics"):
        physics.bind(other.joints[0])
    with pytest.raises(InvalidInputError, match="belongs to another model"):
        physics.bind([arm.joints[0], twin.joints[1]])  # same names, another tree
    wrong: Any
    for wrong in (
        None,
        3,
        [None],
        [arm.joints],
        arm,
        hand.mjcf_model,
        [hand.mjcf_model],
        ["jaco_arm/joint_1", arm.wrist_site],
    ):
        with pytest.raises(InvalidInputError):
            physics.bind(wrong)


def test_elements_without_names_and_models_from_elsewhere() -> None:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body()
    hinge = body.add_joint(axis=(0.0, 1.0, 0.0))
    near = body.add_geom(size=(0.1, 0.1, 0.1), pos=(0.0, 0.0, 1.0))
    far = body.add_geom(name="far", size=(0.1, 0.1, 0.1), pos=(0.0, 0.0, 2.0))
    physics = Physics.from_entity(ModelWrapperEntity(spec))
    physics.bind(hinge).qpos = np.pi / 2.0
    np.testing.assert_allclose(physics.bind(near).xpos, (1.0, 0.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(physics.bind([far, near]).xpos[:, 0], (2.0, 1.0))
    assert physics.bind(body).element_id == 1
    assert physics.bind(spec.worldbody).subtree_com.shape == (3,)
    # A model that was compiled by hand: elements are found by name.
    direct = Physics.from_model(spec.compile())
    assert direct.bind(far).xpos[2] == 2.0
    with pytest.raises(InvalidInputError, match="not part"):
        direct.bind(near)


def test_full_names_are_bound_as_their_elements_are() -> None:
    physics, arm, hand, _ = scene()
    joints = physics.bind([joint.name for joint in arm.joints])
    assert np.shares_memory(joints.qpos, physics.bind(arm.joints).qpos)
    assert joints.qpos.shape == (6,)
    assert physics.bind("jaco_arm/joint_2").qpos.shape == (1,)  # the joint, not its actuator
    assert physics.bind(["jaco_arm/joint_1", arm.joints[1]]).element_ids == (0, 1)
    assert physics.bind([arm.actuators[1], "jaco_arm/joint_1"]).element_ids == (1, 0)
    np.testing.assert_array_equal(physics.bind(hand.pinch_site.name).xpos, physics.bind(hand.pinch_site).xpos)
    # From a model alone, by names.
    twin = Physics.from_model(physics.model)
    assert twin.bind("jaco_arm/jaco_hand/pinchsite").xpos.shape == (3,)
    with pytest.raises(UnknownNameError, match=r"unknown element 'jaco_arm/joint_7'. Did you mean 'jaco_arm/joint_"):
        physics.bind("jaco_arm/joint_7")
    with pytest.raises(UnknownNameError, match="unknown joint 'ground'"):
        physics.bind([arm.joints[0], "ground"])
    with pytest.raises(InvalidInputError, match="no kind has all of jaco_arm/wristsite, ground"):
        physics.bind(["jaco_arm/wristsite", "ground"])


def test_no_elements_have_empty_fields_that_cannot_be_written() -> None:
    physics = scene()[0]
    bound = physics.bind([])
    assert bound.qpos.shape == bound.xpos.shape == (0,)
    assert bound.element_ids == ()
    with pytest.raises(InvalidInputError, match="no elements are bound"):
        bound.qpos = 1.0


def test_elements_made_after_compiling_are_refused() -> None:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body()
    near = body.add_geom(size=(0.1, 0.1, 0.1), pos=(0.0, 0.0, 1.0))
    entity = ModelWrapperEntity(spec)
    old = Physics.from_entity(entity)
    first = spec.worldbody.add_geom(size=(0.2, 0.2, 0.2))  # without a name, before the other in the model
    far = body.add_geom(size=(0.1, 0.1, 0.1), pos=(0.0, 0.0, 2.0))
    new = Physics.from_entity(entity)
    assert (old.bind(near).element_id, new.bind(near).element_id) == (0, 1)
    assert new.bind(far).pos[2] == 2.0
    for element in (first, far):
        with pytest.raises(InvalidInputError, match="added after this one was compiled"):
            old.bind(element)


def test_a_spec_that_was_changed_since_is_refused() -> None:
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(size=(0.1, 0.1, 0.1))
    model = spec.compile()
    spec.worldbody.add_geom(size=(0.1, 0.1, 0.1))
    with pytest.raises(InvalidInputError, match="spec has 2 geoms and the model 1"):
        Physics(model, spec)
