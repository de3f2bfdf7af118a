"""Gradients of answers: against finite differences of solving, J G = 1, and where there is none."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from benchmarks import few_joints
from jacokin import FreeAxis, IKResult, IKSolver, Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, SingularAnswerError, UnknownNameError
from tests.ik.test_few_joints import urdf_of
from tests.ik.test_fixed_joints import load
from tests.kernels.six_joints.arms import chain_of_arm

TOOL = jacokin.pose([0.05, 0.03, 0.1], rpy=[0.2, -0.4, 0.7])
AXIS = np.array([0.48, -0.6, 0.64])
STEP = 1e-6  # [m] and [rad] of the finite differences
Bundled = Callable[[str], Robot]
Solve = Callable[[pin.SE3], Array]


@cache
def written(folder: Path, name: str) -> Robot:
    """An arm of six joints of no structure, or one of fewer."""
    path = folder / f"{name}.urdf"
    few = few_joints.ARMS.get(name)
    path.write_text(urdf_of(chain_of_arm(name)) if few is None else few_joints.urdf_of(few))
    return jacokin.load_robot(path)


def moved(T: pin.SE3, twist: Array) -> pin.SE3:
    """A pose after a small twist (6,), local_world_aligned."""
    return pin.SE3(pin.exp3(twist[3:]) @ T.rotation, T.translation + twist[:3])


def differences(solve: Solve, T: pin.SE3) -> Array:
    """(dof, 6) the gradient of a function of a pose by central differences."""
    columns = [(solve(moved(T, step)) - solve(moved(T, -step))) / (2.0 * STEP) for step in STEP * np.eye(6)]
    return np.stack(columns, axis=1)


def near(solver: IKSolver, q: Array, axis: Array | None = None) -> Solve:
    """The answer nearest to a configuration as a function of a pose, or of one that may turn about an axis."""
    return lambda pose: solver.solve(pose if axis is None else FreeAxis(pose, axis=axis), q).q


def holding(solver: IKSolver, q: Array, joint: str, value: float) -> Solve:
    """The same with a joint held."""
    return lambda pose: np.array(solver.solve_all(pose, q, fixed={joint: value}).q[0])


def regular(solver: IKSolver, rng: np.random.Generator, size: int, joints: list[int] | None = None) -> list[Array]:
    """Configurations whose Jacobian, of some of the joints, has no small singular value, away from limits."""
    robot, found = solver.robot, list[Array]()
    while len(found) < size:
        q = robot.sample(rng)
        J = robot.jacobian(q, solver.frame)[:, joints or slice(None)]
        inside = np.minimum(q - robot.lower, robot.upper - q).min() > 0.01
        if inside and np.linalg.svd(J, compute_uv=False)[-1] > 0.05:
            found.append(q)
    return found


def answered(solver: IKSolver, target: jacokin.ik.targets.Target, q: Array) -> IKResult:
    """The answer at a configuration that reaches a target."""
    result = solver.solve(target, q)
    np.testing.assert_allclose(result.q, q, atol=1e-7)
    return result


def turned(solver: IKSolver, q: Array, angle: float) -> Solve:
    """The same about an axis, at one angle [rad]."""
    return lambda pose: solver.solve(FreeAxis(pose, axis=AXIS).at(angle), q).q


def check(gradient: Array, expected: Array) -> None:
    """Equal but for the differences' own error, which grows with the square of what is differentiated."""
    assert gradient.shape == expected.shape
    np.testing.assert_allclose(gradient, expected, atol=1e-5 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("tool", [None, TOOL], ids=["flange", "tool"])
@pytest.mark.parametrize("frame", ["end_effector", "gripsite"])
def test_six_joints_follow_as_solving_again_says(
    robot: Robot, rng: np.random.Generator, tool: pin.SE3 | None, frame: str
) -> None:
    solver = IKSolver(robot, frame, tool=tool, collision="ignore")
    check_six_joints(solver, rng)


def test_any_structure_of_six_joints(folder: Path, rng: np.random.Generator) -> None:
    check_six_joints(IKSolver(written(folder, "generic"), tool=TOOL), rng)


def check_six_joints(solver: IKSolver, rng: np.random.Generator) -> None:
    for q in regular(solver, rng, 5):
        T = solver.verifier.tool_pose(q).copy()
        check(solver.gradient(answered(solver, T, q)), differences(near(solver, q), T))


def test_a_small_motion_of_the_target_is_met(robot: Robot, rng: np.random.Generator) -> None:
    """J G = 1 in every reference."""
    solver = IKSolver(robot, collision="ignore")
    for q in regular(solver, rng, 10):
        result = answered(solver, robot.forward_kinematics(q), q)
        for reference in ("local_world_aligned", "local", "world"):
            J = robot.jacobian(result.q, reference=reference)
            np.testing.assert_allclose(J @ solver.gradient(result, reference=reference), np.eye(6), atol=1e-10)
        np.testing.assert_array_equal(solver.gradient(result), solver.gradient(result, reference="local_world_aligned"))


def test_references_are_those_of_the_tool(robot: Robot, rng: np.random.Generator) -> None:
    solver = IKSolver(robot, tool=TOOL, collision="ignore")
    (q,) = regular(solver, rng, 1)
    T = solver.verifier.tool_pose(q).copy()
    result, twist = answered(solver, T, q), 1e-6 * rng.standard_normal(6)
    local, world = T * pin.exp6(twist), pin.exp6(twist) * T
    for reference, pose in (("local", local), ("world", world), ("local_world_aligned", moved(T, twist))):
        step = solver.solve(pose, q).q - result.q
        np.testing.assert_allclose(solver.gradient(result, reference=reference) @ twist, step, atol=1e-9)


@pytest.mark.parametrize("tool", [None, TOOL], ids=["flange", "tool"])
def test_seven_joints_with_the_parameter_held(bundled: Bundled, rng: np.random.Generator, tool: pin.SE3 | None) -> None:
    solver = IKSolver(bundled("j2s7s300"), tool=tool, collision="ignore")
    check_seven(solver, rng, "joint_3")


@pytest.mark.parametrize("name", ["offsets", "slanted"])
def test_seven_joints_of_any_structure(tmp_path: Path, rng: np.random.Generator, name: str) -> None:
    solver = IKSolver(load(tmp_path, name), tool=TOOL)
    q = solver.robot.sample(rng)
    result = solver.solve(solver.verifier.tool_pose(q), q)
    (held,) = [
        name for name, angle in zip(solver.robot.joint_names, result.q, strict=True) if angle == result.parameter
    ]
    check_seven(solver, rng, held)


def check_seven(solver: IKSolver, rng: np.random.Generator, held: str) -> None:
    """Both gradients of arms of seven joints, one of which is the parameter."""
    index = solver.robot.joint_index(held)
    others = [joint for joint in range(7) if joint != index]
    for q in regular(solver, rng, 2, others):
        T = solver.verifier.tool_pose(q).copy()
        result = answered(solver, T, q)
        assert result.parameter is not None
        gradient, p = solver.gradient(result), result.parameter
        check(gradient, differences(holding(solver, q, held, p), T))
        assert not gradient[index].any()
        along = solver.parameter_gradient(result)
        ahead, back = (holding(solver, q, held, p + step)(T) for step in (STEP, -STEP))
        check(along, (ahead - back) / (2.0 * STEP))
        assert along[index] == 1.0


def test_about_a_free_axis(robot: Robot, rng: np.random.Generator) -> None:
    """The target turns with its pose; held is the angle about the axis."""
    solver = IKSolver(robot, tool=TOOL, collision="ignore")
    for q in regular(solver, rng, 5):
        back = pin.SE3(pin.AngleAxis(-0.7, AXIS).toRotationMatrix(), np.zeros(3))
        target = FreeAxis(solver.verifier.tool_pose(q) * back, axis=AXIS)
        result = answered(solver, target, q)
        assert result.parameter is not None
        assert result.parameter == pytest.approx(0.7, abs=1e-6)
        check(solver.gradient(result), differences(turned(solver, q, result.parameter), target.pose))
        behind, ahead = (turned(solver, q, result.parameter + step)(target.pose) for step in (-STEP, STEP))
        check(solver.parameter_gradient(result), (ahead - behind) / (2.0 * STEP))


@pytest.mark.parametrize("name", ["SO-101", "five with parallel axes"])
def test_five_joints_about_a_free_axis(folder: Path, rng: np.random.Generator, name: str) -> None:
    """The angle about the axis follows, too: the answers are points."""
    robot = written(folder, name)
    solver = IKSolver(robot, few_joints.tip(robot), collision="ignore")
    for q in robot.sample(rng, 5):
        T = solver.verifier.tool_pose(q).copy()
        result = answered(solver, FreeAxis(T, axis=AXIS), q)
        gradient = solver.gradient(result)
        check(gradient, differences(near(solver, q, AXIS), T))
        with pytest.raises(InvalidInputError, match="separate solutions"):
            solver.parameter_gradient(result)


def test_three_joints_at_a_position(folder: Path, rng: np.random.Generator) -> None:
    robot = written(folder, "three")
    solver = IKSolver(robot, few_joints.tip(robot), collision="ignore")
    for q in robot.sample(rng, 5):
        result = answered(solver, solver.verifier.tool_pose(q).translation.copy(), q)
        gradient = solver.gradient(result)
        np.testing.assert_allclose(gradient[:, 3:], 0.0, atol=1e-9 * np.abs(gradient).max())
        J = robot.jacobian(q, solver.frame)[:3]
        np.testing.assert_allclose(J @ gradient[:, :3], np.eye(3), atol=1e-9)


def test_cotangents_are_pulled_back_along_motions(bundled: Bundled, rng: np.random.Generator) -> None:
    """Its product with a change of the poses is that of the cotangents with the change of the answers."""
    for name in ("j2n6s300", "j2s7s300"):
        solver = IKSolver(bundled(name), tool=TOOL, collision="ignore")
        rows = np.array(regular(solver, rng, 4))
        poses = [solver.verifier.tool_pose(q).copy() for q in rows]
        weights, twists = rng.standard_normal(rows.shape), rng.standard_normal((4, 6))
        pulled = solver.pull_back(rows, weights)
        for T, q, weight, twist, found in zip(poses, rows, weights, twists, pulled, strict=True):
            change = np.zeros((4, 4))
            change[:3, :3], change[:3, 3] = pin.skew(twist[3:]) @ T.rotation, twist[:3]
            dq = solver.gradient(answered(solver, T, q)) @ twist
            assert np.sum(found * change) == pytest.approx(weight @ dq, rel=1e-6)


def test_pulled_back_rows_that_are_singular_or_not_asked_for(bundled: Bundled) -> None:
    robot = bundled("j2s6s300")
    q, cotangents = np.array([robot.home, straight(robot), straight(robot)]), np.ones((3, 6))
    cotangents[2] = 0.0
    found = IKSolver(robot).pull_back(q, cotangents)
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1, :3]).all()
    assert not found[2].any()


