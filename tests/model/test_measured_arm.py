"""Arms whose joints are not where their description has them, and the file that says where."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

import jacokin
from jacokin import Robot, reachability
from jacokin.errors import InvalidInputError, ModelError
from jacokin.model import NAMES, MeasuredArm, MeasuredJoint, crosscheck, urdf_folder, write_mjcf, write_urdf
from jacokin.mujoco_bridge import Arena, Physics, observations, robots
from tests.model.measured_arms import drawn_arm, drawn_joint, measured_arm, perturbed


def turn(axis: int, angle: float) -> np.ndarray:
    """Rodrigues' formula about a unit axis of the frame, written out."""
    c, s = np.cos(angle), np.sin(angle)
    first, second = [(1, 2), (2, 0), (0, 1)][axis]
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = c
    matrix[first, second], matrix[second, first] = -s, s
    return matrix


def test_joints_move_as_the_numbers_say(robot: Robot) -> None:
    """One joint at a time: shift, tilt about x, and offset, against matrices multiplied by hand."""
    q = robot.home
    for k, name in enumerate(robot.joint_names):
        joint = MeasuredJoint((1e-3, 2e-3, -3e-3), (0.0, -float(np.sin(0.01)), float(np.cos(0.01))), 0.02)
        joints = [joint if other == name else MeasuredJoint() for other in robot.joint_names]
        moved = jacokin.load_robot(calibration=measured_arm(robot, joints))
        T = np.eye(4)
        for index in range(1, robot.dof + 1):
            T = T @ robot.pin_model.jointPlacements[index].homogeneous
            if index == k + 1:
                D = np.eye(4)
                D[:3, :3], D[:3, 3] = turn(0, 0.01) @ turn(2, 0.02), joint.position
                T = T @ D
            R = np.eye(4)
            R[:3, :3] = turn(2, q[index - 1])
            T = T @ R
        T = T @ robot.pin_model.frames[robot.frame_id()].placement.homogeneous
        np.testing.assert_allclose(moved.forward_kinematics(q).homogeneous, T, atol=1e-14)


