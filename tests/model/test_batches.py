"""Kinematics and dynamics of many configurations at once: those of Pinocchio and MuJoCo, on arms of all kinds."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError, UnknownNameError
from jacokin.kernels.configurations.arm import LANES, sin_cos_of_moderate
from jacokin.kernels.trigonometry import LARGEST_ANGLE, sin_cos
from jacokin.model import to_mujoco
from tests.seven_joint_arms import load_arm

ARMS = ("j2n6s300", "j2s7s300", "gen3", "panda", "random 1", "random 2", "random 9", "rails")
REFERENCES = ("local_world_aligned", "local", "world")
TYPES = {"r": "revolute", "p": "prismatic"}
INDICES = np.triu_indices(3)
COUNT = 2 * LANES + 3  # two whole blocks, and a part of one
EXACT = 2e-14  # of the largest entry: rounding, which grows with the number of joints


def random_arm(kinds: str, rng: np.random.Generator) -> str:
    """A URDF of joints in random places with random axes and bodies; of each, "r" or "p" tells whether it slides."""
    links = ['<link name="base"/>']
    for number, kind in enumerate(kinds):
        axis = rng.normal(size=3) if number else np.array([0.0, 0.0, -1.0])
        factor = rng.uniform(-0.1, 0.1, (3, 3))
        inertia = np.trace(factor @ factor.T) * np.eye(3) - factor @ factor.T
        names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        words = " ".join(f'{name}="{value!r}"' for name, value in zip(names, inertia[INDICES].tolist(), strict=True))
        parent = f"link_{number}" if number else "base"
        links += [
            f'<link name="link_{number + 1}"><inertial>',
            f'<origin xyz="{_words(rng.uniform(-0.1, 0.1, 3))}" rpy="0.1 0.2 0.3"/>',
            f'<mass value="{rng.uniform(0.5, 3.0)}"/><inertia {words}/></inertial></link>',
            f'<joint name="joint_{number + 1}" type="{TYPES[kind]}"><parent link="{parent}"/>',
            f'<child link="link_{number + 1}"/><axis xyz="{_words(axis / np.linalg.norm(axis))}"/>',
            f'<origin xyz="{_words(rng.uniform(-0.5, 0.5, 3))}" rpy="{_words(rng.uniform(-3.0, 3.0, 3))}"/>',
            '<limit lower="-2.5" upper="2.5" effort="10" velocity="1"/></joint>',
        ]
    return f'<robot name="random">{"".join(links)}</robot>'


def _words(vector: Array) -> str:
    return " ".join(repr(number) for number in vector.tolist())


@pytest.fixture
def robot_of(bundled: Callable[[str], Robot], tmp_path: Path, rng: np.random.Generator) -> Callable[[str], Robot]:
    def load(name: str) -> Robot:
        if name == "panda":
            return load_arm("panda", tmp_path)
        if name in ("rails", *(f"random {joints}" for joints in (1, 2, 9))):
            kinds = "pprpr" if name == "rails" else "r" * int(name.split()[1])
            (tmp_path / "arm.urdf").write_text(random_arm(kinds, rng))
            return jacokin.load_robot(tmp_path / "arm.urdf", home=np.zeros(len(kinds)))
        return bundled(name)

    return load


def largest(array: Array) -> float:
    return max(1.0, float(np.abs(array).max()))


@pytest.mark.parametrize("name", ARMS)
def test_poses_and_jacobians_are_those_of_pinocchio(
    name: str, robot_of: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = robot_of(name)
    q = rng.uniform(-7.0, 7.0, (COUNT, robot.dof))
    for frame in (robot.default_frame, robot.frames[len(robot.frames) // 2], robot.frames[0]):
        one = np.array([robot.forward_kinematics(row, frame).homogeneous for row in q])
        assert_allclose(robot.forward_kinematics(q, frame), one, rtol=0.0, atol=EXACT * largest(one))
        for reference in REFERENCES:
            columns = np.array([robot.jacobian(row, frame, reference) for row in q])
            assert_allclose(robot.jacobian(q, frame, reference), columns, rtol=0.0, atol=EXACT * largest(columns))


@pytest.mark.parametrize("name", [name for name in ARMS if name != "panda"])
def test_dynamics_are_those_of_pinocchio(name: str, robot_of: Callable[[str], Robot], rng: np.random.Generator) -> None:
    robot = robot_of(name)
    q, v, a = rng.uniform(-3.0, 3.0, (3, COUNT, robot.dof))
    wall = jacokin.pose([0.0, 0.0, 1.0], rpy=[0.3, 1.2, -0.5])
    push = rng.normal(size=6)
    for many, one in (
        (robot.mass_matrix(q), [robot.mass_matrix(row) for row in q]),
        (robot.gravity(q), [robot.gravity(row) for row in q]),
        (robot.gravity(q, base=wall), [robot.gravity(row, base=wall) for row in q]),
        (robot.inverse_dynamics(q, v, a), [robot.inverse_dynamics(*rows) for rows in zip(q, v, a, strict=True)]),
        (
            robot.inverse_dynamics(q, v, a, external=push, base=wall),
            [robot.inverse_dynamics(*rows, external=push, base=wall) for rows in zip(q, v, a, strict=True)],
        ),
    ):
        assert_allclose(many, one, rtol=0.0, atol=EXACT * largest(np.array(one)))


@pytest.mark.parametrize("name", ["j2n6s300", "gen3", "rails"])
def test_mujoco_agrees(name: str, robot_of: Callable[[str], Robot], rng: np.random.Generator) -> None:
    robot = robot_of(name)
    model = to_mujoco(robot)
    data = mujoco.MjData(model)
    q = rng.uniform(-3.0, 3.0, (COUNT, robot.dof))
    site = model.site(robot.default_frame).id
    T, jacobians = robot.forward_kinematics(q), robot.jacobian(q)
    for row, pose, jacobian in zip(q, T, jacobians, strict=True):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        columns = np.zeros((6, model.nv))
        mujoco.mj_jacSite(model, data, columns[:3], columns[3:], site)
        assert_allclose(pose[:3, 3], data.site_xpos[site], rtol=0.0, atol=1e-13)
        assert_allclose(pose[:3, :3], data.site_xmat[site].reshape(3, 3), rtol=0.0, atol=1e-13)
        assert_allclose(jacobian, columns, rtol=0.0, atol=1e-13)


def test_armature_counts(tmp_path: Path, rng: np.random.Generator) -> None:
    (tmp_path / "arm.xml").write_text(
        '<mujoco><worldbody><body name="a"><joint name="one" axis="0 1 0" armature="0.3"/><geom size="0.1"/>'
        '<body name="b" pos="0 0 0.5"><joint name="two" type="slide" axis="1 0 1" armature="2"/><geom size="0.1"/>'
        "</body></body></worldbody></mujoco>"
    )
    robot = jacokin.load_robot(tmp_path / "arm.xml", home=np.zeros(2))
    q, v, a = rng.normal(size=(3, COUNT, 2))
    assert_allclose(robot.mass_matrix(q), [robot.mass_matrix(row) for row in q], rtol=0.0, atol=1e-12)
    one = [pin.rnea(robot.pin_model, robot.pin_model.createData(), *rows) for rows in zip(q, v, a, strict=True)]
    assert_allclose(robot.inverse_dynamics(q, v, a), one, rtol=0.0, atol=1e-12)


def test_a_number_of_rows_changes_no_bit(robot: Robot, rng: np.random.Generator) -> None:
    q = robot.sample(rng, COUNT)
    T, torques = robot.forward_kinematics(q), robot.gravity(q)
    for count in (1, LANES - 1, LANES, LANES + 1):
        assert np.array_equal(robot.forward_kinematics(q[:count]), T[:count])
        assert np.array_equal(robot.gravity(q[:count]), torques[:count])


def test_angles_of_many_turns(robot: Robot) -> None:
    q = np.zeros((3, 6))
    q[1] = 2e6  # beyond what the vectors take, so that its whole block is computed one by one
    q[2] = 1e5
    one = np.array([robot.forward_kinematics(row).homogeneous for row in q])
    assert_allclose(robot.forward_kinematics(q), one, rtol=0.0, atol=1e-14)


def test_sines_without_branches_are_those_with(rng: np.random.Generator) -> None:
    angles = [0.0, math.pi / 4, -math.pi / 4, math.pi, 1e-300, *rng.uniform(-20.0, 20.0, 2000)]
    angles += rng.uniform(-LARGEST_ANGLE, LARGEST_ANGLE, 2000).tolist()
    assert all(sin_cos_of_moderate(angle) == sin_cos(angle) for angle in angles)


def test_layouts_lists_and_no_rows(robot: Robot, rng: np.random.Generator) -> None:
    q = robot.sample(rng, 5)
    expected = robot.forward_kinematics(q)
    assert np.array_equal(robot.forward_kinematics(q.tolist()), expected)
    assert np.array_equal(robot.forward_kinematics(np.asfortranarray(q)), expected)
    assert np.array_equal(robot.forward_kinematics(q[::-1]), expected[::-1])
    none = np.empty((0, 6))
    assert robot.forward_kinematics(none).shape == (0, 4, 4)
    assert robot.jacobian(none).shape == (0, 6, 6)
    assert robot.mass_matrix(none).shape == (0, 6, 6)
    assert robot.inverse_dynamics(none, none, none).shape == robot.gravity(none).shape == (0, 6)


def test_refusals_name_the_row(robot: Robot, rng: np.random.Generator) -> None:
    q = robot.sample(rng, 4)
    wrong = q.copy()
    wrong[2, 3] = np.nan
    for call in (robot.forward_kinematics, robot.jacobian, robot.mass_matrix, robot.gravity):
        with pytest.raises(InvalidInputError, match="q must be finite; row 2 is not"):
            call(wrong)
        with pytest.raises(
            InvalidInputError, match=r"q must have shape \(6,\) or \(n, 6\) \[rad\], got shape \(4, 5\)"
        ):
            call(q[:, :5])
    with pytest.raises(InvalidInputError, match=r"same shape, got \(4, 6\), \(6,\) and \(4, 6\)"):
        robot.inverse_dynamics(q, q[0], q)
    with pytest.raises(InvalidInputError, match="too large"):
        robot.inverse_dynamics(q, np.full(q.shape, 1e200), q)
    with pytest.raises(InvalidInputError):
        robot.manipulability(q)
    with pytest.raises(UnknownNameError, match="end_efector"):
        robot.forward_kinematics(q, "end_efector")
    with pytest.raises(UnknownNameError, match="reference"):
        robot.jacobian(q, reference="here")


def test_without_masses_torques_are_refused(tmp_path: Path) -> None:
    arm = load_arm("panda", tmp_path)
    with pytest.raises(ModelError, match="masses"):
        arm.gravity(np.zeros((3, 7)))
