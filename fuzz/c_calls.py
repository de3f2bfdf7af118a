"""The C library through ctypes: the same answers as Python to the bit, and no crash whatever it is given."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache

import numpy as np
import pinocchio as pin

from fuzz.findings import Finding
from jacokin import FreeAxis, IKSolver, load_robot, pose
from jacokin.arrays import Array
from jacokin.ik.c_library import solver_file
from jacokin.model import NAMES
from tests.c import binding
from tests.c.binding import CSolver

TARGETS = 100  # in one case
CURVES = 4
AT_TARGET = 1.1e-6  # [m] and [rad]: the tolerance of a solver, and rounding
STRANGE = (math.nan, math.inf, -math.inf, 1e300, -1e300, 1e-310, 0.0, -0.0, 1e6)


def run(seed: int, first: int, cases: int) -> Iterator[tuple[int, int, list[Finding]]]:
    """Cases of one solver each."""
    for case in range(first, first + cases):
        rng = np.random.default_rng([seed, case])
        name = NAMES[int(rng.integers(len(NAMES)))]
        solver, c = _solvers(name, int(rng.integers(3)))
        given = f"{name}, {solver.frame}"
        found = list(check_damage(solver, c, rng))
        if solver.robot.dof == 6:
            found += check_answers(solver, c, given, rng)
        found += check_curves(solver, c, given, rng)
        yield case, TARGETS + CURVES, found


@cache
def _solvers(name: str, number: int) -> tuple[IKSolver, CSolver]:
    limits = {"joint_2": (1.0, 4.0), "joint_4": (-2.0, 2.5)} if number == 1 else None
    robot = load_robot(name, limits=limits)
    tool = pose([0.02, -0.03, 0.2], rpy=[0.3, 0.2, -1.0]) if number else None
    solver = IKSolver(robot, "wristsite" if number == 2 else None, tool=tool, collision="ignore")
    return solver, CSolver(solver, binding.INTERVALS)


def random_pose(solver: IKSolver, rng: np.random.Generator) -> Array:
    """Of some configuration, of round angles, moved off, or anywhere."""
    q = solver.robot.sample(rng)
    kind = rng.random()
    if kind < 0.2:
        q = np.round(q / (math.pi / 6.0)) * (math.pi / 6.0)
    T = solver.verifier.tool_pose(q).homogeneous
    if kind > 0.7:
        T[:3, 3] += 10.0 ** rng.uniform(-9.0, 0.0) * rng.normal(size=3)
    return np.ascontiguousarray(T)


def check_answers(solver: IKSolver, c: CSolver, given: str, rng: np.random.Generator) -> Iterator[Finding]:
    """Branches of six joints, one by one and in a batch."""
    targets = np.array([random_pose(solver, rng) for _ in range(TARGETS)])
    seeds = solver.robot.sample(rng, TARGETS)
    rows = solver.closed_form().solve_batch(targets, seeds)
    status, q = c.batch(targets, seeds)
    solved = np.array(status) == binding.OK
    if not np.array_equal(solved, rows.within_limits) or q[solved].tobytes() != rows.q[solved].tobytes():
        yield Finding("wrong", "C, batch", f"differs from Python; {given}")
    if not np.isnan(q[~solved]).all():
        yield Finding("wrong", "C, batch", f"numbers without success; {given}")
    for T, seed in zip(targets[:10], seeds[:10], strict=True):
        found = solver.solve_all(T, seed)
        done, branches, complete = c.all(T, seed)
        mine = np.array([each.q[:6] for each in branches])
        at = f"{given}, {T.tolist()}, seed {seed.tolist()}"
        if mine.tobytes() != found.q.tobytes() or complete != found.complete:
            yield Finding("wrong", "C, all branches", f"differs from Python: {at}")
        if (done == binding.OK) != bool(found.within_limits.any()):
            yield Finding("wrong", "C, all branches", f"status {done}: {at}")


def check_curves(solver: IKSolver, c: CSolver, given: str, rng: np.random.Generator) -> Iterator[Finding]:
    """Intervals of one free parameter: each member is one, and none is missing where none is said to be."""
    robot = solver.robot
    for _ in range(CURVES):
        T, seed = random_pose(solver, rng), robot.sample(rng)
        target: pin.SE3 | FreeAxis = pin.SE3(T)
        if robot.dof == 6:
            axis = np.eye(3)[int(rng.integers(3))] if rng.random() < 0.5 else rng.normal(size=3)
            ends = np.sort(rng.uniform(-3.0, 3.0, 2)) if rng.random() < 0.5 else np.array([-math.pi, math.pi])
            target = FreeAxis(T, axis=axis, range=(float(ends[0]), float(ends[1])))
        about = binding.axis_of(target) if isinstance(target, FreeAxis) else None
        at = f"{given}, {target}, {T.tolist()}, seed {seed.tolist()}"
        status, intervals, complete = c.intervals(T, about)
        found = solver.solve_all(target)
        if (status == binding.OK) != bool(intervals) or (complete and bool(found.intervals) != bool(intervals)):
            yield Finding("wrong", "C, intervals", f"status {status}, {len(intervals)} of {len(found)}: {at}")
        for interval in intervals:
            p = float(rng.uniform(interval.start, interval.stop))
            done, q = c.at(interval, p, seed)
            if done != binding.OK or not _reaches(solver, target, q, p):
                yield Finding("wrong", "C, a member", f"status {done}, {q.tolist()} at {p}: {at}")
        done, q, p = c.nearest_about(T, about, seed)
        if done == binding.OK and not _reaches(solver, target, q, p):
            yield Finding("wrong", "C, nearest", f"{q.tolist()} at {p}: {at}")
        result = solver.solve(target, seed, closest=False)
        if complete and result.success != (done == binding.OK):
            yield Finding("wrong", "C, nearest", f"status {done}, Python {result.status.name}: {at}")


def _reaches(solver: IKSolver, target: pin.SE3 | FreeAxis, q: Array, p: float) -> bool:
    goal = target.at(p) if isinstance(target, FreeAxis) else target
    missed = pin.log6(goal.actInv(solver.verifier.tool_pose(q))).vector if np.isfinite(q).all() else np.array([np.inf])
    return bool(np.linalg.norm(missed[:3]) < AT_TARGET and np.linalg.norm(missed[3:]) < AT_TARGET) and (
        solver.robot.within_limits(q)
    )


def check_damage(solver: IKSolver, c: CSolver, rng: np.random.Generator) -> Iterator[Finding]:
    """Numbers that are none, poses that are not rigid, and files with other bytes are refused."""
    T, seed = random_pose(solver, rng), solver.robot.sample(rng)
    row, column = (int(each) for each in rng.integers(4, size=2))
    T[row, column] = rng.choice(STRANGE)
    if rng.random() < 0.3:
        seed[int(rng.integers(len(seed)))] = rng.choice(STRANGE)
    status, q = c.nearest(T, seed)
    if status != binding.OK and not np.isnan(q).all():
        yield Finding("wrong", "C, strange numbers", f"status {status} and {q.tolist()}")
    if not (np.isfinite(T).all() and np.isfinite(seed).all()) and status >= 0:
        yield Finding("wrong", "C, strange numbers", f"status {status} for {T.tolist()}, {seed.tolist()}")
    contents = bytearray(solver_file(solver))
    if rng.random() < 0.5:
        contents = contents[: int(rng.integers(len(contents)))]
    else:
        contents[int(rng.integers(len(contents)))] ^= int(rng.integers(1, 256))
    status, handle = binding.read(bytes(contents))
    if status == binding.OK or handle.value:
        binding.C.jacokin_ik_free(handle)
        yield Finding("wrong", "C, a damaged file", "was read")
