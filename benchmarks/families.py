"""Families of configurations: on six joints against scans of 20,000 parameters; members, completeness, time.

Run ``python -m benchmarks.families [targets]``; 300 of each kind take some minutes.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import jacokin
from jacokin import FreeAxis, IKSolver
from jacokin.ik import Family
from jacokin.model.angles import TURN, wrap_to_pi

SCANNED = 20_000
LONG = 1e-3  # [rad] of an interval that must be found


def scan_free_axis(solver: IKSolver, target: FreeAxis, parameters: NDArray[np.float64]) -> NDArray[np.int64]:
    """Branches within the limits at each parameter, pose by pose."""
    poses = np.array([target.matrix_at(p) for p in parameters])
    rows = solver.closed_form().solve_batch(poses, np.tile(solver.robot.home, (len(poses), 1)))
    return rows.branches_within_limits


def differing(family: Family, parameters: NDArray[np.float64], counts: NDArray[np.int64]) -> float:
    """Longest run [rad] of parameters at which the family has another number of members than the scan."""
    mine = np.zeros(len(parameters), dtype=np.int64)
    for interval in family:
        for turns in (-TURN, 0.0, TURN):
            mine += (parameters + turns >= interval.start) & (parameters + turns < interval.stop)
    longest = run = 0
    for wrong in mine != counts:
        run = run + 1 if wrong else 0
        longest = max(longest, run)
    return longest * TURN / len(parameters)


def members_are_good(solver: IKSolver, family: Family, target: FreeAxis | pin.SE3) -> bool:
    """Whether members at the ends and between close to 1e-9 and lie within the limits, by forward kinematics."""
    for interval in family:
        for p in np.linspace(interval.start, interval.stop, 7):
            q = interval.at(p)
            T = target.at(p) if isinstance(target, FreeAxis) else target
            error = np.abs(T.actInv(solver.robot.forward_kinematics(q)).homogeneous - np.eye(4)).max()
            if error > 1e-9 or not solver.robot.within_limits(q):
                return False
    return True


def free_axes(size: int, seed: int = 0) -> None:
    """Random free axes on six joints."""
    solver, rng = IKSolver(jacokin.load_robot()), np.random.default_rng(seed)
    parameters = -np.pi + TURN * (np.arange(SCANNED) + 0.5) / SCANNED
    times: list[float] = []
    missed = bad = incomplete = own = 0
    for number in range(size):
        q = solver.robot.sample(rng)
        axis = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), rng.normal(size=3))[number % 3]
        target = FreeAxis(solver.robot.forward_kinematics(q), axis=axis)
        start = time.process_time()
        family = solver.family(target)
        times.append(time.process_time() - start)
        incomplete += not family.complete
        missed += differing(family, parameters, scan_free_axis(solver, target, parameters)) > LONG
        bad += not members_are_good(solver, family, target)
        own += any(np.abs(wrap_to_pi(i.at(0.0) - q)).max() < 1e-6 for i in family if i.contains(0.0))
    _report("six joints, free axis", size, missed, bad, incomplete, own, times)


def seven_joints(size: int, seed: int = 0) -> None:
    """Random and structured poses of seven joints; every member is checked, and the seed's own is looked for."""
    solver, rng = IKSolver(jacokin.load_robot("j2s7s300")), np.random.default_rng(seed)
    robot = solver.robot
    times: list[float] = []
    single: list[float] = []
    bad = incomplete = own = 0
    for number in range(size):
        q = robot.sample(rng)
        if number % 4 == 1:  # stretched
            q[3] = np.pi + rng.uniform(-0.02, 0.02)
        elif number % 4 == 2:  # on a limit
            joint = (1, 3, 5)[number // 4 % 3]
            q[joint] = (robot.lower, robot.upper)[number // 12 % 2][joint]
        target = robot.forward_kinematics(q)
        start = time.process_time()
        family = solver.family(target)
        times.append(time.process_time() - start)
        start = time.process_time()
        solver.solve(target)
        single.append(time.process_time() - start)
        incomplete += not family.complete
        bad += not members_are_good(solver, family, target)
        own += any(np.abs(wrap_to_pi(i.at(q[2]) - q)).max() < 1e-6 for i in family if i.contains(q[2]))
    _report("seven joints (not scanned)", size, None, bad, incomplete, own, times)
    print(f"  solve: {1e3 * np.median(single):.2f} ms median")


def _report(what: str, size: int, missed: int | None, bad: int, incomplete: int, own: int, times: list[float]) -> None:
    scanned = "" if missed is None else f"{missed} with an interval over {LONG:g} rad that differs from the scan, "
    print(
        f"{what}: {size} targets, {scanned}{bad} with a bad member, {incomplete} incomplete, {own} with the generating "
        f"configuration; solve_all {1e3 * np.median(times):.2f} ms median, {1e3 * max(times):.2f} ms at most"
    )


def main() -> None:
    """Run both."""
    size = int(sys.argv[1]) if len(sys.argv) > 1 else 300
    jacokin.warmup()
    free_axes(size)
    seven_joints(size)


if __name__ == "__main__":
    main()