def straight(robot: Robot) -> Array:
    """A j2s6s300's home with a straight wrist: joints 4 and 6 turn about one line."""
    q = robot.home.copy()
    q[4] = np.pi
    return q


def test_a_singular_answer_has_none(bundled: Bundled) -> None:
    robot = bundled("j2s6s300")
    solver, q = IKSolver(robot, collision="ignore"), straight(robot)
    result = solver.solve(robot.forward_kinematics(q), q)
    assert result.success
    with pytest.raises(SingularAnswerError, match=r"is singular, smallest singular value \S+e-") as raised:
        solver.gradient(result)
    assert 0.0 <= raised.value.singular_value < 1e-6
    # About an axis across the line the six joints do follow with the angle let go, but not with it held.
    about = solver.solve(FreeAxis(robot.forward_kinematics(q), axis=AXIS), q)
    with pytest.raises(SingularAnswerError, match="with the free angle held"):
        solver.parameter_gradient(about)


def test_a_fold_of_the_parameter_has_none(bundled: Bundled) -> None:
    robot = bundled("j2s7s300")
    solver, q = IKSolver(robot, collision="ignore"), robot.home.copy()
    q[5] = np.pi  # joints 5 and 7 turn about one line
    with pytest.raises(SingularAnswerError, match="with joint_3 held"):
        solver.gradient(solver.solve(robot.forward_kinematics(q), q))


