"""The arm that is taken out of a description: where it starts and ends, and what is on it."""

from __future__ import annotations

import re
import resource
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
import jacokin.model
from jacokin.arrays import Array
from jacokin.errors import ModelError, UnknownNameError
from jacokin.model.descriptions import chain
from tests.robot_files import SCENE, torso_text


def tree(*parents: int, kind: str = "RZ", frames: bool = True) -> pin.Model:
    """Joints j1, j2, ... with these parents, 0.1 m above them, each with a frame f1, f2, ..."""
    model = pin.Model()
    for index, parent in enumerate(parents, 1):
        joint = getattr(pin, f"JointModel{kind if index == 1 else 'RZ'}")()
        model.addJoint(parent, joint, pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.1])), f"j{index}")
        if frames:
            model.addFrame(pin.Frame(f"f{index}", index, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME), False)
    return model


def extract(model: pin.Model, q: Array | None = None, base: str | None = None, tip: str | None = None) -> pin.Model:
    ends = chain.find_ends(model, base, tip, {})
    return chain.extract(model, pin.neutral(model) if q is None else q, ends, "arm")


REFUSED: dict[str, tuple[pin.Model, str | None, str | None, str]] = {
    "nothing moves": (tree(), None, None, "no joint starts at the base"),
    "two arms": (tree(0, 1, 0, 3), None, None, "several chains start at the base (j1, j3); say which frame ends"),
    "two arms are named": (tree(0, 1, 0, 3), None, None, "tip=..., for example f2, f4"),
    "arms on a torso": (
        tree(0, 1, 2, 1, 4),
        None,
        None,
        "branches at joint 'j1', its number 1, into chains of up to 2",
    ),
    "tip is above base": (tree(0, 1, 2), "f3", "f1", "tip 'f1' does not descend from base 'f3'"),
    "tip is base": (tree(0, 1, 2), "f2", "f2", "no joint moves between base 'f2' and tip 'f2'"),
    "too many joints": (tree(*range(201)), None, None, "the chain has 201 joints; at most 200"),
    "a ball joint": (tree(0, 1, kind="Spherical"), None, None, "joint 'j1' in the chain has 3 degrees of freedom"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_arm_is_refused(case: str) -> None:
    model, base, tip, message = REFUSED[case]
    with pytest.raises(ModelError, match=re.escape(message)):
        extract(model, base=base, tip=tip)


@pytest.mark.parametrize("argument", ["base", "tip"])
def test_an_unknown_frame_lists_those_there_are(argument: str) -> None:
    model = tree(0, 1)
    with pytest.raises(UnknownNameError, match="unknown frame 'f9'.*Valid: f1, f2"):
        chain.find_ends(model, leaders={}, **{"base": None, "tip": None, argument: "f9"})


@pytest.mark.parametrize(
    ("names", "wanted"),
    [
        (["a", "b"], "a"),
        (["a", "my_end_effector"], "my_end_effector"),
        (["x_end_effector", "end_effector"], "end_effector"),
    ],
)
def test_the_frame_that_is_meant_when_none_is_named(names: list[str], wanted: str) -> None:
    model = tree(0, 1, frames=False)
    with pytest.raises(ModelError, match="the last link of the arm has no named frame"):
        chain.default_frame(model, None)
    for joint, name in ((1, "before"), *((2, name) for name in names)):
        model.addFrame(pin.Frame(name, joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME), False)
    assert chain.default_frame(model, None) == wanted
    assert chain.default_frame(model, "before") == "before"


def test_fingers_end_the_arm_and_free_objects_are_no_arms() -> None:
    model = tree(0, 1, 2, 2)
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "box")
    arm = extract(model)
    assert list(arm.names)[1:] == ["j1", "j2"]
    assert set(chain.frame_names(arm)) == {"f1", "f2", "f3", "f4"}


def test_what_is_off_the_chain_is_locked_where_the_reference_says() -> None:
    model = tree(0, 1, 2, 2)
    q = np.array([0.0, 0.0, 0.4, -0.7])
    arm = extract(model, q, tip="f2")
    for finger, angle in (("f3", 0.4), ("f4", -0.7)):
        placement = arm.frames[chain.frame_id(arm, finger)].placement
        np.testing.assert_allclose(pin.log3(placement.rotation), [0.0, 0.0, angle], atol=1e-15)


def test_a_chain_can_start_anywhere(rng: np.random.Generator) -> None:
    part, whole = jacokin.load_robot(base="link_2"), jacokin.load_robot()
    assert part.joint_names == whole.joint_names[2:]
    q = whole.sample(rng)
    expected = whole.forward_kinematics(q, "link_2").inverse() * whole.forward_kinematics(q)
    np.testing.assert_allclose(part.forward_kinematics(q[2:]).homogeneous, expected.homogeneous, atol=1e-14)
    for shorter in (part, jacokin.load_robot(tip="link_3")):
        assert shorter.home.shape == (shorter.dof,)
        assert shorter.within_limits(shorter.home)


@pytest.mark.parametrize("name", ["base", "jacokin_base", "world", "universe", "link"])
def test_a_joint_may_have_any_name(tmp_path: Path, name: str) -> None:
    path = tmp_path / "names.xml"
    path.write_text(f"""<mujoco><worldbody><body name="link"><joint name="{name}" range="-1 1"/><geom size="0.1"/>
      <body name="tip" pos="0 0 1"><joint name="last"/><geom size="0.1"/>
      <body name="finger" pos="0 0 1"><joint name="grip"/><geom size="0.1"/></body></body></body>
    </worldbody></mujoco>""")
    robot = jacokin.load_robot(path, tip="tip")
    assert robot.joint_names == (name, "last")
    assert robot.within_limits(robot.home)
    assert jacokin.crosscheck(robot, samples=5).within()
    assert jacokin.model.to_mujoco(robot).njnt == 2


def test_many_objects_in_the_scene_take_no_memory(tmp_path: Path) -> None:
    """Working memory for the whole scene would be 3 GB: it grows with the cube of the degrees of freedom."""
    boxes = "".join(f'<body pos="{i} 5 0"><freejoint/><geom size="0.1"/></body>' for i in range(60))
    path = tmp_path / "many.xml"
    path.write_text(
        SCENE.replace('<include file="common.xml"/>', "<default><default class='arm'/></default>").replace(
            "<worldbody>", f"<worldbody>{boxes}"
        )
    )
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # [kB]
    assert jacokin.load_robot(path).dof == 4
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 500_000


def test_continuous_joints_turn_about_any_axis(tmp_path: Path, rng: np.random.Generator) -> None:
    path = tmp_path / "oblique.urdf"
    path.write_text("""<robot name="oblique"><link name="base"/><link name="one"/><link name="two"/>
      <joint name="turn" type="continuous"><parent link="base"/><child link="one"/>
        <origin xyz="0.1 0 0.2" rpy="0.1 0.2 0.3"/><axis xyz="0.6 0 0.8"/><limit effort="1" velocity="1"/></joint>
      <joint name="bend" type="revolute"><parent link="one"/><child link="two"/><origin xyz="0.3 0 0"/>
        <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>""")
    robot = jacokin.load_robot(path)
    assert robot.unlimited.tolist() == [True, False]
    first = jacokin.pose([0.1, 0.0, 0.2], rpy=[0.1, 0.2, 0.3])
    for q in robot.sample(rng, 10):
        turn = pin.SE3(pin.AngleAxis(q[0], np.array([0.6, 0.0, 0.8])).toRotationMatrix(), np.zeros(3))
        bend = jacokin.pose([0.3, 0.0, 0.0], rpy=[0.0, 0.0, q[1]])
        reached = robot.forward_kinematics(q, "two")
        np.testing.assert_allclose(reached.homogeneous, (first * turn * bend).homogeneous, atol=1e-14)


def test_arms_on_a_torso_ask_for_the_tip(tmp_path: Path) -> None:
    path = tmp_path / "torso.urdf"
    path.write_text(torso_text({"head": 2, "left": 7, "right": 7}))
    with pytest.raises(ModelError, match=r"branches at joint 'lift'.*tip=.*left_6, right_6; base='torso', too"):
        jacokin.load_robot(path)
    assert jacokin.load_robot(path, tip="left_6").dof == 8
    assert jacokin.load_robot(path, tip="left_6", base="torso").dof == 7
    path.write_text(torso_text({"left": 1, "right": 1}))  # a gripper on a slide
    assert jacokin.load_robot(path).joint_names == ("lift",)


@pytest.mark.parametrize("names", [("flange", "tool0"), ("tool0", "my_end_effector"), ("camera", "left_tool0")])
def test_the_default_frame_is_the_one_called_as_tools_are(tmp_path: Path, names: tuple[str, str]) -> None:
    joint = '<link name="{0}"/><joint name="to_{0}" type="fixed"><parent link="left_6"/><child link="{0}"/></joint>'
    fixed = "".join(map(joint.format, names))
    path = tmp_path / "arm.urdf"
    path.write_text(torso_text({"left": 7}).replace("</robot>", f"{fixed}</robot>"))
    assert jacokin.load_robot(path).default_frame == names[1]
