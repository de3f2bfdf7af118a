"""Six joints with a spherical wrist at an end: rows against the branches of poses, and where they meet."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import FreeAxis, Robot
from jacokin.arrays import Array
from jacokin.ik import IKSolver, forms
from jacokin.ik.solutions.curve_arm import CurveArm, turned_round
from jacokin.ik.structures import measure_general
from jacokin.ik.targets import interpret
from jacokin.kernels.closed_form.roots import make_roots
from jacokin.kernels.solution_set.end_wrist import begin_end_wrist, find_wrist_folds, solve_wrist_rows
from jacokin.kernels.solution_set.run import SetWork
from jacokin.kernels.solution_set.seven_joints import ROUNDING
from jacokin.kernels.solution_set.slices import AFTER, BEFORE, add_slice
from jacokin.model.angles import TURN, wrap_to_pi
from tests.robot_files import serial_urdf
from tests.seven_joint_arms import HALF, Placement, load_arm

#: [rad] beside a fold, where two rows are nearer than `MET`; and the share of an arc that is left out at its ends.
BESIDE, MET, ENDS = 1e-10, 1e-3, 1e-6
TARGETS = 8
#: Made up, and without an offset at the elbow: both theta_3 have the same theta_2 at folds.
STRAIGHT: list[Placement] = [
    ((0.0, 0.0, 0.3), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (-HALF, 0.0, 0.0)),
    ((0.4, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (-HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.35), (HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (-HALF, 0.0, 0.0)),
    ((0.2, 0.1, 0.4), (0.0, 0.0, 0.0)),
]
KINDS = ["panda", "xarm7", "panda turned round", "six joints about an axis"]


def arm_of(name: str, folder: Path) -> tuple[Robot, CurveArm]:
    """A robot, and its arm as the kernels see it."""
    if name == "six joints about an axis":
        path = folder / "straight.urdf"
        path.write_text(serial_urdf(STRAIGHT, [None] * 6, name="straight"))
        robot = jacokin.load_robot(path, base="link_0", tip="link_7")
        return robot, forms.about_axis(IKSolver(robot).verifier)
    robot = load_arm(name.split()[0], folder)
    arm = forms.at_poses(IKSolver(robot).verifier)
    assert isinstance(arm, CurveArm)
    return robot, turned(arm, robot) if "turned" in name else arm


def works(name: str, folder: Path, rng: np.random.Generator) -> Iterator[tuple[int, SetWork, Array]]:
    """Which joint is the parameter of an arm, and the work arrays and a solution (7,) of some random targets."""
    robot, arm = arm_of(name, folder)
    for _ in range(TARGETS):
        x = np.zeros(7)
        x[: robot.dof] = robot.sample(rng)
        T = robot.forward_kinematics(x[: robot.dof])
        if "turned" in name:
            T, x = T.inverse(), x[::-1].copy()
        target = FreeAxis(T, axis=rng.normal(size=3)) if robot.dof == 6 else T
        work = arm._prepare(arm.problem(interpret(target, robot.default_frame)), np.empty((0, 7))).solve.work
        assert begin_end_wrist(work.six)
        yield arm.constants[0], work, x


def turned(arm: CurveArm, robot: Robot) -> CurveArm:
    """The arm from its tool to its base: its last joint, the parameter, comes first."""
    chain = turned_round(arm.constants[1])
    six = np.ascontiguousarray(turned_round(chain)[:7])
    return CurveArm(BEFORE, "joint_1", chain, measure_general(six).arm, robot)


def rows_at(kind: int, work: SetWork, p: float) -> Array:
    """(8, 7) at a value of the parameter."""
    rows = np.zeros((8, 7))
    solve_wrist_rows(work.six, kind, p, 0, 8, rows, ROUNDING)
    return rows


@pytest.mark.parametrize("name", KINDS)
def test_rows_are_the_branches_of_six_joints(name: str, tmp_path: Path, rng: np.random.Generator) -> None:
    for kind, work, own in works(name, tmp_path, rng):
        assert kind == (BEFORE if "turned" in name else AFTER)
        parameter = 6 if kind == AFTER else 0
        for p in (own[parameter], *rng.uniform(-np.pi, np.pi, 3).tolist()):
            rows = rows_at(kind, work, p)
            work.slices.size[0] = 0
            assert add_slice(work.walk, kind, p, work.slices, work.six, work.seven)
            branches = work.slices.x[0, : work.slices.counts[0]]
            there = np.isfinite(rows[:, 0])
            assert there.sum() == len(branches)
            for row in rows[there]:
                assert distances(branches, row).min() < 1e-7
            for n in np.flatnonzero(there).tolist():  # one alone is as all at once
                alone = np.zeros((8, 7))
                solve_wrist_rows(work.six, kind, p, n, n + 1, alone, ROUNDING)
                np.testing.assert_array_equal(alone[n], rows[n])
        rows = rows_at(kind, work, own[parameter])
        assert distances(rows[np.isfinite(rows[:, 0])], own).min() < 1e-6


@pytest.mark.parametrize("name", KINDS)
def test_rows_come_and_go_in_folds_alone_where_two_meet(name: str, tmp_path: Path, rng: np.random.Generator) -> None:
    met = 0
    for kind, work, _ in works(name, tmp_path, rng):
        count, single = find_wrist_folds(work.six, ROUNDING, work.seven.waves, make_roots(), work.seven.folds)
        assert single
        folds = work.seven.folds[:count].copy() if count else np.array([0.0])
        assert (np.diff(folds) >= 0.0).all()
        for first, last in zip(folds, np.append(folds[1:], folds[0] + TURN), strict=True):
            inside = first + (last - first) * np.linspace(ENDS, 1.0 - ENDS, 9)
            there = [np.isfinite(rows_at(kind, work, p)[:, 0]) for p in inside.tolist()]
            assert all((each == there[0]).all() for each in there)
        for fold in folds[:count].tolist():
            before, after = (rows_at(kind, work, fold + side) for side in (-BESIDE, BESIDE))
            for rows, others in ((before, after), (after, before)):
                here = np.isfinite(rows[:, 0])
                for row in rows[here & ~np.isfinite(others[:, 0])]:  # none where theta_2 is complex
                    assert np.sort(distances(rows[here], row))[1] < MET  # the first one is the row itself
                    met += 1
    assert met > 0


def distances(rows: Array, x: Array) -> Array:
    """From each of some rows (n, 7) to an x (7,): the largest of an angle."""
    return np.asarray(np.abs(wrap_to_pi(rows - x)).max(axis=1))
