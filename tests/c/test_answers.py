"""The C library answers as the Python package does, and what it calls a success is one."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin.arrays import Array
from jacokin.ik import FreeAxis, IKSolver, Status
from jacokin.ik.c_library import check_sum, solver_file
from jacokin.ik.solutions import curve_arm
from jacokin.ik.structures import measure_general
from jacokin.kernels.solution_set.slices import AFTER, BEFORE
from jacokin.model.descriptions import bundled
from tests.c import binding
from tests.c.binding import C, CSolver, make_targets
from tests.robot_files import load_text, serial_urdf, ur5_text
from tests.seven_joint_arms import STRAIGHT, load_arm

SIX = [name for name in bundled.NAMES if jacokin.load_robot(name).dof == 6]


def test_10000_answers_are_those_of_the_package_to_the_bit() -> None:
    robot = jacokin.load_robot("j2n6s300")
    solver = IKSolver(robot, collision="ignore")
    targets, seeds = make_targets(robot, 10_000, 0)
    rows = solver.closed_form().solve_batch(targets, seeds)
    status, q = CSolver(solver).batch(targets, seeds)
    solved = np.array(status) == binding.OK
    assert np.array_equal(solved, rows.within_limits)
    assert 5_000 < solved.sum() < 10_000
    assert q[solved].tobytes() == rows.q[solved].tobytes()
    assert np.isnan(q[~solved]).all()
    reasons = np.where(rows.branches == 0, binding.UNREACHABLE, binding.OUTSIDE_LIMITS)
    assert np.array_equal(np.array(status)[~solved], reasons[~solved])


@pytest.mark.one_quick
@pytest.mark.parametrize("name", SIX)
def test_all_branches_are_those_of_the_package(name: str) -> None:
    robot = jacokin.load_robot(name)
    solver = IKSolver(robot, collision="ignore")
    c = CSolver(solver)
    for T, seed in zip(*make_targets(robot, 200, 1), strict=True):
        found = solver.solve_all(T, seed)
        status, branches, complete = c.all(T, seed)
        q = np.array([each.q[:6] for each in branches]).reshape(-1, 6)
        if solver.closed_form().spherical:  # exported with the constants of any spherical wrist
            np.testing.assert_allclose(np.exp(1j * q), np.exp(1j * found.q), atol=1e-9)
        else:
            assert q.tobytes() == found.q.tobytes()
            assert [each.distance for each in branches] == found.distance.tolist()
            assert [each.margin for each in branches] == found.margin.min(axis=1, initial=np.inf).tolist()
        assert [bool(each.success) for each in branches] == found.within_limits.tolist()
        assert complete == found.complete
        assert (status == binding.OK) == any(found.within_limits)


def test_an_arm_of_another_make_has_the_branches_of_the_package(tmp_path: Path) -> None:
    robot = load_text(tmp_path / "ur5.urdf", ur5_text())
    solver = IKSolver(robot, collision="ignore")
    c = CSolver(solver)
    for T, seed in zip(*make_targets(robot, 60, 1), strict=True):
        found = solver.solve_all(T, seed)
        _, branches, complete = c.all(T, seed)
        assert np.array([each.q[:6] for each in branches]).tobytes() == found.q.tobytes()
        assert complete == found.complete


def test_what_counts_as_a_success_passes_pinocchio_and_the_limits() -> None:
    robot = jacokin.load_robot("j2n6s300", limits={"joint_2": (1.0, 3.0), "joint_5": (0.5, 2.0)})
    tool = jacokin.pose([0.01, -0.02, 0.1], rpy=[0.3, 0.2, 0.1])
    c = CSolver(IKSolver(robot, "pinchsite", tool=tool, collision="ignore"))
    targets, seeds = make_targets(robot, 500, 2)
    status, rows = c.batch(targets, seeds)
    solved = 0
    for T, q, one in zip(targets, rows, status, strict=True):
        if one == binding.OK:
            reached = (robot.forward_kinematics(q, "pinchsite") * tool).homogeneous
            np.testing.assert_allclose(reached, T, atol=1e-8)
            assert (q >= robot.lower).all()
            assert (q <= robot.upper).all()
            solved += 1
    assert solved > 20


@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_forward_kinematics_is_pinocchios(name: str) -> None:
    robot = jacokin.load_robot(name)
    c, pose = CSolver(IKSolver(robot, collision="ignore")), np.empty((4, 4))
    for q in robot.sample(np.random.default_rng(3), 50):
        assert C.jacokin_fk(c.handle, q.ctypes.data, pose.ctypes.data) == binding.OK
        np.testing.assert_allclose(pose, robot.forward_kinematics(q).homogeneous, atol=1e-14)


def test_a_seed_outside_the_limits_is_moved_inside_as_in_python() -> None:
    robot = jacokin.load_robot("j2n6s300")
    solver = IKSolver(robot, collision="ignore")
    c, rng = CSolver(solver), np.random.default_rng(4)
    T = np.ascontiguousarray(robot.forward_kinematics(robot.home).homogeneous)
    for seed in rng.uniform(-30.0, 30.0, (50, 6)):
        assert c.nearest(T, seed)[1].tobytes() == solver.solve(T, seed).q.tobytes()
    assert c.nearest(T, None)[1].tobytes() == solver.solve(T).q.tobytes()


def test_a_rotation_of_single_precision_is_made_exact() -> None:
    robot = jacokin.load_robot("j2n6s300")
    solver = IKSolver(robot, collision="ignore")
    T = robot.forward_kinematics(robot.home).homogeneous.astype(np.float32).astype(np.float64)
    status, q = CSolver(solver).nearest(T, robot.home)
    assert status == binding.OK
    np.testing.assert_allclose(q, solver.solve(T, robot.home).q, atol=1e-12)


TURNS: dict[str, tuple[str, Callable[[Array], FreeAxis | None]]] = {
    "seven joints": ("j2s7s300", lambda T: None),
    "a free axis": ("j2n6s300", lambda T: FreeAxis(T, axis=(1.0, 0.2, 0.0))),
    "a range": ("j2n6s300", lambda T: FreeAxis(T, axis=(0.0, 1.0, 0.0), range=(-1.0, 2.0))),
    "a spherical wrist": ("j2s6s300", lambda T: FreeAxis(T, axis=(1.0, 0.0, 0.0), range=(5.0, 8.0))),
    "the last axis": ("j2n6s300", lambda T: FreeAxis(T, axis=(0.0, 0.0, 1.0))),
    "the last axis, back": ("j2s6s300", lambda T: FreeAxis(T, axis=(0.0, 0.0, -2.0), range=(-1.0, 2.0))),
}


@pytest.mark.one_quick
@pytest.mark.parametrize(("name", "free"), TURNS.values(), ids=TURNS)
def test_intervals_are_those_of_the_package(name: str, free: Callable[[Array], FreeAxis | None]) -> None:
    compare_intervals(name, free, *make_targets(jacokin.load_robot(name), 12, 5))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "free"), TURNS.values(), ids=TURNS)
def test_intervals_of_many_targets(name: str, free: Callable[[Array], FreeAxis | None]) -> None:
    compare_intervals(name, free, *make_targets(jacokin.load_robot(name), 50, 6))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "free"), TURNS.values(), ids=TURNS)
def test_intervals_of_structured_targets(name: str, free: Callable[[Array], FreeAxis | None]) -> None:
    """Axes along those of the base, positions in whole decimetres: where what is singular by chance is so."""
    rng = np.random.default_rng(9)
    targets = np.zeros((20, 4, 4))
    targets[:, :3, 3] = rng.uniform((-0.6, -0.6, -0.1), (0.6, 0.6, 0.9), (20, 3)).round(1)
    targets[:, 3, 3] = 1.0
    for T in targets:
        T[:3, :3] = pin.rpy.rpyToMatrix(*(0.5 * math.pi * rng.integers(0, 4, 3))).round()
    compare_intervals(name, free, targets, jacokin.load_robot(name).sample(rng, 20))


@pytest.mark.parametrize("number", [15, pytest.param(50, marks=pytest.mark.slow)])
@pytest.mark.parametrize("about", ["seven joints", "a free axis"])
def test_nothing_is_nearer_where_limits_leave_a_choice_of_equivalents(about: str, number: int) -> None:
    name, free = TURNS[about]
    wide = (-1.7 * np.pi, 2.3 * np.pi)
    joints = (1, 3, 5, 7) if name == "j2s7s300" else (1, 4, 5, 6)
    robot = jacokin.load_robot(name, limits={f"joint_{joint}": wide for joint in joints})
    solver = IKSolver(robot, collision="ignore")
    c = CSolver(solver, binding.INTERVALS)
    for T, seed in zip(*make_targets(robot, number, 8), strict=True):
        target = free(T)
        python = solver.solve(T if target is None else target, seed)
        status, q, p = c.nearest_about(T, None if target is None else binding.axis_of(target), seed)
        assert (status == binding.OK) == python.success
        if status != binding.OK:
            continue
        assert robot.within_limits(q)
        reached = robot.forward_kinematics(q).homogeneous
        np.testing.assert_allclose(reached, T if target is None else target.at(p).homogeneous, atol=1e-8)
        assert np.linalg.norm(q - seed) <= np.linalg.norm(python.q - seed) + 1e-7


def compare_intervals(name: str, free: Callable[[Array], FreeAxis | None], targets: Array, seeds: Array) -> None:
    """The same intervals with the same ends; their points, and the nearest one, reach the target within the limits."""
    robot = jacokin.load_robot(name)
    solver = IKSolver(robot, collision="ignore")
    c, whole = CSolver(solver, binding.INTERVALS), 0
    for T, start in zip(targets, seeds, strict=True):
        target = free(T)
        about = None if target is None else binding.axis_of(target)
        whole_set = solver.solve_all(T if target is None else target)
        status, intervals, complete = c.intervals(T, about)
        assert (status == binding.OK) == bool(intervals)
        whole += complete
        assert whole_set.complete or not complete
        if complete:
            assert_same(intervals, whole_set.intervals)
        for interval in intervals:
            for share in (0.0, 0.37, 1.0):
                p = interval.start + share * (interval.stop - interval.start)
                done, q = c.at(interval, p, start)
                assert done == binding.OK
                wanted = pin.SE3(T) if target is None else target.at(p)
                np.testing.assert_allclose(robot.forward_kinematics(q).homogeneous, wanted.homogeneous, atol=1e-7)
                assert robot.within_limits(q)
                assert target is not None or abs(math.remainder(q[2] - p, math.tau)) < 1e-9
        result = solver.solve(T if target is None else target, start, closest=False)
        done, q, p = c.nearest_about(T, about, start)
        assert result.success == (done == binding.OK)
        if result.success:
            assert np.linalg.norm(q - start) == pytest.approx(np.linalg.norm(result.q - start), abs=1e-8)
            assert abs(math.remainder(p - (result.parameter or 0.0), math.tau)) < 1e-6
        elif complete:
            assert done == (binding.UNREACHABLE if result.status is Status.UNREACHABLE else binding.OUTSIDE_LIMITS)
        else:
            assert done == binding.NO_CONVERGENCE
    assert whole > 0.7 * len(targets)


def assert_same(intervals: list[binding.Interval], others: Sequence[Any]) -> None:
    """They cover the same, and end at the same places for the same reasons; a curve may be cut anywhere on a circle."""
    kinds = ("limit", "fold", "range", "circle", "lost")
    mine = [((each.start, each.stop), tuple(kinds[end] for end in each.ends)) for each in intervals]
    theirs = [((each.start, each.stop), tuple(end.kind for end in each.ends)) for each in others]
    assert sum(b - a for (a, b), _ in mine) == pytest.approx(sum(b - a for (a, b), _ in theirs), abs=1e-5)
    for side in range(2):
        ends, known = (
            sorted((why[side], math.remainder(at[side], math.tau)) for at, why in which if why[side] != "circle")
            for which in (mine, theirs)
        )
        assert [kind for kind, _ in ends] == [kind for kind, _ in known]
        np.testing.assert_allclose([p for _, p in ends], [p for _, p in known], atol=1e-6)
    order = [each.branch for each in intervals]
    assert order == sorted(order)


def test_poses_of_seven_joints_are_solved_one_by_one_and_in_a_batch() -> None:
    robot = jacokin.load_robot("j2s7s300")
    solver = IKSolver(robot, collision="ignore")
    c = CSolver(solver)
    targets, seeds = make_targets(robot, 20, 7)
    status, rows = c.batch(targets, seeds)
    for T, seed, one, q in zip(targets, seeds, status, rows, strict=True):
        assert c.nearest(T, seed)[0] == one
        result = solver.solve(T, seed, closest=False)
        assert result.success == (one == binding.OK)
        if result.success:
            np.testing.assert_allclose(q, result.q, atol=1e-9)


def test_there_is_room_for_all_intervals_of_a_straight_arm(tmp_path: Path) -> None:
    """A joint stands on its limit along a whole curve, and rounding cuts that into hundreds of pieces."""
    robot = load_arm("iiwa14", tmp_path)
    solver = IKSolver(robot, collision="ignore")
    found = solver.solve_all(robot.forward_kinematics(STRAIGHT))
    status, intervals, complete = CSolver(solver, binding.INTERVALS).intervals(
        np.ascontiguousarray(robot.forward_kinematics(STRAIGHT).homogeneous)
    )
    assert status == binding.OK
    assert len(intervals) == len(found.intervals) > 256
    assert complete is found.complete is False


@pytest.mark.parametrize(("name", "free"), [TURNS["seven joints"], TURNS["a spherical wrist"]])
def test_the_circle_of_a_straight_wrist_is_found(name: str, free: Callable[[Array], FreeAxis | None]) -> None:
    """Axes before and after the middle joint are one line: at one value of the parameter, a whole circle reaches."""
    robot = jacokin.load_robot(name)
    middle, (low, high) = robot.dof - 2, (robot.lower[robot.dof - 2], robot.upper[robot.dof - 2])
    angles = np.arange(-1, 3) * math.pi
    c = CSolver(IKSolver(robot, collision="ignore"), binding.INTERVALS)
    for q in robot.sample(np.random.default_rng(8), 4):
        q[middle] = angles[(angles > low) & (angles < high)][0]
        before, after = robot.jacobian(q)[3:, [middle - 1, middle + 1]].T
        assert np.linalg.norm(np.cross(before, after)) < 1e-9
        target = free(np.ascontiguousarray(robot.forward_kinematics(q).homogeneous))
        T = np.ascontiguousarray(robot.forward_kinematics(q).homogeneous)
        about = None if target is None else binding.axis_of(target)
        status, nearest, _ = c.nearest_about(T, about, q)
        assert status == binding.OK
        np.testing.assert_allclose(nearest, q, atol=1e-6)
        other = q.copy()
        other[middle - 1] += 0.1
        other[middle + 1] -= math.copysign(0.1, before @ after)
        np.testing.assert_allclose(robot.forward_kinematics(other).homogeneous, T, atol=1e-12)
        np.testing.assert_allclose(c.nearest_about(T, about, other)[1], other, atol=1e-6)


#: Placements of seven joints, none of whose axes meet or are parallel: xyz [m] and rpy [rad].
SEVEN_JOINTS = (
    ((0.0, 0.0, 0.3), (0.1, 0.0, 0.0)),
    ((0.02, 0.05, 0.1), (-1.4, 0.2, 0.0)),
    ((0.03, -0.25, 0.02), (1.5, 0.0, 0.3)),
    ((0.08, 0.03, 0.1), (1.3, 0.1, 0.0)),
    ((-0.05, 0.3, 0.02), (-1.6, 0.0, 0.1)),
    ((0.02, 0.04, 0.1), (1.2, 0.3, 0.0)),
    ((0.09, 0.02, 0.05), (1.5, 0.0, 0.2)),
)


def seven_joints(folder: Path) -> jacokin.Robot:
    """An arm of seven joints of no special structure."""
    return load_text(folder / "seven.urdf", serial_urdf(SEVEN_JOINTS, [(-2.5, 2.5)] * 7, velocity=1.0, name="seven"))


@pytest.mark.parametrize("kind", [AFTER, BEFORE])
def test_seven_joints_of_any_structure_have_the_last_or_the_first_one_as_parameter(kind: int, tmp_path: Path) -> None:
    robot = seven_joints(tmp_path)
    solver = IKSolver(robot, collision="ignore")
    c = CSolver(solver, binding.INTERVALS, contents=file_with_parameter(solver, kind))
    joint = C.jacokin_ik_parameter(c.handle)
    assert joint == (6 if kind == AFTER else 0)
    whole = 0
    for q in robot.sample(np.random.default_rng(10), 8):
        T = np.ascontiguousarray(robot.forward_kinematics(q).homogeneous)
        status, nearest = c.nearest(T, q)
        assert status == binding.OK
        np.testing.assert_allclose(nearest, q, atol=1e-8)
        status, intervals, complete = c.intervals(T)
        assert status == binding.OK
        whole += complete
        own = [each for each in intervals if each.start <= q[joint] <= each.stop]
        assert min(np.abs(c.at(each, q[joint], q)[1] - q).max() for each in own) < 1e-6
        for interval in intervals:
            for share in (0.0, 0.4, 1.0):
                p = interval.start + share * (interval.stop - interval.start)
                done, found = c.at(interval, p, q)
                assert done == binding.OK
                assert robot.within_limits(found)
                assert found[joint] == pytest.approx(p, abs=1e-9)
                np.testing.assert_allclose(robot.forward_kinematics(found).homogeneous, T, atol=1e-8)
    assert whole >= 7  # one in sixty is in doubt


def file_with_parameter(solver: IKSolver, kind: int) -> bytes:
    """The file of a solver for seven joints of any structure, with the last or the first one as parameter."""
    contents = solver_file(solver)
    chain = np.frombuffer(contents, dtype="<f8", count=96, offset=24).reshape(8, 3, 4)
    six = chain[:7] if kind == AFTER else curve_arm.turned_round(chain)[:7]
    constants = measure_general(np.ascontiguousarray(six)).arm.tobytes()
    first = 24 + 8 * 96
    changed = contents[:16] + kind.to_bytes(4, "little") + contents[20:first] + constants
    changed += contents[first + len(constants) : -8]
    return changed + check_sum(changed).to_bytes(8, "little")
