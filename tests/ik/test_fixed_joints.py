"""`solve_all(..., fixed=...)`: arms of more than six joints, all but six held."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.ik import IKSolver, Scene, Sphere
from jacokin.model.angles import circular_distance

# The joints of three arms of seven joints that are not built like a Jaco: origin [m] and rpy [rad] before each joint.
H = np.pi / 2
ARMS = {
    # Spherical shoulder and wrist, no offsets.
    "no offsets": (
        ((0, 0, 0.36), (0, 0, 0)),
        ((0, 0, 0), (-H, 0, 0)),
        ((0, -0.42, 0), (H, 0, 0)),
        ((0, 0, 0), (H, 0, 0)),
        ((0, 0.4, 0), (-H, 0, 0)),
        ((0, 0, 0), (-H, 0, 0)),
        ((0, -0.126, 0), (H, 0, 0)),
    ),
    # Offsets at the elbow and the wrist.
    "offsets": (
        ((0, 0, 0.33), (0, 0, 0)),
        ((0, 0, 0), (-H, 0, 0)),
        ((0, -0.32, 0), (H, 0, 0)),
        ((0.08, 0, 0), (H, 0, 0)),
        ((-0.08, 0.38, 0), (-H, 0, 0)),
        ((0, 0, 0), (H, 0, 0)),
        ((0.09, 0, 0), (H, 0, 0)),
    ),
    # No structure.
    "slanted": (
        ((0.1, 0, 0.2), (0.3, 0.2, 0.1)),
        ((0.05, 0.1, 0), (-1.2, 0.4, 0)),
        ((0.1, -0.3, 0.1), (1.4, 0, 0.3)),
        ((0.08, 0, 0.2), (1.1, 0.5, 0)),
        ((-0.05, 0.3, 0.1), (-1.3, 0, 0.7)),
        ((0.1, 0, 0.05), (1.5, 0.2, 0)),
        ((0.07, 0.02, 0.1), (1.2, -0.3, 0.4)),
    ),
}


def text_of(name: str, first: str = "revolute") -> str:
    """A URDF of one of those arms, limits of 2.9 rad; the first joint may be continuous, or slide."""
    links = ['<link name="base"/>']
    for index, (xyz, rpy) in enumerate(ARMS[name], start=1):
        kind = first if index == 1 else "revolute"
        limit = '<limit lower="-2.9" upper="2.9" velocity="1" effort="1"/>' if kind != "continuous" else ""
        links.append(
            f'<link name="link_{index}"/><joint name="joint_{index}" type="{kind}"><axis xyz="0 0 1"/>{limit}'
            f'<origin xyz="{" ".join(map(str, xyz))}" rpy="{" ".join(map(str, rpy))}"/>'
            f'<parent link="{"base" if index == 1 else f"link_{index - 1}"}"/><child link="link_{index}"/></joint>'
        )
    return f'<robot name="{name.replace(" ", "_")}">{"".join(links)}</robot>'


def load(folder: Path, name: str, first: str = "revolute") -> Robot:
    path = folder / "arm.urdf"
    path.write_text(text_of(name, first))
    return jacokin.load_robot(path)


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("joint", ["joint_1", "joint_3", "joint_7"])
def test_every_branch_holds_the_joint_and_reaches_the_pose(
    tmp_path: Path, rng: np.random.Generator, name: str, joint: str
) -> None:
    robot = load(tmp_path, name)
    solver = IKSolver(robot)
    for q in robot.sample(rng, 2):
        held = float(q[robot.joint_index(joint)])
        target = robot.forward_kinematics(q)
        branches = solver.solve_all(target, q, fixed={joint: held})
        assert circular_distance(branches.q[0], q) < 1e-6
        assert (branches.q[:, robot.joint_index(joint)] == held).all()
        for row, margin, away in zip(branches.q, branches.margin, branches.distance, strict=True):
            np.testing.assert_allclose(robot.forward_kinematics(row).homogeneous, target.homogeneous, atol=1e-10)
            np.testing.assert_allclose(margin, np.minimum(row - robot.lower, robot.upper - row))
            assert away == pytest.approx(np.linalg.norm(row - q), abs=1e-9)
        np.testing.assert_array_equal(branches.within_limits, [robot.within_limits(row) for row in branches.q])
        np.testing.assert_array_equal(branches.nearest(), branches.q[np.flatnonzero(branches.within_limits)[0]])
        # A branch that Newton's method finds from anywhere, with that joint held, is one of them.
        assert all(circular_distance(branches.q, found).min() < 1e-5 for found in by_newton(robot, target, q, joint))


def by_newton(robot: Robot, target: pin.SE3, q: Array, joint: str) -> list[Array]:
    """Configurations that reach a pose with one joint held, regular ones, from random starts."""
    others = [index for index in range(robot.dof) if robot.joint_names[index] != joint]
    found = []
    for start in np.random.default_rng(1).uniform(-np.pi, np.pi, (12, len(others))):
        x = q.copy()
        x[others] = start
        for _ in range(30):
            error = pin.log6(robot.forward_kinematics(x).actInv(target)).vector
            J = robot.jacobian(x, reference="local")[:, others]
            if np.linalg.norm(error) < 1e-11:
                if np.linalg.svd(J, compute_uv=False)[-1] > 1e-3:
                    found.append(x)
                break
            step = np.linalg.lstsq(J, error, rcond=None)[0]
            x[others] += step * min(1.0, 0.7 / np.linalg.norm(step))
    assert found
    return found


def test_a_jaco_of_seven_joints_agrees_with_its_family(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot("j2s7s300")
    solver = IKSolver(robot, collision="ignore")
    q = robot.sample(rng)
    target = robot.forward_kinematics(q)
    interval = solver.solve_all(target, q).intervals[0]
    value = 0.5 * (interval.start + interval.stop)
    held = {"joint_3": float(interval.at(value)[2])}
    branches = solver.solve_all(target, fixed=held)
    assert circular_distance(branches.q, interval.at(value)).min() < 1e-8


def test_a_rail_may_be_held(tmp_path: Path, rng: np.random.Generator) -> None:
    robot = load(tmp_path, "offsets", "prismatic")
    q = robot.sample(rng)
    target = robot.forward_kinematics(q)
    branches = IKSolver(robot).solve_all(target, q, fixed={"joint_1": float(q[0])})
    np.testing.assert_allclose(branches.q[0], q, atol=1e-6)


def test_contact_and_pickles(tmp_path: Path, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot("j2s7s300")
    q = robot.home
    target = robot.forward_kinematics(q)
    ball = Scene([Sphere("ball", 0.05, target.translation)])
    branches = IKSolver(robot, scene=ball, collision="report").solve_all(target, q, fixed={"joint_3": float(q[2])})
    assert branches.touching is not None
    assert any("ball" in pair for pair in branches.touching[0])
    again = pickle.loads(pickle.dumps(branches))
    np.testing.assert_array_equal(again.q, branches.q)
    np.testing.assert_array_equal(again.margin, branches.margin)


def test_what_may_not_be_held(tmp_path: Path) -> None:
    robot = load(tmp_path, "offsets")
    solver = IKSolver(robot)
    target = robot.forward_kinematics(robot.home)
    with pytest.raises(UnknownNameError, match="joint_33"):
        solver.solve_all(target, fixed={"joint_33": 0.1})
    with pytest.raises(InvalidInputError, match=r"fixed\['joint_3'\] = 3 is outside the limits -2.9 to 2.9"):
        solver.solve_all(target, fixed={"joint_3": 3.0})
    with pytest.raises(InvalidInputError, match=r"fixed\['joint_3'\] must be"):
        solver.solve_all(target, fixed={"joint_3": float("nan")})
    for wrong in ({}, {"joint_1": 0.0, "joint_2": 0.0}):
        with pytest.raises(InvalidInputError, match="fixed must hold all joints but six: 1 of offsets's 7"):
            solver.solve_all(target, fixed=wrong)
    with pytest.raises(InvalidInputError, match="fixed must be a dict"):
        solver.solve_all(target, fixed=[("joint_3", 0.1)])  # type: ignore[arg-type]
    six = jacokin.load_robot()
    with pytest.raises(InvalidInputError, match="0 of j2n6s300's 6, not 1"):
        IKSolver(six).solve_all(six.forward_kinematics(six.home), fixed={"joint_3": 3.0})
    assert len(solver.solve_all(target)) > 0  # without: a set with one parameter
