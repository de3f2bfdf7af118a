"""The QP: global success, exact limits, true statuses."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import qpsolvers

import jacokin
from jacokin import FreeAxis, IKSolver, Robot, Status
from jacokin.arrays import Array
from jacokin.errors import MissingExtraError, SolveError, StructureError, UnknownNameError
from jacokin.ik import qp_backend
from jacokin.model import poses, urdf_folder
from tests.robot_files import load_text

CRANE = """<robot name="crane">
<link name="base"/><link name="mast"/><link name="slide"/><link name="hook"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="mast"/><axis xyz="0 0 1"/>
  <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<joint name="slide" type="prismatic"><parent link="mast"/><child link="slide"/><origin xyz="0.1 0 0"/>
  <axis xyz="1 0 0"/><limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>
<joint name="tilt" type="revolute"><parent link="slide"/><child link="hook"/><origin xyz="0.1 0 0"/>
  <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
</robot>"""


def check_success(robot: Robot, result: jacokin.IKResult, target: pin.SE3, frame: str | None = None) -> None:
    """The promise of a success, measured here and not taken from the result."""
    assert result.success, str(result)
    assert (result.q >= robot.lower).all()
    assert (result.q <= robot.upper).all()
    reached = robot.forward_kinematics(result.q, frame)
    assert np.linalg.norm(reached.translation - target.translation) <= 1e-6
    assert np.linalg.norm(pin.log3(reached.rotation.T @ target.rotation)) <= 1e-6


@pytest.mark.parametrize("qp_solver", ["daqp", "quadprog", "proxqp", "osqp"])
def test_every_qp_solver_solves_every_reachable_pose(robot: Robot, rng: np.random.Generator, qp_solver: str) -> None:
    solver = IKSolver(robot, method="qp", qp_solver=qp_solver)
    for q in robot.sample(rng, 10 if qp_solver == "osqp" else 40):
        target = robot.forward_kinematics(q)
        result = solver.solve(target)
        check_success(robot, result, target)
        assert result.method == "qp"
        assert result.qp_solver == qp_solver
        assert result.iterations > 0


@pytest.mark.slow
@pytest.mark.parametrize("count", [8, pytest.param(20, marks=pytest.mark.slow)])  # four limits in turn
def test_configurations_on_a_limit_are_solved_on_the_limit(robot: Robot, rng: np.random.Generator, count: int) -> None:
    solver = IKSolver(robot, method="qp")
    for index, q in enumerate(robot.sample(rng, count)):
        q[1 + index % 2] = (robot.lower, robot.upper)[index // 2 % 2][1 + index % 2]
        target = robot.forward_kinematics(q)
        check_success(robot, solver.solve(target, seed=q + 0.1), target)


@pytest.mark.parametrize("frame", ["link_3", "wristsite", "pinchsite"])
def test_any_frame_can_be_brought_to_a_target(robot: Robot, rng: np.random.Generator, frame: str) -> None:
    solver = IKSolver(robot, frame, method="qp")
    target = robot.forward_kinematics(robot.sample(rng), frame)
    check_success(robot, solver.solve(target), target, frame)


def test_a_tool_is_a_constant_pose_after_the_frame(robot: Robot, rng: np.random.Generator) -> None:
    T_frame_tool = jacokin.pose([0.01, -0.02, 0.15], rpy=[0.2, 0.1, -0.4])
    q = robot.sample(rng)
    target = robot.forward_kinematics(q, "link_6") * T_frame_tool
    result = IKSolver(robot, "link_6", tool=T_frame_tool, method="qp").solve(target)
    check_success(robot, result, target * T_frame_tool.inverse(), "link_6")


def test_position_only_leaves_the_orientation_free(robot: Robot) -> None:
    result = IKSolver(robot, method="qp").solve([0.35, -0.2, 0.45]).raise_for_status()
    np.testing.assert_allclose(robot.forward_kinematics(result.q).translation, [0.35, -0.2, 0.45], atol=1e-6)
    assert result.orientation_error == 0.0
    tool = IKSolver(robot, tool=jacokin.pose([0, 0, 0.2]), method="qp").solve([0.35, -0.2, 0.45])
    tip = robot.forward_kinematics(tool.raise_for_status().q).act(np.array([0.0, 0.0, 0.2]))
    np.testing.assert_allclose(tip, [0.35, -0.2, 0.45], atol=1e-6)


def test_own_limits_bind(rng: np.random.Generator) -> None:
    narrow = jacokin.load_robot(limits={"joint_1": (0.0, 1.5), "joint_4": (-1.0, 1.0)})
    solver = IKSolver(narrow, method="qp")
    for q in narrow.sample(rng, 10):
        target = narrow.forward_kinematics(q)
        check_success(narrow, solver.solve(target), target)


def test_only_the_arm_moves_whatever_else_the_file_holds() -> None:
    # A hand in the file changes nothing: same joints, same answer.
    from jacokin.model import urdf_folder

    plain = jacokin.load_robot(urdf_folder() / "jaco_arm.xml")
    both = jacokin.load_robot(urdf_folder() / "j2n6s300.xml", tip="wristsite")
    assert plain.joint_names == both.joint_names
    target = plain.forward_kinematics(plain.home, "wristsite")
    answers = [IKSolver(r, "wristsite", method="qp").solve(target, seed=plain.home + 0.2).q for r in (plain, both)]
    np.testing.assert_allclose(answers[0], answers[1], atol=1e-9)


def test_results_repeat_and_randomness_is_an_argument(robot: Robot, rng: np.random.Generator) -> None:
    solver = IKSolver(robot, method="qp")
    target = robot.forward_kinematics(robot.sample(rng))
    first, second = solver.solve(target), solver.solve(target)
    np.testing.assert_array_equal(first.q, second.q)
    seeded = [solver.solve(target, rng=np.random.default_rng(5)).q for _ in range(2)]
    np.testing.assert_array_equal(seeded[0], seeded[1])


def test_unlimited_joints_come_in_the_copy_nearest_to_the_seed(robot: Robot) -> None:
    solver = IKSolver(robot, method="qp")
    target = robot.forward_kinematics(robot.home)
    turned = np.where(robot.unlimited, 4 * math.pi, 0.0)
    np.testing.assert_allclose(solver.solve(target, robot.home + turned).q, robot.home + turned, atol=1e-6)


def test_a_seed_outside_the_limits_is_moved_inside_and_the_message_says_so(robot: Robot) -> None:
    target = robot.forward_kinematics(robot.home)
    result = IKSolver(robot, method="qp").solve(target, seed=np.zeros(6))
    assert result.success
    assert "joint_2, joint_3" in result.message
    turned = np.array(robot.home)
    turned[1] -= 2 * math.pi  # the same pose one turn below its range
    np.testing.assert_allclose(IKSolver(robot, method="qp").solve(target, turned).q, robot.home, atol=1e-6)


def test_out_of_reach_is_a_status_with_the_closest_pose(robot: Robot) -> None:
    solver = IKSolver(robot, method="qp")
    result = solver.solve([2.0, 0.0, 0.3])
    assert result.status is Status.UNREACHABLE
    assert not result.success
    assert robot.within_limits(result.q)
    # The least that 40 starts of a bounded quasi-Newton search found: the arm stretched at the target.
    assert result.position_error == pytest.approx(1.08895, abs=1e-5)
    with pytest.raises(SolveError, match="UNREACHABLE") as error:
        result.raise_for_status()
    assert error.value.result is result
    quick = solver.solve([2.0, 0.0, 0.3], closest=False)
    assert quick.status is Status.UNREACHABLE
    far = solver.solve(jacokin.pose([2e3, 0.0, 300.0], down=True))
    assert far.status is Status.UNREACHABLE
    assert robot.within_limits(far.q)


def test_no_convergence_counts_its_starts(robot: Robot) -> None:
    result = IKSolver(robot, method="qp", max_restarts=3).solve(jacokin.pose([0.0, 0.0, 0.05], down=True))
    assert result.status is Status.NO_CONVERGENCE
    assert result.restarts >= 3
    assert robot.within_limits(result.q)


def test_a_failing_qp_solver_is_replaced_and_the_result_says_by_which(
    robot: Robot, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    solve = qp_backend._solve

    def broken(problem: Any, qp_solver: str) -> Array | None:
        return np.full(6, np.nan) if qp_solver == "proxqp" else solve(problem, qp_solver)

    monkeypatch.setattr(qp_backend, "_solve", broken)
    target = robot.forward_kinematics(robot.sample(rng))
    result = IKSolver(robot, method="qp", qp_solver="proxqp").solve(target)
    check_success(robot, result, target)
    assert result.qp_solver == "proxqp, then daqp"
    monkeypatch.setattr(qp_backend, "_solve", lambda *_: np.full(6, np.nan))
    failed = IKSolver(robot, method="qp").solve(target)
    assert failed.status is Status.SOLVER_ERROR
    assert robot.within_limits(failed.q)


def test_a_solver_that_is_not_installed_names_its_extra(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    installed = ["daqp", "osqp"]
    monkeypatch.setattr(qpsolvers, "available_solvers", installed)
    for name, extra in (("quadprog", "quadprog"), ("proxqp", "proxqp")):
        with pytest.raises(MissingExtraError, match=rf"{name}.*pip install '\.\[{extra}\]'"):
            IKSolver(robot, method="qp", qp_solver=name)
    with pytest.raises(UnknownNameError, match="Valid: daqp, osqp"):
        IKSolver(robot, method="qp", qp_solver="gurobi_x")
    # Without quadprog, osqp steps in for daqp.
    solve = qp_backend._solve
    monkeypatch.setattr(
        qp_backend, "_solve", lambda problem, qp_solver: None if qp_solver == "daqp" else solve(problem, qp_solver)
    )
    target = robot.forward_kinematics(robot.home)
    result = IKSolver(robot, method="qp").solve(target, seed=robot.home + 0.05)
    check_success(robot, result, target)
    assert result.qp_solver == "daqp, then osqp"


def test_contact_is_reported_or_avoided(robot: Robot, rng: np.random.Generator) -> None:
    from jacokin.model.contact import SelfContact

    contact = SelfContact(robot)
    reporting = IKSolver(robot, method="qp", collision="report")
    rejecting = IKSolver(robot, method="qp", collision="reject", max_restarts=10)
    every_branch = IKSolver(robot, collision="report")
    found = {True: 0, False: 0}
    for q in [q for q in robot.sample(rng, 500) if contact.touching(q)][:12]:
        target = robot.forward_kinematics(q)
        reported = reporting.solve(target, seed=q)
        assert reported.success
        assert reported.touching
        rejected = rejecting.solve(target, seed=q, closest=False)
        branches = every_branch.solve_all(target)
        assert branches.touching is not None
        clear = any(ok and not pairs for ok, pairs in zip(branches.within_limits, branches.touching, strict=True))
        found[rejected.success] += 1
        if rejected.success:
            assert clear
            assert contact.touching(rejected.q) == []
            check_success(robot, rejected, target)
        else:
            assert rejected.status is Status.IN_COLLISION
            assert rejected.touching
    assert min(found.values()) >= 2


def test_batches_answer_like_single_solves(robot: Robot, rng: np.random.Generator) -> None:
    solver = IKSolver(robot, method="qp")
    wanted = [robot.forward_kinematics(q) for q in robot.sample(rng, 4)]
    done: list[int] = []
    batch = solver.solve_batch([*wanted, [2.0, 0.0, 0.3]], progress=done.append, closest=False)
    assert sum(done) == len(batch) == 5
    assert batch.success.tolist() == [True] * 4 + [False]
    assert batch.status[4] is Status.UNREACHABLE
    for q, target in zip(batch.q, wanted, strict=False):
        np.testing.assert_array_equal(q, solver.solve(target).q)
    with pytest.raises(ValueError, match="read-only"):
        batch.q[0, 0] = 0.0


def test_a_pickled_solver_solves(robot: Robot, rng: np.random.Generator) -> None:
    solver = IKSolver(robot, "pinchsite", method="qp", max_restarts=7)
    copy = pickle.loads(pickle.dumps(solver))
    target = robot.forward_kinematics(robot.sample(rng), "pinchsite")
    np.testing.assert_array_equal(copy.solve(target).q, solver.solve(target).q)


def test_published_home_is_near_the_documented_angles(robot: Robot) -> None:
    # The pose the driver states for the real arm's home, and the home angles Kinova documents, rounded to 0.1 deg.
    published = pin.SE3(
        pin.utils.rotate("x", 1.63771402836)
        @ pin.utils.rotate("y", 1.11316478252)
        @ pin.utils.rotate("z", 0.134094119072),
        np.array([0.212322831154, -0.257197618484, 0.509646713734]),
    )
    documented = np.radians([275.0, 167.4, 57.4, 241.0, 82.7, 75.5])
    result = IKSolver(robot).solve(published, seed=documented).raise_for_status()
    assert np.degrees(np.abs(result.q - documented)).max() < 2.0


def test_rotation_angles_are_accurate_at_both_ends() -> None:
    for angle in (0.0, 1e-9, 1e-4, 1.0, math.pi - 1e-7, math.pi):
        rotation = pin.AngleAxis(angle, np.array([0.6, 0.0, 0.8])).toRotationMatrix()
        assert poses.rotation_angle(rotation) == pytest.approx(angle, abs=1e-15)


def test_sliding_joints_reach_as_far_as_they_slide(tmp_path: Path, rng: np.random.Generator) -> None:
    crane = load_text(tmp_path / "crane.urdf", CRANE)
    assert crane.sliding.tolist() == [False, True, False]
    solver = IKSolver(crane)
    for q in crane.sample(rng, 20):
        result = solver.solve(crane.forward_kinematics(q), seed=q + 0.01, closest=False)
        check_success(crane, result, crane.forward_kinematics(q))
    too_far = solver.solve([1.9, 0.0, 0.0], closest=False)
    assert too_far.status is Status.UNREACHABLE
    # A length has no copies: a seed past the end of a slide is moved to its end, not 2 pi back.
    stretched = np.array([0.3, 1.5, 0.2])
    seed = np.array([0.3, 7.0, 0.2])
    np.testing.assert_allclose(solver.solve(crane.forward_kinematics(stretched), seed).q, stretched, atol=1e-6)


def test_osqp_gives_up_in_time_and_another_solver_takes_over() -> None:
    rng = np.random.default_rng(0)
    backend, step, used = qp_backend.Backend("osqp"), np.full(6, 0.006), set()
    for _ in range(6):
        rows, steep = rng.normal(size=(8, 6)), 100.0 * rng.normal(size=(2, 6))
        hessian, gradient = steep.T @ steep + 1e-10 * np.eye(6), -steep.sum(axis=0)
        backend.reset()
        found = backend.minimize(hessian, gradient, (rows, np.zeros(8)), -step, step)
        assert (rows @ found <= 1e-8).all()
        used.add(backend.used)
    assert "osqp" in used
    assert any(name.startswith("osqp, then ") for name in used)  # which one can depends on its version
    assert all(name.startswith("osqp") for name in used)
    assert qp_backend.OPTIONS["osqp"]["max_iter"] <= 10_000


def railed(tmp_path: Path) -> Robot:
    """A Jaco on a rail: seven joints of which one slides, no closed form."""
    text = (urdf_folder() / "j2n6s300.urdf").read_text()
    rail = (
        '<link name="floor"/><joint name="rail" type="prismatic"><parent link="floor"/><child link="link_base"/>'
        '<axis xyz="0 1 0"/><limit lower="-0.5" upper="0.5" effort="100" velocity="0.2"/></joint></robot>'
    )
    (tmp_path / "railed.urdf").write_text(text.replace("</robot>", rail))
    return jacokin.load_robot(tmp_path / "railed.urdf", tip="end_effector")


def about(rng: np.random.Generator, solver: IKSolver, q: Array) -> tuple[FreeAxis, FreeAxis]:
    """A target that a configuration meets at some angle about an axis; and with a narrow range about that angle."""
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    angle = rng.uniform(-2.0, 2.0)
    pose = solver.verifier.tool_pose(q) * pin.SE3(pin.exp3(-angle * axis), np.zeros(3))
    return FreeAxis(pose, axis=axis), FreeAxis(pose, axis=axis, range=(angle - 0.03, angle + 0.02))


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", ["rail", "crane", "qp"])
def test_a_target_may_turn_about_an_axis_on_any_arm(tmp_path: Path, rng: np.random.Generator, kind: str) -> None:
    if kind == "crane":
        (tmp_path / "crane.urdf").write_text(CRANE)
        robot = jacokin.load_robot(tmp_path / "crane.urdf")
    else:
        robot = railed(tmp_path) if kind == "rail" else jacokin.load_robot()
    tool = jacokin.pose([0.02, -0.03, 0.1], rpy=[0.3, 0.2, 0.1])
    solver = IKSolver(robot, tool=tool, collision="ignore", method="qp" if kind == "qp" else "auto")
    for q in robot.sample(rng, 6):
        for target in about(rng, solver, q):
            np.testing.assert_allclose(solver.solve(target, q).raise_for_status().q, q, atol=1e-6)
            result = solver.solve(target).raise_for_status()
            assert result.method == "qp"
            assert result.parameter is not None
            assert target.range[0] <= result.parameter <= target.range[1]
            assert robot.within_limits(result.q)
            T = solver.verifier.tool_pose(result.q)
            np.testing.assert_allclose(T.homogeneous, target.at(result.parameter).homogeneous, atol=2e-6)


@pytest.mark.slow
def test_what_is_not_reached_about_an_axis_comes_close_and_says_why(tmp_path: Path) -> None:
    solver = IKSolver(railed(tmp_path))
    far = FreeAxis(jacokin.pose([0.0, 3.0, 0.3], down=True), axis=(0.0, 0.0, 1.0))
    for closest in (True, False):
        result = solver.solve(far, closest=closest)
        assert result.status is Status.UNREACHABLE
        assert "farther away than the arm is long" in result.message
        assert solver.robot.within_limits(result.q)
    backwards = FreeAxis(jacokin.pose([0.0, 1.35, 0.2], rpy=[0.5 * math.pi, 0.0, 0.0]), axis=(0.0, 0.0, 1.0))
    missed = solver.solve(backwards)
    assert missed.status is Status.NO_CONVERGENCE
    assert missed.parameter is not None
    assert missed.position_error < 0.3


def test_a_motion_and_a_batch_about_an_axis_on_a_rail(tmp_path: Path) -> None:
    robot = railed(tmp_path)
    solver = IKSolver(robot)
    target = FreeAxis(jacokin.pose([0.4, 0.3, 0.3], down=True), axis=(0.0, 0.0, 1.0))
    motion = jacokin.plan_motion(solver, robot.home, target)
    assert motion.success, motion.message
    T = solver.verifier.tool_pose(motion.q[-1])
    np.testing.assert_allclose(T.translation, target.pose.translation, atol=1e-6)
    np.testing.assert_allclose(T.rotation[:, 2], [0.0, 0.0, -1.0], atol=1e-6)
    batch = solver.solve_batch([target, target.pose])
    assert batch.success.all()
    assert batch.parameter is not None
    assert np.isfinite(batch.parameter[0])
    with pytest.raises(StructureError, match="six joints of one angle"):
        solver.solve_all(target)