@pytest.mark.parametrize("name", NAMES)
def test_the_described_arm_of_a_calibrated_one(
    name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    arm = perturbed(robot, rng)
    described = arm.described
    assert (described.calibration, described.label, arm.label) == (None, name, f"calibrated {name}")
    np.testing.assert_array_equal(described.home, robot.home)
    for q in robot.sample(rng, 5):
        for frame in robot.frames:
            wanted = robot.forward_kinematics(q, frame).homogeneous
            np.testing.assert_allclose(described.forward_kinematics(q, frame).homogeneous, wanted, atol=1e-14)
        assert np.linalg.norm(arm.forward_kinematics(q).translation - wanted[:3, 3]) > 1e-5
    assert robot.described is robot


@pytest.mark.one_quick
@pytest.mark.parametrize("name", NAMES)
def test_no_deviation_is_the_same_robot_to_the_bit(
    name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    same = jacokin.load_robot(name, calibration=measured_arm(robot, [MeasuredJoint()] * robot.dof))
    for ours, theirs in zip(robot.pin_model.jointPlacements, same.pin_model.jointPlacements, strict=True):
        assert ours.homogeneous.tobytes() == theirs.homogeneous.tobytes()
    for q in robot.sample(rng, 10):
        assert same.forward_kinematics(q).homogeneous.tobytes() == robot.forward_kinematics(q).homogeneous.tobytes()
    T = robot.forward_kinematics(robot.home)
    answers = [jacokin.IKSolver(each).solve_all(T).q.tobytes() for each in (robot, same)]
    assert answers[0] == answers[1]
    assert robot.calibration is None
    assert same.calibration is not None
    assert repr(same).endswith(", calibrated)")


def test_limits_frames_and_home_stay(robot: Robot, rng: np.random.Generator) -> None:
    arm = perturbed(robot, rng)
    assert arm.lower.tolist() == robot.lower.tolist()
    assert arm.upper.tolist() == robot.upper.tolist()
    assert arm.home.tolist() == robot.home.tolist()
    assert arm.frames == robot.frames
    copy = pickle.loads(pickle.dumps(arm))
    assert copy.calibration == arm.calibration
    assert arm.with_payload(0.1, [0, 0, 0]).calibration == arm.calibration


@pytest.mark.parametrize("name", ["arm \U0001f9be", "関節", 'a "quoted" \\ name', "del\x7f, tab\t, line\n"])
def test_any_name_comes_back(name: str, tmp_path: Path) -> None:
    arm = MeasuredArm(name, "0" * 64, ((name, MeasuredJoint(offset=0.01)),), ((name, 1.5),))
    arm.save(tmp_path / "arm.toml")
    assert MeasuredArm.load(tmp_path / "arm.toml") == arm


def test_a_file_gives_the_same_arm_to_the_bit(robot: Robot, rng: np.random.Generator, tmp_path: Path) -> None:
    arm = drawn_arm(robot, rng)
    arm = replace(arm, facts=(("measurements", 30), ("residual [m]", 2.9e-4)))
    arm.save(tmp_path / "my_arm.toml")
    read = MeasuredArm.load(tmp_path / "my_arm.toml")
    assert read == arm
    assert read.path == tmp_path / "my_arm.toml"
    loaded = jacokin.load_robot("j2n6s300", calibration=tmp_path / "my_arm.toml")
    assert loaded.calibration == arm


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["j2n6s300", "j2s6s200", "j2s7s300"])
def test_files_for_other_programs_move_as_the_arm(
    name: str, bundled: Callable[[str], Robot], rng: np.random.Generator, tmp_path: Path
) -> None:
    """Pinocchio reads the URDF, MuJoCo the MJCF; both against the arm, all frames."""
    robot = bundled(name)
    arm = perturbed(robot, rng)
    write_urdf(arm, tmp_path / "arm.urdf")
    write_mjcf(arm, tmp_path / "arm.xml")
    read = jacokin.load_robot(tmp_path / "arm.urdf", tip=arm.default_frame)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    data = mujoco.MjData(model)
    places = [model.joint(joint).qposadr[0] for joint in arm.joint_names]
    for q in arm.sample(rng, 20):
        for frame in arm.frames:
            np.testing.assert_allclose(
                read.forward_kinematics(q, frame).homogeneous, arm.forward_kinematics(q, frame).homogeneous, atol=1e-12
            )
        data.qpos[places] = q
        mujoco.mj_kinematics(model, data)
        hand = arm.forward_kinematics(q, "end_effector")
        np.testing.assert_allclose(data.site("end_effector").xpos, hand.translation, atol=1e-12)
        np.testing.assert_allclose(data.site("end_effector").xmat.reshape(3, 3), hand.rotation, atol=1e-12)
    assert np.allclose(read.mass_matrix(arm.home), arm.mass_matrix(arm.home), atol=1e-12)
    assert crosscheck(arm).within()


@pytest.mark.slow
def test_files_of_the_users_own(scene: Path, rng: np.random.Generator, tmp_path: Path) -> None:
    """Slanted axes, anchors off the origin, a reference angle, a frame, euler angles."""
    own = jacokin.load_robot(scene, base="pedestal", tip="fore")
    arm = jacokin.load_robot(scene, base="pedestal", tip="fore", calibration=drawn_arm(own, rng))
    write_mjcf(arm, tmp_path / "written.xml")
    read = jacokin.load_robot(tmp_path / "written.xml", base="pedestal", tip="fore")
    for q in arm.sample(rng, 20):
        np.testing.assert_allclose(
            read.forward_kinematics(q).homogeneous, arm.forward_kinematics(q).homogeneous, atol=1e-12
        )
        assert np.abs(arm.forward_kinematics(q).homogeneous - own.forward_kinematics(q).homogeneous).max() > 1e-5
    assert crosscheck(arm).within()
    with pytest.raises(ModelError, match=r"is an MJCF: write_mjcf writes it"):
        write_urdf(arm, tmp_path / "written.urdf")
    copy = tmp_path / "own.urdf"
    copy.write_text((urdf_folder() / "j2n6s300.urdf").read_text())
    with pytest.raises(ModelError, match=r"is a URDF: write_urdf writes it"):
        write_mjcf(jacokin.load_robot(copy), tmp_path / "written.xml")


def test_a_pitch_of_a_quarter_turn_is_written_exactly(rng: np.random.Generator, tmp_path: Path) -> None:
    text = (urdf_folder() / "j2n6s300.urdf").read_text()
    turned = re.sub(r'(<joint name="joint_3".*?rpy=)"[^"]*"', rf'\1"0.3 {np.pi / 2!r} 0.1"', text, flags=re.DOTALL)
    path = tmp_path / "turned.urdf"
    path.write_text(turned)
    own = jacokin.load_robot(path)
    joints = [MeasuredJoint() for _ in own.joint_names]
    joints[2] = MeasuredJoint(offset=1e-9)
    for chosen in (joints, [drawn_joint(rng) for _ in joints]):
        arm = jacokin.load_robot(path, calibration=measured_arm(own, chosen))
        write_urdf(arm, tmp_path / "written.urdf")
        read = jacokin.load_robot(tmp_path / "written.urdf")
        for q in arm.sample(rng, 5):
            np.testing.assert_allclose(
                read.forward_kinematics(q).homogeneous, arm.forward_kinematics(q).homogeneous, atol=1e-12
            )


def test_the_twin_in_the_bridge_moves_as_the_arm(robot: Robot, rng: np.random.Generator) -> None:
    arm = perturbed(robot, rng)
    twin = robots.make_arm(observations.PERFECT_FEATURES, calibration=arm.calibration)
    arena = Arena()
    arena.attach(twin)
    physics = Physics.from_entity(arena)
    for q in arm.sample(rng, 10):
        physics.bind(twin.joints).qpos = q
        site = physics.bind(twin.wrist_site)
        wanted = arm.forward_kinematics(q, "wristsite")
        np.testing.assert_allclose(site.xpos, wanted.translation, atol=1e-12)
        # Its inverse kinematics brings the site where it was.
        physics.bind(twin.joints).qpos = arm.home
        quat = jacokin.model.quat_wxyz(wanted.rotation)
        assert twin.set_site_to_xpos(physics, np.random.RandomState(0), twin.wrist_site, wanted.translation, quat)


def test_every_branch_of_a_calibrated_arm(robot: Robot, rng: np.random.Generator) -> None:
    """Its own configuration is among them, `solve` returns it, and all of them reach the pose."""
    arm = perturbed(robot, rng)
    solver = jacokin.IKSolver(arm, collision="ignore")
    for q in arm.sample(rng, 20):
        T = arm.forward_kinematics(q)
        branches = solver.solve_all(T).q
        assert min(np.abs(np.sin(0.5 * (row - q))).max() for row in branches) < 1e-7
        assert all(np.abs(arm.forward_kinematics(row).homogeneous - T.homogeneous).max() < 1e-9 for row in branches)
        result = solver.solve(T, seed=q)
        assert result.success
        assert np.abs(result.q - q).max() < 1e-7


def test_everything_takes_a_calibrated_arm(robot: Robot, rng: np.random.Generator, tmp_path: Path) -> None:
    """Families, paths, the tracker and the C library compute with the arm's own joints; maps of another are refused."""
    arm = perturbed(robot, rng)
    solver = jacokin.IKSolver(arm)
    T = arm.forward_kinematics(arm.home)
    family = solver.solve_all(jacokin.FreeAxis(T, axis=(0, 0, 1)))
    assert family.intervals
    for piece in family.intervals:
        reached = arm.forward_kinematics(piece.at(0.5 * (piece.start + piece.stop)))
        np.testing.assert_allclose(reached.translation, T.translation, atol=1e-6)
        np.testing.assert_allclose(reached.rotation[:, 2], T.rotation[:, 2], atol=1e-6)
    line = [T, T * jacokin.pose([0.0, 0.0, 0.02])]
    path = jacokin.plan_path(solver, line, dt=0.05)
    assert path.success
    np.testing.assert_allclose(arm.forward_kinematics(path.q[-1]).homogeneous, line[-1].homogeneous, atol=1e-6)
    step = jacokin.Tracker(arm, dt=0.01).step(T)
    assert np.abs(step.q - arm.home).max() < 1e-6
    assert jacokin.ik.export_c(solver, tmp_path).stat().st_size > 0
    with pytest.raises(InvalidInputError, match="is a map of another robot"):
        reachability.load(reachability.bundled("j2n6s300").folder, robot=arm)


NONSENSE = {
    "axis of joint 3 longer": (r"(joint_3.*?axis = )\[[^]]*\]", r"\1[0.0, 0.0, 3.0]", "'joint_3': axis must be a unit"),
    "not a number": (r"(joint_2.*?offset = )\S+", r"\1nan", "'joint_2': offset must be a finite number"),
    "infinite": (r"(joint_2.*?position = )\[[^]]*\]", r"\1[0.0, inf, 0.0]", "'joint_2': position must be finite"),
    "in millimetres": (r"(joint_2.*?position = )\[[^]]*\]", r"\1[1.5, 0.0, 0.0]", "is 1.5 m from the described"),
    "a quarter turn": (r"(joint_1.*?axis = )\[[^]]*\]", r"\1[1.0, 0.0, 0.0]", "is 1.57 rad from the described"),
    "a word": (r"(joint_1.*?offset = )\S+", r'\1"much"', "'joint_1': offset must be a finite number"),
    "two numbers": (r"(joint_1.*?position = )\[[^]]*\]", r"\1[0.0, 0.0]", "'joint_1': position must have shape"),
    "another version": (r"format = 1", "format = 2", "is of format 2; this version of jacokin reads format 1"),
    "no format": (r"format = 1", "", "is not a calibration file"),
    "another key": (r"format = 1", "format = 1\nurgent = true", "is damaged: unknown urgent"),
    "a joint less": (r'\[joints."joint_6"\].*', "", "this one has joint_1"),
    "a line less": (r"(joint_4.*?)offset = \S+", r"\1", "joint 'joint_4' must have axis, compliance"),
    "cut off": (r"(joint_4.*?axis = \[).*", r"\1", "is not a calibration file, or damaged"),
    "other numbers": (r'fingerprint = "\w', 'fingerprint = "x', "whose description had other numbers"),
    "another robot": (r'robot = "j2n6s300"', 'robot = "m1n6s300"', "of 'm1n6s300', and this robot is 'j2n6s300'"),
    "a scale": (r"(joint_2.*?scale = )\S+", r"\g<1>1.001", "which no robot of plain joints can hold"),
}


@pytest.mark.parametrize("what", NONSENSE)
def test_damaged_files_are_refused(what: str, robot: Robot, rng: np.random.Generator, tmp_path: Path) -> None:
    pattern, replacement, sentence = NONSENSE[what]
    path = tmp_path / "my_arm.toml"
    drawn_arm(robot, rng).save(path)
    text, count = re.subn(pattern, replacement, path.read_text(), count=1, flags=re.DOTALL)
    assert count == 1
    path.write_text(text)
    with pytest.raises(ModelError, match=re.escape(sentence)) as refusal:
        jacokin.load_robot(calibration=path)
    assert str(path) in str(refusal.value) or what == "a scale"


def test_files_that_are_no_text(tmp_path: Path) -> None:
    path = tmp_path / "my_arm.toml"
    with pytest.raises(ModelError, match="cannot be read: No such file"):
        jacokin.load_robot(calibration=path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ModelError, match="is not a text file"):
        jacokin.load_robot(calibration=path)
    path.write_text("format = [")
    with pytest.raises(ModelError, match="is not a calibration file, or damaged"):
        jacokin.load_robot(calibration=path)
    with pytest.raises(InvalidInputError, match="calibration must be"):
        jacokin.load_robot(calibration=3)  # type: ignore[arg-type]  # a user's mistake


@pytest.mark.parametrize("joints", [(), 5, ("joint_1",), (("joint_1", 0.1),), ((3, MeasuredJoint()),)])
def test_arms_without_joints_are_refused(joints: object) -> None:
    with pytest.raises(InvalidInputError, match="^joints must be "):
        MeasuredArm("j2n6s300", "digest", joints)  # type: ignore[arg-type]  # a user's mistake


def test_another_base_is_another_arm(robot: Robot, rng: np.random.Generator) -> None:
    arm = drawn_arm(robot, rng)
    with pytest.raises(ModelError, match="or another base than 'link_1'"):
        jacokin.load_robot(base="link_1", calibration=replace(arm, joints=arm.joints[1:]))


def test_long_keys_are_refused_at_once(tmp_path: Path) -> None:
    for text in (".".join("a" * 50_000) + " = 1", "a = 1\n" * 100_000):
        (tmp_path / "long.toml").write_text(text)
        with pytest.raises(ModelError, match="at most 1000 are read|larger than the 250000 bytes"):
            MeasuredArm.load(tmp_path / "long.toml")
