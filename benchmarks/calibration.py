"""Calibration of simulated arms whose truth is known: what is reached, beside what no estimate beats.

python -m benchmarks.calibration [--arms 100] [--parts bound,arms,touch,branches]

Every arm is moved by its own amount: each joint by 0.5 to 3 mm and 2 to 10 mrad, its zero by up to 1 degree; the
instrument's noise is 0.3 mm. The bound of an arm is that of Cramer and Rao with the datasheet as prior, at the arm,
by robots with one number changed: nothing of the estimator is in it.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import pinocchio as pin

import jacokin
from benchmarks.six_joints import BruteForce, contains
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.calibration import Calibration, Measurements, Prior, calibrate, plan_measurements, predict_accuracy
from jacokin.ik.geometry import chain_of
from jacokin.model import MeasuredArm, MeasuredJoint
from jacokin.model.measured_arm import joints_fingerprint

NOISE, TURNED = 3e-4, 1e-3  # [m], [rad] of poses
SHIFTS, TILTS, OFFSET = (0.5e-3, 3e-3), (2e-3, 10e-3), np.radians(1.0)  # [m], [rad], [rad]
UNSEEN = 200  # poses that an error is the mean of
STEP = 1e-5  # [m] and [rad] of differences
OUTLIER, SHARE = 0.05, 0.1  # [m], of the rows
STARTS, POSES = 100, 2  # of the brute force, for each arm
FACTS = Prior(offset=3e-3)  # every joint frame 1 mm and 3 mrad off

robot = jacokin.load_robot()
FINGERPRINT = joints_fingerprint(robot.pin_model, robot.base)


@dataclass(frozen=True, slots=True)
class Hidden:
    """An arm that nobody knows."""

    numbers: Array
    """(6, 6) x, y, z [m], axis x and y, offset [rad] of each joint."""
    prior: Array
    """(36,) standard deviations that they were drawn with."""
    robot: Robot


def measured(numbers: Array) -> MeasuredArm:
    """The arm with these numbers."""
    joints = []
    for x, y, z, a, b, offset in numbers.tolist():
        joints.append(MeasuredJoint((x, y, z), (a, b, float(np.sqrt(1.0 - a * a - b * b))), offset))
    return MeasuredArm(robot.name, FINGERPRINT, tuple(zip(robot.joint_names, joints, strict=True)))


def hidden(seed: int) -> Hidden:
    """An arm of a seed: each joint moved in a random direction by its own amount."""
    rng = np.random.default_rng(seed)
    shift, tilt = rng.uniform(*SHIFTS, 6), rng.uniform(*TILTS, 6)
    directions = rng.normal(size=(6, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    heading = rng.uniform(-np.pi, np.pi, 6)
    offset = rng.uniform(-OFFSET, OFFSET, 6)
    numbers = np.column_stack([shift[:, None] * directions, tilt * np.cos(heading), tilt * np.sin(heading), offset])
    one = np.ones((6, 1))
    prior = np.hstack([
        shift[:, None] / np.sqrt(3.0) * one.repeat(3, 1), tilt[:, None] / np.sqrt(2.0) * one.repeat(2, 1),
        one * OFFSET / np.sqrt(3.0),
    ])  # fmt: skip
    return Hidden(numbers, prior.ravel(), jacokin.load_robot(calibration=measured(numbers)))


def points(arm: Robot, q: Array) -> Array:
    """(n, 3) of the tip [m]."""
    return np.array([arm.placement(row, arm.frame_id()).translation.copy() for row in q])


def points_of(numbers: Array, q: Array) -> Array:
    """As `points`, of an arm that is not loaded as a robot."""
    model = pin.Model(robot.pin_model)
    measured(numbers).apply(model, robot.base)
    data, frame, found = model.createData(), robot.frame_id(), np.empty((len(q), 3))
    for k, row in enumerate(q):
        pin.forwardKinematics(model, data, row)
        found[k] = pin.updateFramePlacement(model, data, frame).translation
    return found


def derivatives(numbers: Array, q: Array) -> Array:
    """(n, 3, 36) of the tip by differences between robots."""
    found = np.empty((len(q), 3, 36))
    for column in range(36):
        sides = []
        for sign in (STEP, -STEP):
            other = numbers.copy()
            other[column // 6, column % 6] += sign
            sides.append(points_of(other, q))
        found[:, :, column] = (sides[0] - sides[1]) / (2.0 * STEP)
    return found


def bound(rows: Array, unseen: Array, prior: Array) -> float:
    """Mean error [m] that no estimate beats, on average over arms of this prior."""
    flat = rows.reshape(-1, 36) * prior / NOISE
    root = np.linalg.cholesky(np.linalg.inv(flat.T @ flat + np.eye(36))) * prior[:, None]
    return float(np.linalg.norm(unseen @ root @ np.random.default_rng(0).normal(size=(36, 300)), axis=1).mean())


def show(title: str, values: list[float], limits: tuple[float, ...] = ()) -> None:
    """Median, 5 and 95 percentiles, and how many are within limits."""
    low, middle, high = np.percentile(values, [5, 50, 95])
    within = ", ".join(f"{np.sum(np.array(values) <= limit)} of {len(values)} <= {limit:g}" for limit in limits)
    print(f"{title:58} {middle:8.3f}  ({low:.3f} .. {high:.3f})  {within}")


def bounds() -> None:
    """The figures that the bound has for 1 mm and 3 mrad a joint."""
    rng = np.random.default_rng(0)
    for n in (10, 15, 20, 30, 60):
        random = [predict_accuracy(robot, robot.sample(rng, n), prior=FACTS).after for _ in range(5)]
        designed = predict_accuracy(robot, plan_measurements(robot, n, prior=FACTS), prior=FACTS)
        print(f"{n:3} positions: random {1e3 * np.mean(random):.3f} mm, designed {1e3 * designed.after:.3f} mm")
    for random_count in (20, 30, 60):
        wanted = np.mean(
            [predict_accuracy(robot, robot.sample(rng, random_count), prior=FACTS).after for _ in range(10)]
        )
        n = random_count
        while predict_accuracy(robot, plan_measurements(robot, n - 1, prior=FACTS), prior=FACTS).after <= wanted:
            n -= 1
        print(f"what {random_count} random positions reach ({1e3 * wanted:.3f} mm), {n} designed ones do")
    poses = predict_accuracy(robot, robot.sample(rng, 30), measured="pose", prior=FACTS)
    print(f" 30 random poses: {1e3 * poses.after:.3f} mm; before {1e3 * poses.before:.2f} mm")


def arms(count: int) -> None:
    """Thirty designed positions of each arm: errors beside the bound, intervals, cross-validation, gross errors."""
    q = plan_measurements(robot, 30)
    rng = np.random.default_rng(1)
    unseen_q = robot.sample(rng, UNSEEN)
    before, after, ratio, gross, crossed, promised, covered, seconds = ([] for _ in range(8))
    for seed in range(count):
        arm, noise = hidden(seed), np.random.default_rng(1000 + seed)
        seen = points(arm.robot, q) + noise.normal(0.0, NOISE, (len(q), 3))
        start = time.perf_counter()
        found = calibrate(robot, Measurements(q, positions=seen, sigma=NOISE))
        seconds.append(time.perf_counter() - start)
        truth = points(arm.robot, unseen_q)

        def error(calibration: Calibration, truth: Array = truth) -> float:
            return float(np.linalg.norm(points(calibration.robot, unseen_q) - truth, axis=1).mean())

        least = bound(derivatives(arm.numbers, q), derivatives(arm.numbers, unseen_q[:50]), arm.prior)
        before.append(1e3 * float(np.linalg.norm(points(robot, unseen_q) - truth, axis=1).mean()))
        after.append(1e3 * error(found))
        ratio.append(error(found) / least)
        promised.append(found.expected_error / error(found))
        missed = points(found.robot, unseen_q) - truth + noise.normal(0.0, NOISE, truth.shape)
        crossed.append(found.cross_validated / float(np.linalg.norm(missed, axis=1).mean()))
        covered.append(coverage(found, arm))
        bad = noise.choice(len(q), int(SHARE * len(q)), replace=False)
        away = noise.normal(size=(len(bad), 3))
        seen[bad] += OUTLIER * away / np.linalg.norm(away, axis=1)[:, None]
        gross.append(error(calibrate(robot, Measurements(q, positions=seen, sigma=NOISE))) / error(found))
    show("error before [mm]", before)
    show("error after 30 designed positions [mm]", after)
    show("error over the arm's own bound", ratio, (1.1, 1.4))
    show("expected_error over the true one", promised)
    show("cross-validated error over the true one, noise in both", crossed)
    print(f"{'of it, within 15 %':58} {np.mean(np.abs(np.array(crossed) - 1.0) < 0.15):8.0%}")
    show("error with 10 % of gross errors over that without", gross, (1.2,))
    print(f"{'95 % intervals of what shows hold the truth':58} {np.mean(covered):8.1%}")
    show("time of a calibration [s]", seconds)


def coverage(found: Calibration, arm: Hidden) -> float:
    """Share of the combinations that show whose 95 % intervals hold the truth."""
    known = found.fit.identifiability.known / found.model.prior
    missed = known @ (found.fit.x - arm.numbers.ravel())
    sigma = np.sqrt(np.einsum("ij,jk,ik->i", known, found.covariance, known))
    return float(np.mean(np.abs(missed) < 1.959964 * sigma))


def touched(arm: Robot, height: float, count: int, rng: np.random.Generator) -> Array:
    """Configurations (count, 6) in which the tip touches a level plane, give or take the noise."""
    solver, rows = jacokin.IKSolver(arm, collision="ignore"), list[Array]()
    while len(rows) < count:
        place = np.array([*rng.uniform(-0.6, 0.6, 2), height + rng.normal(0.0, NOISE)])
        result = solver.solve(
            jacokin.pose(place, rpy=[np.pi + rng.normal(0, 0.5), rng.normal(0, 0.5), 0]), seed=arm.sample(rng)
        )
        if result.success:
            rows.append(result.q)
    return np.array(rows)


def touch(count: int) -> None:
    """Sixty touches of one plane, wherever it is, by the same arms."""
    rng = np.random.default_rng(2)
    unseen_q = robot.sample(rng, UNSEEN)
    errors, ratio = list[float](), list[float]()
    for seed in range(count):
        arm = hidden(seed)
        q = touched(arm.robot, 0.1, 60, rng)
        found = calibrate(robot, Measurements(q, contact="plane", sigma=NOISE))
        error = float(np.linalg.norm(points(found.robot, unseen_q) - points(arm.robot, unseen_q), axis=1).mean())
        rows = derivatives(arm.numbers, q)[:, 2]  # of the height; the plane's own three numbers are found with them
        plane = np.column_stack([np.ones(len(q)), points(arm.robot, q)[:, :2]])
        rows = rows - plane @ np.linalg.lstsq(plane, rows, rcond=None)[0]
        errors.append(1e3 * error)
        ratio.append(error / bound(rows[:, None], derivatives(arm.numbers, unseen_q[:50]), arm.prior))
    show("error after 60 touches of one plane [mm]", errors)
    show("error over the arm's own bound", ratio, (1.1, 1.4))


def branches(count: int) -> None:
    """All branches of the arms against Newton's method from random starts, and the time of `solve`."""
    known = lost = own = 0
    times = list[float]()
    for seed in range(count):
        arm = hidden(seed).robot
        brute = BruteForce(chain_of(arm.pin_model, arm.frame_id(), None, 6))
        solver = jacokin.IKSolver(arm, collision="ignore")
        rng = np.random.default_rng(seed)
        for q in arm.sample(rng, POSES):
            target = brute.pose(q)
            found = solver.solve_all(target).q
            own += brute.regular(q) and not contains(found, q, 1e-6)
            for other in brute.branches(target, STARTS, rng):
                known += 1
                lost += not contains(found, other, 1e-6)
            times.append(1e6 * fastest(partial(solver.solve, target, seed=q)))
    print(f"{count * POSES} poses of {count} arms: {known} regular branches by brute force, {lost} lost; {own} own")
    show("solve [us]", times)


def fastest(call: Callable[[], object]) -> float:
    """The best of some calls [s]."""
    best = np.inf
    for _ in range(7):
        start = time.perf_counter()
        call()
        best = min(best, time.perf_counter() - start)
    return float(best)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, default=100)
    parser.add_argument("--parts", default="bound,arms,touch,branches")
    given = parser.parse_args()
    for part in given.parts.split(","):
        print(f"--- {part}")
        if part == "bound":
            bounds()
        else:
            {"arms": arms, "touch": touch, "branches": branches}[part](given.arms)


if __name__ == "__main__":
    main()
