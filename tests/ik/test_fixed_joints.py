"""`solve_all(..., fixed=...)`: arms of more than six joints, all but six held."""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, StructureError, UnknownNameError
from jacokin.ik import IKSolver, Scene, SolutionSet, Sphere, fixed_joints
from jacokin.ik.closed_form import ClosedForm
from jacokin.ik.fixed_joints import hold
from jacokin.ik.geometry import ArmGeometry
from jacokin.ik.solutions.points import Points
from jacokin.ik.structures import measure_general
from jacokin.model.angles import circular_distance, wrap_to_pi
from tests.robot_files import joint as urdf_joint
from tests.robot_files import load_text, serial_urdf

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
    text = serial_urdf(ARMS[name], [(-2.9, 2.9)] * 7, velocity=1.0, name=name.replace(" ", "_"))
    text = text.replace('1" type="revolute"', f'1" type="{first}"')
    return re.sub("<limit [^>]*>", "", text, count=1) if first == "continuous" else text


def load(folder: Path, name: str, first: str = "revolute") -> Robot:
    return load_text(folder / "arm.urdf", text_of(name, first))


@pytest.mark.one_quick
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


def written_anew(solver: IKSolver, target: pin.SE3, q: Array, fixed: dict[str, float]) -> Points:
    """The branches of the arm of six joints that is left, its model made and measured for these values alone."""
    robot, values = solver.robot, np.full(solver.robot.dof, np.nan)
    for name, value in fixed.items():
        values[robot.joint_index(name)] = value
    free = np.isnan(values)
    model, frame_id = hold(robot.pin_model, robot.frame_id(solver.frame), values)
    form = ClosedForm(model, frame_id, solver.tool, robot.lower[free], robot.upper[free])
    return form.solve_all(target.homogeneous, q[free])


def assert_equal(found: SolutionSet, anew: Points, free: list[int]) -> None:
    """The same branches, measured in the same way; what was in doubt may be settled."""
    if anew.dropped and len(found) > len(anew):
        return
    assert len(found) == len(anew)
    for each, row in enumerate(anew.q):
        near = np.abs(wrap_to_pi(found.q[:, free] - row)).max(axis=1)
        index = int(near.argmin())
        assert near[index] < 1e-8
        assert found.within_limits[index] == anew.within_limits[each]
        assert found.position_error[index] == pytest.approx(anew.position_error[each], abs=1e-11)


@pytest.mark.one_quick
@pytest.mark.parametrize("name", [*ARMS, "j2s7s300"])
def test_values_do_not_depend_on_what_is_kept_of_others(tmp_path: Path, rng: np.random.Generator, name: str) -> None:
    """Every joint held, at random and where axes are parallel: as the arm of six joints that is left."""
    robot = load(tmp_path, name) if name in ARMS else jacokin.load_robot(name)
    tool = jacokin.pose((0.02, -0.03, 0.1), rpy=(0.3, -0.2, 0.5))
    solver = IKSolver(robot, tool=tool, collision="ignore")
    for joint in range(robot.dof):
        if name == "no offsets" and joint == 3:
            continue  # shoulder and wrist stay as far apart as they are: five freedoms
        rows = robot.sample(rng, 3)
        if robot.lower[joint] < 0.0 < robot.upper[joint] and joint in (2, 4):
            rows[1, joint] = 0.0
        for q in rows:
            target, fixed = robot.forward_kinematics(q) * tool, {robot.joint_names[joint]: float(q[joint])}
            others = [index for index in range(robot.dof) if index != joint]
            assert_equal(solver.solve_all(target, q, fixed=fixed), written_anew(solver, target, q, fixed), others)


