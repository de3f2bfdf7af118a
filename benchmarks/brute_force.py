"""Branches counted by brute force: Newton's method on Pinocchio from many random starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import jacokin
from benchmarks import targets
from benchmarks.referee import apart
from jacokin import Robot
from jacokin.arrays import Array

NEWTON_STARTS = 400  # a target of the brute-force count
NEWTON_STEPS = 40
SAME_ROOT = 1e-3  # [rad]: Newton's answers this near are one branch


@dataclass(frozen=True, slots=True)
class BruteForce:
    """The branches against those that Newton's method finds from many random starts."""

    robot: str
    targets: str
    count: int
    """Targets compared: those without a curve of solutions."""
    roots: int
    """Configurations Newton found, all targets together."""
    missed: int
    """Of them, those `solve_all` does not have."""
    extra: int
    """Branches of `solve_all`, all verified, that Newton did not come to."""


def compare(robot: Robot, wanted: targets.Targets, rng: np.random.Generator) -> BruteForce:
    """Compare the branches with a search that knows nothing of the closed form."""
    solver = jacokin.IKSolver(robot, collision="ignore")
    count = total = missed = extra = 0
    for pose in wanted.poses:
        branches = solver.solve_all(pose)
        if not branches.complete:  # a curve: infinitely many
            continue
        roots = newton_roots(robot, pose, rng)
        distance = apart(roots[:, None], branches.q)
        count += 1
        total += len(roots)
        missed += int((distance.min(axis=1, initial=np.inf) > SAME_ROOT).sum())
        extra += int((distance.min(axis=0, initial=np.inf) > SAME_ROOT).sum())
    return BruteForce(robot.name, wanted.name, count, total, missed, extra)


def newton_roots(robot: Robot, pose: Array, rng: np.random.Generator) -> Array:
    """Distinct configurations (k, dof) that reach a pose, limits aside, from random starts."""
    model, data, frame = robot.pin_model, robot.pin_model.createData(), robot.frame_id()
    target = pin.SE3(pose)
    roots: list[Array] = []
    for _ in range(NEWTON_STARTS):
        q = rng.uniform(-np.pi, np.pi, robot.dof)
        for _ in range(NEWTON_STEPS):
            pin.computeJointJacobians(model, data, q)
            pin.updateFramePlacement(model, data, frame)
            jacobian = pin.getFrameJacobian(model, data, frame, pin.LOCAL)
            error = pin.log6(data.oMf[frame].actInv(target)).vector
            if np.abs(error).max() < 1e-11:  # [m] and [rad]
                if not roots or apart(np.array(roots), q).min() > SAME_ROOT:
                    roots.append(q)
                break
            try:
                step = np.linalg.solve(jacobian, error)
            except np.linalg.LinAlgError:
                break
            q = q + step * min(1.0, 1.0 / float(np.abs(step).max()))  # at most 1 rad at a time
    return np.array(roots).reshape(-1, robot.dof)


INTRODUCTION = f"""Against brute force: Newton's method from {NEWTON_STARTS} random starts a target, limits aside,
poses with a curve left out. *Missed*: found by Newton and not among the branches. *More*: verified branches that no
start of Newton's came to."""

HEADER = ("robot", "targets", "number", "found by Newton", "missed", "more")
PROMISED = ("missed", "more")


def row(compared: BruteForce) -> tuple[str, ...]:
    """A line of the table."""
    counts = (compared.count, compared.roots, compared.missed, compared.extra)
    return (compared.robot, compared.targets, *(f"{value:,}" for value in counts))
