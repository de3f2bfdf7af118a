"""How close the closest configuration is, and how long it takes, against many descents of an independent search.

python -m benchmarks.closest [--robot j2n6s300] [--count 40] [--starts 200] [--seed 0]

The other search is L-BFGS-B (Byrd, Lu, Nocedal, Zhu, 1995) within the limits, on the measure and its gradient by
Pinocchio, from random configurations. It takes seconds for each target: a thousand targets are half an hour.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from scipy.optimize import Bounds, minimize

import jacokin
from benchmarks import report
from jacokin import IKSolver, Robot
from jacokin.arrays import Array

RADIAN_IN_METRES = 0.1  # [m/rad] of the measure
BEATEN = 1e-5  # [m] in the measure
MAX_ITERATIONS = 300
TINY = 1e-12  # an error below this has no direction


@dataclass(frozen=True, slots=True)
class Figures:
    """Over all targets."""

    count: int
    beaten: int
    """Targets for which the other search came closer by more than 1e-5 m."""
    closer: int
    """Targets for which this one did."""
    worst: float
    """[m] by which the other search was closer at most."""
    median: float
    """[s] and the 99th percentile, of a solve."""
    p99: float


def targets_not_reached(robot: Robot, rng: np.random.Generator, count: int) -> list[Array]:
    """Poses beyond the limits, in a box around the arm, and beyond its reach, a third each."""
    solver = IKSolver(robot, collision="ignore")
    found: list[Array] = []
    for kind in range(3):
        wanted = count * (kind + 1) // 3
        while len(found) < wanted:
            if kind == 0:
                T = robot.forward_kinematics(rng.uniform(-np.pi, 2.0 * np.pi, robot.dof))
            elif kind == 1:
                T = jacokin.pose(rng.uniform([-0.9, -0.9, -0.6], [0.9, 0.9, 1.2]), rpy=rng.uniform(-np.pi, np.pi, 3))
            else:
                direction = rng.standard_normal(3)
                away = direction / np.linalg.norm(direction) * rng.uniform(0.9, 2.5)
                T = jacokin.pose(away, rpy=rng.uniform(-np.pi, np.pi, 3))
            if not solver.solve(T, closest=False).success:
                found.append(T.homogeneous)
    return found


def measure_and_gradient(robot: Robot, target: Array) -> Callable[[Array], tuple[float, Array]]:
    """Position error + 0.1 m/rad x orientation error of a configuration, and its gradient, by Pinocchio."""

    def measure(q: Array) -> tuple[float, Array]:
        jacobian, T = robot.jacobian(q), robot.forward_kinematics(q)
        away = T.translation - target[:3, 3]
        distance = float(np.linalg.norm(away))
        turn = pin.log3(target[:3, :3].T @ T.rotation)
        angle = float(np.linalg.norm(turn))
        axis = target[:3, :3] @ (turn / max(angle, TINY))
        gradient = jacobian[:3].T @ (away / max(distance, TINY)) + RADIAN_IN_METRES * (jacobian[3:].T @ axis)
        return distance + RADIAN_IN_METRES * angle, gradient

    return measure


def least(robot: Robot, target: Array, starts: Array) -> float:
    """The least measure that descents from the starts (n, dof) end in [m]."""
    bounds = Bounds(robot.lower, robot.upper)
    measure = measure_and_gradient(robot, target)
    return min(
        float(
            minimize(
                measure, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": MAX_ITERATIONS}
            ).fun
        )
        for start in starts
    )


def compare(robot: Robot, targets: list[Array], starts: int, rng: np.random.Generator) -> Figures:
    """Both searches on every target."""
    solver = IKSolver(robot, collision="ignore")
    solver.solve(targets[0])  # imports
    ahead, seconds = [], []
    for target in targets:
        begin = time.perf_counter()
        result = solver.solve(target)
        seconds.append(time.perf_counter() - begin)
        own = result.position_error + RADIAN_IN_METRES * result.orientation_error
        ahead.append(own - least(robot, target, robot.sample(rng, starts)))
    return Figures(
        count=len(targets),
        beaten=sum(by > BEATEN for by in ahead),
        closer=sum(by < -BEATEN for by in ahead),
        worst=max(ahead),
        median=float(np.median(seconds)),
        p99=float(np.percentile(seconds, 99)),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="j2n6s300")
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--starts", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    robot, rng = jacokin.load_robot(options.robot), np.random.default_rng(options.seed)
    figures = compare(robot, targets_not_reached(robot, rng, options.count), options.starts, rng)
    print(
        f"{options.robot}: {figures.count} targets, beaten by {options.starts} descents in {figures.beaten} "
        f"(by {report.number(max(figures.worst, 0.0), 'm')} at most), closer in {figures.closer}; "
        f"median {report.seconds(figures.median)}, p99 {report.seconds(figures.p99)}"
    )


if __name__ == "__main__":
    main()