def test_a_joint_on_its_limit_follows_one_way(robot: Robot, rng: np.random.Generator) -> None:
    solver = IKSolver(robot, collision="ignore")
    (q,) = regular(solver, rng, 1)
    q[1] = robot.lower[1]
    result = answered(solver, robot.forward_kinematics(q), q)
    gradient = solver.gradient(result)
    inwards = robot.jacobian(result.q)[:, 1] * 1e-6
    there = solver.solve(moved(robot.forward_kinematics(result.q), inwards), result.q)
    np.testing.assert_allclose(there.q - result.q, gradient @ inwards, atol=1e-9)
    assert there.q[1] > result.q[1]


def test_what_has_no_gradient_says_why(robot: Robot, bundled: Bundled, folder: Path) -> None:
    solver, seven = IKSolver(robot, collision="ignore"), IKSolver(bundled("j2s7s300"), collision="ignore")
    T = robot.forward_kinematics(robot.home)
    good = solver.solve(T, robot.home)
    for wrong in (None, good.q, T):
        with pytest.raises(InvalidInputError, match="result must be an IKResult"):
            solver.gradient(wrong)  # type: ignore[arg-type]  # that is the test
    with pytest.raises(InvalidInputError, match="result must be a success: UNREACHABLE"):
        solver.gradient(solver.solve(jacokin.pose([3.0, 0.0, 0.0])))
    for method in ("auto", "qp"):  # the seed is the answer, so that its orientation is met by chance
        by = IKSolver(robot, method=method, collision="ignore")
        with pytest.raises(InvalidInputError, match="a position leaves 3 of the 6 joints of j2n6s300 undetermined"):
            by.gradient(by.solve(T.translation.copy(), robot.home))
        assert np.isfinite(by.gradient(by.solve(T, robot.home))).all()
    with pytest.raises(InvalidInputError, match="result is of another arm: it has 6 joints, j2s7s300 7"):
        seven.gradient(good)
    with pytest.raises(InvalidInputError, match="separate solutions, not a curve"):
        solver.parameter_gradient(good)
    with pytest.raises(UnknownNameError, match="unknown reference 'tool'"):
        solver.gradient(good, reference="tool")
    by_qp = IKSolver(bundled("j2s7s300"), method="qp", collision="ignore")
    pose = bundled("j2s7s300").forward_kinematics(bundled("j2s7s300").home)
    with pytest.raises(InvalidInputError, match="a pose leaves 1 of the 7 joints"):
        by_qp.gradient(by_qp.solve(pose, bundled("j2s7s300").home))
    five = written(folder, "SO-101")
    few = IKSolver(five, few_joints.tip(five), collision="ignore")
    q = np.full(5, 0.3)
    with pytest.raises(InvalidInputError, match="the 5 joints of arm cannot follow every motion of a pose"):
        few.gradient(few.solve(few.verifier.tool_pose(q).copy(), q))


def test_malformed_cotangents_are_refused(robot: Robot, folder: Path) -> None:
    solver, q = IKSolver(robot), robot.home[np.newaxis]
    with pytest.raises(InvalidInputError, match=r"q must have shape \(n, 6\)"):
        solver.pull_back(robot.home, robot.home)
    with pytest.raises(InvalidInputError, match=r"cotangents must have the shape of q, \(1, 6\), got shape \(2, 6\)"):
        solver.pull_back(q, np.ones((2, 6)))
    assert np.isnan(solver.pull_back(q, np.full((1, 6), np.nan))[0, :3]).all()
    five = IKSolver(written(folder, "SO-101"), collision="ignore")
    with pytest.raises(InvalidInputError, match="cannot follow every motion of a pose"):
        five.pull_back(np.zeros((1, 5)), np.ones((1, 5)))
