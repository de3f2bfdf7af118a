"""The seven-joint arm at a pose: intervals of joint 3 against a scan by other code, members, statuses, structure."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

import jacokin
from benchmarks import solution_sets
from benchmarks.scan_seven import Scan, within_limits
from jacokin import FreeAxis, IKSolver, Robot, Status
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, StructureError
from jacokin.ik.geometry import measure_seven
from jacokin.ik.solutions import least
from jacokin.ik.solutions.least import refine
from jacokin.model.angles import wrap_to_pi
from tests.seven_joint_arms import HALF, Placement, load_arm, load_placed


@pytest.fixture(scope="module")
def solver() -> IKSolver:
    return IKSolver(jacokin.load_robot("j2s7s300"), collision="ignore")


def by_descent(robot: Robot, T: pin.SE3, q3: float, rng: np.random.Generator, starts: int = 60) -> int:
    """How many configurations within the limits reach a pose with joint 3 given: Newton from many random starts."""
    free: list[int] = [0, 1, 3, 4, 5, 6]
    found: list[Array] = []
    for q in robot.sample(rng, starts):
        q[2] = q3
        for _ in range(30):
            error = pin.log6(robot.forward_kinematics(q).actInv(T)).vector
            if np.abs(error).max() < 1e-12:
                break
            q[free] += np.linalg.lstsq(robot.jacobian(q, reference="local")[:, free], error, rcond=1e-8)[0]
        else:
            continue
        copies = np.where(robot.unlimited, wrap_to_pi(q), np.mod(q, 2.0 * math.pi))
        apart = [np.abs(wrap_to_pi(copies - other)).max() for other in found]
        if robot.within_limits(copies) and all(a > 1e-6 for a in apart):
            found.append(copies)
    return len(found)


@pytest.mark.slow
def test_intervals_are_those_of_another_solver(solver: IKSolver, rng: np.random.Generator) -> None:
    robot, checked = solver.robot, 0
    for q in robot.sample(rng, 2):
        T = robot.forward_kinematics(q)
        family = solver.solve_all(T)
        assert family.complete
        for p in rng.uniform(-math.pi, math.pi, 2):
            assert by_descent(robot, T, p, rng) == sum(interval.contains(p) for interval in family.intervals)
            checked += 1
    assert checked == 4


@pytest.mark.parametrize("joint", [1, 3, 5])
def test_a_joint_on_its_limit_is_an_end(solver: IKSolver, rng: np.random.Generator, joint: int) -> None:
    robot = solver.robot
    for side, q in zip(("lower", "upper") * 4, robot.sample(rng, 8), strict=True):
        q[joint] = getattr(robot, side)[joint]
        family = solver.solve_all(robot.forward_kinematics(q))
        ends = np.array([p for interval in family.intervals for p in (interval.start, interval.stop)])
        assert np.abs(wrap_to_pi(ends - q[2])).min() < 1e-8


def test_folds_of_a_stretched_arm_are_exact(solver: IKSolver, rng: np.random.Generator) -> None:
    robot, folds = solver.robot, 0
    for q in robot.sample(rng, 12):
        q[3] = math.pi + rng.uniform(-0.02, 0.02)
        target = robot.forward_kinematics(q)
        family = solver.solve_all(target)
        folds += sum(end.kind == "fold" for interval in family.intervals for end in interval.ends)
        assert solution_sets.worst_end(robot, family, target) < 1e-9
    assert folds > 20


def test_narrow_windows_of_joint_3_are_found(solver: IKSolver) -> None:
    """The wrist near axis 1: configurations exist in some hundredths of a radian of joint 3 only."""
    robot = solver.robot
    rng = np.random.default_rng(7)
    widths = []
    for _ in range(20):
        q = robot.sample(rng)
        q[2] = rng.choice([0.0, math.pi]) + rng.uniform(-0.002, 0.002)
        q[1] = math.pi + rng.uniform(-0.01, 0.01)
        q[3] = math.pi + rng.uniform(-0.02, 0.02)
        result = solver.solve(robot.forward_kinematics(q), seed=q).raise_for_status()
        np.testing.assert_allclose(result.q, q, atol=1e-5)
        family = solver.solve_all(robot.forward_kinematics(q))
        widths.append(min(interval.length for interval in family.intervals))
    assert min(widths) < 0.06


def test_a_window_at_half_a_turn_is_found(solver: IKSolver) -> None:
    """Stretched to within 1e-5 rad: configurations exist in 0.004 rad of joint 3, at pi, only."""
    q = np.array([1.06119347, 3.14355023, 3.13962625, 3.14158398, -0.3664482, 3.24748662, -1.97733129])
    target = solver.robot.forward_kinematics(q)
    assert solver.solve(target, closest=False).status is Status.OK
    assert len(solver.solve_all(target)) > 0


@pytest.mark.parametrize("count", [2, pytest.param(6, marks=pytest.mark.slow)])
@pytest.mark.parametrize("bend", [1e-3, 1e-4, 1e-5])
def test_curves_of_an_almost_stretched_arm_are_complete_if_they_say_so(
    solver: IKSolver, rng: np.random.Generator, bend: float, count: int
) -> None:
    """Near joint 3 at zero, where the arm reaches least far, two configurations meet and part again."""
    robot, scanner = solver.robot, Scan(solver.robot)
    for _ in range(count):
        q = robot.sample(rng)
        q[2], q[3] = rng.choice([-1.0, 1.0]) * rng.uniform(0.01, 0.2), math.pi + rng.choice([-1.0, 1.0]) * bend
        target = robot.forward_kinematics(q)
        family = solver.solve_all(target)

        def scan(parameters: Array, T: Array = target.homogeneous) -> NDArray[np.int64]:
            rows = scanner.configurations(T, parameters)
            return np.asarray((np.isfinite(rows[..., 0]) & within_limits(robot, rows)).sum(axis=1))

        assert not family.complete or solution_sets.longest_difference(family, scan) < solution_sets.LONG
        assert solution_sets.bad_members(robot, family, target) == 0
        nearest = family.nearest(q)
        assert nearest is not None
        np.testing.assert_allclose(nearest, q, atol=1e-4)


def test_short_curves_are_found_once(solver: IKSolver, rng: np.random.Generator) -> None:
    """Beside short curves there are more slices; a window between them was put a turn on, and its curves came twice."""
    folded = np.array([6.5455, 2.272, 0.0697, 0.7833, 5.9445, 3.8786, 5.0877])
    for q in folded + rng.normal(scale=0.02, size=(12, 7)):
        family = solver.solve_all(solver.robot.forward_kinematics(q))
        assert family.branches == 16  # eight closed curves, from fold to fold and back
        assert not any(interval.start == interval.stop for interval in family.intervals)


@pytest.mark.parametrize(
    "steps",
    [
        (10, 12, -6, -2, 20, 12, 20),
        (2, 12, 6, 6, -3, -12, 15),
        (23, 12, 18, 10, 17, 12, 9),
        (8, 12, 6, 14, 3, 12, 12),
    ],
)
def test_members_where_joint_3_does_not_move(solver: IKSolver, steps: tuple[int, ...]) -> None:
    """The wrist on axis 1: joint 1 turns, joint 3 stays."""
    target = solver.robot.forward_kinematics(math.pi / 12.0 * np.array(steps))
    found = solver.solve_all(target)
    assert len(found)
    for q in found.sample(200):
        error = target.actInv(solver.robot.forward_kinematics(q)).homogeneous - np.eye(4)
        assert np.abs(error).max() < 1e-7
        assert solver.robot.within_limits(q)


@pytest.mark.slow
def test_structured_poses(solver: IKSolver) -> None:
    robot = solver.robot
    for position in ((0.5, 0.0, 0.2), (0.0, 0.5, 0.3), (0.3, -0.4, 0.4)):
        for target in (jacokin.pose(position, down=True), jacokin.pose(position, rpy=(0.0, math.pi / 2.0, 0.0))):
            result = solver.solve(target)
            assert result.success
            family = solver.solve_all(target)
            best = min(np.linalg.norm(q - robot.home) for q in family.sample(2000))
            assert np.linalg.norm(result.q - robot.home) <= best + 1e-9


@pytest.mark.parametrize("count", [60, pytest.param(300, marks=pytest.mark.slow)])
def test_sets_of_an_arm_whose_right_angles_are_rounded_are_whole(
    count: int, tmp_path: Path, rng: np.random.Generator
) -> None:
    """Its folds come in pairs that are one with right angles, and are only known to about what is between them."""
    robot = load_arm("rm75", tmp_path)
    solver = IKSolver(robot, collision="ignore")
    for q in robot.sample(rng, count):
        found = solver.solve_all(robot.forward_kinematics(q))
        own = found.nearest(q)
        assert own is not None
        np.testing.assert_allclose(own, q, atol=1e-6)
        assert found.complete
        assert len(found.intervals) < 100


def test_statuses(solver: IKSolver) -> None:
    assert solver.solve(jacokin.pose((1.5, 0.0, 0.1), down=True)).status is Status.UNREACHABLE
    tight = solver.solve(jacokin.pose((0.0, 0.05, 0.1), down=True))
    assert tight.status is Status.OUTSIDE_LIMITS
    assert "joint_4 by 0.465" in tight.message
    assert solver.robot.within_limits(tight.q)


def test_where_branches_come_nearest_to_the_limits_takes_few_looks(
    solver: IKSolver, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks, found = 0, 0

    def counting(*arguments: Any) -> tuple[float, float]:
        nonlocal looks
        looks += 1
        return refine(*arguments)

    monkeypatch.setattr(least, "refine", counting)
    robot = solver.robot
    scan, bounded = Scan(robot), ~robot.unlimited
    lower, upper = robot.lower[bounded], robot.upper[bounded]
    for q in robot.sample(rng, 60):
        target = robot.forward_kinematics(q)
        target.rotation = pin.exp3(rng.normal(size=3))
        target.translation *= 0.5
        result = solver.solve(target, q, closest=False)
        if result.status is Status.OUTSIDE_LIMITS:
            rows = scan.configurations(target.homogeneous, np.linspace(-np.pi, np.pi, 4000))[..., bounded]
            beyond = np.nanmin((np.abs(wrap_to_pi(rows - 0.5 * (lower + upper))) - 0.5 * (upper - lower)).max(axis=-1))
            told = max(map(float, re.findall(r"by ([-+.e\d]+) rad", result.message)))
            assert told - 1e-5 <= beyond <= told + 0.01
            found += 1
    assert found >= 2
    assert looks <= 10 * found  # three of each of eight branches or more, twice, would be 48


def test_a_batch_answers_as_single_solves_do(solver: IKSolver, rng: np.random.Generator) -> None:
    robot = solver.robot
    targets = [robot.forward_kinematics(q) for q in robot.sample(rng, 5)]
    batch = solver.solve_batch(targets)
    assert batch.success.all()
    for row, target in zip(batch.q, targets, strict=True):
        np.testing.assert_array_equal(row, solver.solve(target).q)


def test_what_needs_six_joints_is_refused(solver: IKSolver) -> None:
    target = solver.robot.forward_kinematics(solver.robot.home)
    with pytest.raises(InvalidInputError, match="two free parameters"):
        solver.solve_all(FreeAxis(target, axis=(0.0, 0.0, 1.0)))
    with pytest.raises(StructureError, match="on seven a pose leaves one free"):
        solver.closed_form()
    assert solver.dimension(target) == 1
    assert solver.parameter == "joint_3"


def test_both_formats_have_the_structure(bundled: Callable[[str], Robot]) -> None:
    for name in ("j2s7s300", "j2s7s200"):
        robot = bundled(name)
        geometry = measure_seven(robot.pin_model, robot.frame_id("end_effector"))
        assert geometry.misfit < 1e-12


def test_an_arm_of_another_structure_is_refused_with_its_misfit(bundled: Callable[[str], Robot]) -> None:
    robot = bundled("j2s7s300")
    bent = robot.pin_model.copy()
    placement = bent.jointPlacements[7].copy()
    placement.translation = placement.translation + np.array([0.003, 0.0, 0.0])
    bent.jointPlacements[7] = placement
    with pytest.raises(StructureError, match=r"joint_6 and joint_7.*0.003 m"):
        measure_seven(bent, robot.frame_id("end_effector"))


#: Links of a UR5, by the numbers that its maker publishes.
UR5: list[Placement] = [
    ((0.0, 0.0, 0.0892), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (HALF, 0.0, 0.0)),
    ((-0.425, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ((-0.3922, 0.0, 0.1091), (0.0, 0.0, 0.0)),
    ((0.0, -0.0947, 0.0), (HALF, 0.0, 0.0)),
    ((0.0, 0.0823, 0.0), (-HALF, 0.0, 0.0)),
]
ANOTHER: Placement = ((0.0, 0.0, 0.1), (0.0, 0.0, 0.0))
HAND: Placement = ((0.05, 0.02, 0.1), (0.0, 0.0, 0.0))


@pytest.mark.parametrize("placements", [[*UR5, ANOTHER, HAND], [ANOTHER, *UR5, HAND]], ids=["last two", "first two"])
def test_two_joints_on_one_line_turn_against_each_other(
    placements: list[Placement], tmp_path: Path, rng: np.random.Generator
) -> None:
    """All others stand along each interval, which ends at the limits of the two."""
    robot = load_placed("seven", placements, [2.8] * 7, tmp_path)
    solver = IKSolver(robot, collision="ignore")
    two = [5, 6] if placements[0] is not ANOTHER else [0, 1]
    others = [joint for joint in range(7) if joint not in two]
    for q in robot.sample(rng, 10):
        target = robot.forward_kinematics(q)
        found = solver.solve_all(target)
        assert found.complete
        own = found.nearest(q)
        assert own is not None
        np.testing.assert_allclose(own, q, atol=1e-6)
        for interval in found.intervals:
            rows = np.array([interval.at(p) for p in np.linspace(interval.start, interval.stop, 4)])
            np.testing.assert_allclose(rows[:, others] - rows[0, others], 0.0, atol=1e-9)
            assert np.ptp(rows[:, two].sum(axis=1)) == pytest.approx(0.0, abs=1e-9)
            assert {end.joint for end in interval.ends} <= {f"joint_{joint + 1}" for joint in two}
            for row in rows:
                np.testing.assert_allclose(robot.forward_kinematics(row).homogeneous, target.homogeneous, atol=1e-9)
