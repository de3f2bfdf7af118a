"""Arms of six turning joints and any geometry, special ones among them: the law of own answers, and every branch."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin

from fuzz import own_answers
from fuzz.findings import Finding
from jacokin import IKSolver, load_robot
from jacokin.arrays import Array
from jacokin.errors import JacokinError
from jacokin.model import Robot
from jacokin.model.angles import wrap_to_pi

CONFIGURATIONS = 10  # in one case
REGULAR = 3e-3  # smallest singular value of a configuration that must be among the branches
SAME = 1e-6  # [rad]
ARMS = 5  # configurations that decide whether an arm can move its tool in all directions


def run(seed: int, first: int, cases: int) -> Iterator[tuple[int, int, list[Finding]]]:
    """Case after case, one arm each."""
    with tempfile.TemporaryDirectory() as folder:
        for case in range(first, first + cases):
            rng = np.random.default_rng([seed, case])
            path = Path(folder) / "arm.urdf"
            path.write_text(random_arm(rng), encoding="utf-8")
            yield case, CONFIGURATIONS, list(check(path, rng))


def random_arm(rng: np.random.Generator) -> str:
    """A URDF: lengths often zero, angles often quarter turns, joints with and without limits, some moved a little."""
    special = rng.random()  # how much of it is
    moved = 10.0 ** rng.uniform(-10.0, -2.0) if rng.random() < 0.3 else 0.0  # [m] and [rad]
    joints = []
    for number in range(6):
        a, d = (0.0 if rng.random() < 0.6 * special else rng.uniform(-0.5, 0.5) for _ in range(2))
        alpha = rng.uniform(-math.pi, math.pi)
        if rng.random() < special:
            alpha = 0.5 * math.pi * rng.integers(-1, 3)
        x, y, z = (np.array([a, 0.0, d]) + moved * rng.normal(size=3)).tolist()
        roll, pitch, yaw = (np.array([alpha, 0.0, 0.0]) + moved * rng.normal(size=3)).tolist()
        kind, limit = "continuous", '<limit effort="10" velocity="1"/>'
        if rng.random() < 0.6:
            low, high = np.sort(rng.uniform(-2.0 * math.pi, 2.0 * math.pi, 2))
            kind, limit = "revolute", f'<limit lower="{low}" upper="{max(high, low + 1.0)}" effort="10" velocity="1"/>'
        joints.append(
            f'<joint name="joint_{number + 1}" type="{kind}"><parent link="link_{number}"/>'
            f'<child link="link_{number + 1}"/><origin xyz="{x!r} {y!r} {z!r}" rpy="{roll!r} {pitch!r} {yaw!r}"/>'
            f'<axis xyz="0 0 1"/>{limit}</joint>'
        )
    links = "".join(f'<link name="link_{number}"/>' for number in range(8))
    tip = '<joint name="tip" type="fixed"><parent link="link_6"/><child link="link_7"/><origin xyz="{} {} {}"/></joint>'
    return f'<robot name="arm">{links}{"".join(joints)}{tip.format(*rng.uniform(-0.2, 0.2, 3))}</robot>'


def check(path: Path, rng: np.random.Generator) -> Iterator[Finding]:
    """One arm."""
    try:
        robot = load_robot(path)
        if max(_least_value(robot, q) for q in robot.sample(rng, ARMS)) < REGULAR:
            return  # singular everywhere: its poses have no six joints
        solver = IKSolver(robot, collision="ignore")
    except JacokinError as error:
        yield Finding("raw", "a random arm", f"{error}; {path.read_text(encoding='utf-8')}")
        return
    for _ in range(CONFIGURATIONS):
        q = robot.sample(rng)
        step = math.pi / float(rng.choice([2.0, 4.0, 6.0]))
        kind = "random"
        if rng.random() < 0.4:
            kind, q = "round angles", np.clip(np.round(q / step) * step, robot.lower, robot.upper)
        yield from own_answers.check(solver, kind, q, rng)
        yield from check_branches(solver, q)


def check_branches(solver: IKSolver, q: Array) -> Iterator[Finding]:
    """A regular configuration is among the branches of its pose, and every branch is at the pose."""
    T = solver.verifier.tool_pose(q)
    try:
        found = solver.solve_all(T)
    except JacokinError as error:
        yield Finding("raw", "solve_all", f"{error}; q = {q.tolist()}")
        return
    for row in found.q:
        missed = pin.log6(T.actInv(solver.verifier.tool_pose(row))).vector
        if np.abs(missed).max() > SAME:
            yield Finding("wrong", "a branch off its pose", f"{np.abs(missed).max():.3g}; q = {q.tolist()}")
    near = [float(np.abs(wrap_to_pi(row - q)).max()) for row in found.q]
    if found.complete and _least_value(solver.robot, q) > REGULAR and min(near, default=np.inf) > SAME:
        yield Finding("lost", "branches, said to be complete", f"without q = {q.tolist()}")


def _least_value(robot: Robot, q: Array) -> float:
    return float(np.linalg.svd(robot.jacobian(q), compute_uv=False)[-1])
