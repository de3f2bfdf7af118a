"""Poses of every class on every bundled robot, solved in batches and checked by an independent forward kinematics."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fuzz import solution_sets
from fuzz.findings import Finding
from fuzz.kinematics import Chain, bundled_chain, placement, rotation_error
from jacokin import IKSolver, Status, load_robot, pose
from jacokin.arrays import Array
from jacokin.model import Robot, urdf_folder
from jacokin.model.descriptions.bundled import JACOS

BATCH = 500  # targets in one case
TOLERANCE = 1e-6  # [m] and [rad]: what jacokin promises of a success
ROUNDING = 1e-10  # [m] and [rad] by which two forward kinematics may differ
SETS = 0.3  # share of cases with one free parameter
HALF_TURN = math.pi + 1e-9  # [rad] a joint without limits stays this near to its seed

Maker = Callable[[Robot, np.random.Generator, int], Array]


def within(robot: Robot, rng: np.random.Generator, size: int) -> Array:
    """Configurations within the limits."""
    return robot.sample(rng, size)


def anywhere(robot: Robot, rng: np.random.Generator, size: int) -> Array:
    """Configurations that ignore the limits."""
    return rng.uniform(-math.pi, 2.0 * math.pi, (size, robot.dof))


def on_limits(robot: Robot, rng: np.random.Generator, size: int) -> Array:
    """One or all limited joints exactly on a limit."""
    q = robot.sample(rng, size)
    limited = np.flatnonzero(~robot.unlimited)
    for row in q:
        chosen = limited if rng.random() < 0.3 else rng.choice(limited, 1)
        row[chosen] = np.where(rng.random(len(chosen)) < 0.5, robot.lower[chosen], robot.upper[chosen])
    return q


def near_limits(robot: Robot, rng: np.random.Generator, size: int) -> Array:
    """A limited joint within 1e-12 to 1e-2 rad of a limit, on either side."""
    q = on_limits(robot, rng, size)
    offset = rng.choice([-1.0, 1.0], q.shape) * 10.0 ** rng.uniform(-12.0, -2.0, q.shape)
    return np.where(robot.unlimited, q, q + offset)


def singular(robot: Robot, rng: np.random.Generator, size: int) -> Array:
    """Joints 3 and 5 near 0, a quarter or a half turn: stretched, folded, aligned axes; some of them exactly."""
    q = robot.sample(rng, size)
    for joint in (2, 4):
        chosen = rng.random(size) < 0.6
        offset = rng.choice([-1.0, 1.0], size) * 10.0 ** rng.uniform(-12.0, -1.0, size) * (rng.random(size) < 0.7)
        angle = rng.choice([0.0, 0.5, 1.0, 1.5], size) * math.pi + offset
        q[chosen, joint] = angle[chosen]
    return q


def singular_on_limits(robot: Robot, rng: np.random.Generator, size: int) -> Array:
    """As `singular`, with one of the limited joints on a limit."""
    q = singular(robot, rng, size)
    limited = np.flatnonzero(~robot.unlimited)
    for row in q:
        joint = rng.choice(limited)
        row[joint] = rng.choice([robot.lower[joint], robot.upper[joint]])
    return q


def vertical(robot: Robot, rng: np.random.Generator, size: int) -> Array:
    """Tools up and down, exactly and nearly: axis 4 upright and joint 5 at zero."""
    q = robot.sample(rng, size)
    q[:, 4] = rng.choice([0.0, math.pi], size)
    q[:, 2] = q[:, 1] + rng.choice([0.0, math.pi], size)
    return q + rng.choice([0.0, 1e-12, 1e-9, 1e-6, 1e-3], (size, 1)) * rng.standard_normal(q.shape)


def round_angles(robot: Robot, rng: np.random.Generator, size: int) -> Array:
    """Every joint at a multiple of 15 degrees."""
    return np.asarray(rng.integers(-12, 24, (size, robot.dof)) * (math.pi / 12.0))


CLASSES: dict[str, Maker] = {
    "within the limits": within,
    "anywhere": anywhere,
    "on limits": on_limits,
    "near limits": near_limits,
    "singular": singular,
    "singular on limits": singular_on_limits,
    "vertical tool": vertical,
    "round angles": round_angles,
}


@dataclass(frozen=True, slots=True)
class Case:
    """One robot, frame and tool, with everything to solve and check it."""

    solver: IKSolver
    chain: Chain
    T_frame_tool: Array

    def forward(self, q: Array) -> Array:
        """T_base_tool by the independent kinematics."""
        return np.asarray(self.chain.forward(q) @ self.T_frame_tool)


def case(rng: np.random.Generator, joints: str = "6") -> Case:
    """A Jaco of so many joints, one of its frames, and sometimes a tool of up to 0.5 m."""
    name = str(rng.choice([name for name in JACOS if name[3] == joints]))
    robot = _robot(name)
    frame = str(rng.choice([frame for frame in ("end_effector", "wristsite", "gripsite") if frame in robot.frames]))
    tool = np.eye(4)
    if rng.random() < 0.3:
        tool = placement(rng.uniform(-0.3, 0.3, 3), rng.uniform(-math.pi, math.pi, 3))
    solver = IKSolver(robot, frame, tool=None if np.array_equal(tool, np.eye(4)) else tool, collision="ignore")
    return Case(solver, bundled_chain(urdf_folder(), name, frame), tool)


_robots: dict[str, Robot] = {}


def _robot(name: str) -> Robot:
    if name not in _robots:
        _robots[name] = load_robot(name)
    return _robots[name]


def run(seed: int, first: int, cases: int) -> Iterator[tuple[int, int, list[Finding]]]:
    """Case after case: its index, how many targets it had, and what was found."""
    for index in range(first, first + cases):
        rng = np.random.default_rng([seed, index])
        if rng.random() < SETS:
            what = case(rng, "7" if rng.random() < 0.5 else "6")
            kind = str(rng.choice(list(CLASSES)))
            q = CLASSES[kind](what.solver.robot, rng, solution_sets.TARGETS)
            yield index, len(q), list(solution_sets.check(what.solver, what.forward, kind, q, rng))
            continue
        what = case(rng)
        if rng.random() < 0.15:
            yield index, BATCH, list(check_poses(what, rng))
            continue
        kind = str(rng.choice(list(CLASSES)))
        q = CLASSES[kind](what.solver.robot, rng, BATCH)
        yield index, BATCH, list(check_configurations(what, kind, q, rng))


def check_configurations(what: Case, kind: str, q: Array, rng: np.random.Generator) -> Iterator[Finding]:
    """Targets made from configurations: those within the limits must be found, none may be called unreachable."""
    robot = what.solver.robot
    seeds = robot.sample(rng, len(q)) + 2.0 * math.pi * rng.integers(-3, 4, q.shape)
    T = what.forward(q)
    batch = what.solver.solve_batch(T, seeds, closest=False)
    inside = ((q >= what.chain.lower) & (q <= what.chain.upper)).all(axis=1)
    label = f"{robot.name}, {what.solver.frame}, {kind}"
    yield from _successes(what, label, T, batch.q, batch.success, seeds)
    for index in np.flatnonzero(inside & ~batch.success):
        yield Finding("lost", label, f"{batch.status[index].name} for q = {q[index].tolist()}: {batch.message[index]}")
    for index in np.flatnonzero(~inside):
        if batch.status[index] is Status.UNREACHABLE:
            yield Finding("wrong", label, f"UNREACHABLE, but reached beyond the limits by q = {q[index].tolist()}")
    chosen = int(rng.integers(len(q)))
    single = what.solver.solve(T[chosen], seeds[chosen], closest=False)
    if single.status is not batch.status[chosen] or not np.allclose(single.q, batch.q[chosen], rtol=0.0, atol=1e-9):
        yield Finding("wrong", label, f"solve and solve_batch differ for q = {q[chosen].tolist()}")


def check_poses(what: Case, rng: np.random.Generator) -> Iterator[Finding]:
    """Random poses around the arm and far away: whatever is called a success must be one."""
    spread = 10.0 ** rng.uniform(-2.0, 8.0) if rng.random() < 0.2 else 1.2
    positions, turns = rng.uniform(-spread, spread, (BATCH, 3)), rng.uniform(-4.0, 4.0, (BATCH, 3))
    T = np.array([pose(xyz, rpy=rpy).homogeneous for xyz, rpy in zip(positions, turns, strict=True)])
    seeds = what.solver.robot.sample(rng, BATCH)
    batch = what.solver.solve_batch(T, seeds, closest=False)
    yield from _successes(what, f"{what.solver.robot.name}, random poses", T, batch.q, batch.success, seeds)
    reach = 2.0 + np.linalg.norm(what.T_frame_tool[:3, 3])  # [m] more than any bundled arm is long
    for index in np.flatnonzero(np.linalg.norm(T[:, :3, 3], axis=1) > reach):
        if batch.status[index] is not Status.UNREACHABLE:
            yield Finding("wrong", "far poses", f"{batch.status[index].name} at {T[index, :3, 3].tolist()}")


def _successes(
    what: Case, label: str, T: Array, q: Array, success: NDArray[np.bool_], seeds: Array
) -> Iterator[Finding]:
    """Every success is inside the limits, at its target, and near its seed."""
    robot, chain = what.solver.robot, what.chain
    reached = what.forward(q)
    position = np.linalg.norm(reached[:, :3, 3] - T[:, :3, 3], axis=1)
    angle = rotation_error(reached[:, :3, :3], T[:, :3, :3])
    for name, bad in (
        ("outside the limits", ((q < chain.lower) | (q > chain.upper)).any(axis=1)),
        ("off the target", (position > TOLERANCE + ROUNDING) | (angle > TOLERANCE + ROUNDING)),
        ("far from the seed", (np.abs(q - seeds)[:, robot.unlimited] > HALF_TURN).any(axis=1)),
    ):
        for index in np.flatnonzero(success & bad):
            yield Finding("wrong", label, f"success {name}: q = {q[index].tolist()}, seed = {seeds[index].tolist()}")