@pytest.mark.parametrize("joint", ["joint_1", "joint_3", "joint_7"])
def test_other_values_need_no_other_labelling(
    monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator, joint: str
) -> None:
    """Which takes 50 ms to find: once for all values."""
    ranked = []

    def measure(chain: Array, labellings: list[float] | None = None) -> ArmGeometry:
        ranked.append(labellings is None)
        return measure_general(chain, labellings)

    monkeypatch.setattr(fixed_joints, "measure_general", measure)
    robot = jacokin.load_robot("j2s7s300")
    solver, index = IKSolver(robot, collision="ignore"), robot.joint_index(joint)
    for q in robot.sample(rng, 30):
        found = solver.solve_all(robot.forward_kinematics(q), q, fixed={joint: float(q[index])})
        assert circular_distance(found.q[0], q) < 1e-6
    assert sum(ranked) == 1


def test_a_rail_moves_the_base_only(tmp_path: Path, rng: np.random.Generator) -> None:
    """Both the rail and a joint of the arm are held; another place of the rail is the target moved back by as much."""
    text = text_of("offsets").replace('<link name="link_0"/>', RAIL)
    (tmp_path / "railed.urdf").write_text(text)
    robot = jacokin.load_robot(tmp_path / "railed.urdf")
    assert robot.dof == 8
    solver = IKSolver(robot, collision="ignore")
    for held in ("joint_1", "joint_4", "joint_7"):
        q = robot.sample(rng)
        target, fixed = robot.forward_kinematics(q), {"rail": float(q[0]), held: float(q[robot.joint_index(held)])}
        here = solver.solve_all(target, q, fixed=fixed)
        free = [i for i in range(8) if robot.joint_names[i] not in fixed]
        assert_equal(here, written_anew(solver, target, q, fixed), free)
        moved = pin.SE3(target.rotation, target.translation - np.array([q[0] - 0.1, 0.0, 0.0]))
        there = solver.solve_all(moved, q, fixed=fixed | {"rail": 0.1})
        np.testing.assert_allclose(there.q[:, 1:], here.q[:, 1:], atol=1e-8)


RAIL = '<link name="floor"/><link name="link_0"/>' + urdf_joint(
    "rail", "floor", "link_0", (0.0, 0.0, 0.0), kind="prismatic", axis=(1.0, 0.0, 0.0), limits=(-1.0, 1.0), velocity=1.0
)


def test_a_joint_beyond_the_frame_may_be_held(tmp_path: Path, rng: np.random.Generator) -> None:
    robot = load(tmp_path, "offsets")
    solver = IKSolver(robot, "link_6", collision="ignore")
    q = robot.sample(rng)
    target = robot.forward_kinematics(q, "link_6")
    assert circular_distance(solver.solve_all(target, q, fixed={"joint_7": float(q[6])}).q[0], q) < 1e-6
    with pytest.raises(StructureError, match="'joint_7'"):
        solver.solve_all(target, q, fixed={"joint_2": float(q[1])})


def test_values_that_leave_five_freedoms(tmp_path: Path, rng: np.random.Generator) -> None:
    """With joint 2 at zero, axes 1 and 3 are one line; beside it they are not."""
    robot = load(tmp_path, "offsets")
    solver = IKSolver(robot, collision="ignore")
    q = robot.sample(rng)
    for value in (0.0, 0.5):
        q[1] = value
        target = robot.forward_kinematics(q)
        if value:
            assert circular_distance(solver.solve_all(target, q, fixed={"joint_2": value}).q[0], q) < 1e-6
        else:
            with pytest.raises(StructureError, match="5 independent ways"):
                solver.solve_all(target, q, fixed={"joint_2": value})


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
    six, five = jacokin.load_robot(), jacokin.load_robot(tip="link_5")
    for few, joint in ((six, "joint_3"), (five, "joint_2")):
        with pytest.raises(InvalidInputError, match=f"of more than six joints; {few.name} has {few.dof}$"):
            IKSolver(few).solve_all(few.forward_kinematics(few.home), fixed={joint: 3.0})
    assert len(solver.solve_all(target)) > 0  # without: a set with one parameter
