"""Random arms, random instruments, and rows that are grossly wrong: `calibrate` refuses by name, or finds the arm."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from fuzz.findings import Finding
from jacokin import load_robot, pose
from jacokin.arrays import Array
from jacokin.calibration import Calibration, Measurements, calibrate
from jacokin.errors import JacokinError
from jacokin.model import NAMES, MeasuredArm, MeasuredJoint, Robot
from jacokin.model.measured_arm import joints_fingerprint

ROUNDING = 1e-9  # of a covariance


def run(seed: int, first: int, cases: int) -> Iterator[tuple[int, int, list[Finding]]]:
    """Case after case, one arm each."""
    for case in range(first, first + cases):
        rng = np.random.default_rng([seed, case])
        yield case, 1, list(check(_robot(NAMES[int(rng.integers(len(NAMES)))]), rng))


_robot = cache(load_robot)


def hidden_arm(robot: Robot, rng: np.random.Generator) -> tuple[Robot, Array]:
    """An arm as the prior has arms, and its joints (dof, 6): x, y, z, tilt about x and y, offset."""
    numbers = rng.normal(0.0, [1e-3, 1e-3, 1e-3, 3e-3, 3e-3, np.radians(1.0)], (robot.dof, 6))
    joints = []
    for x, y, z, first, second, offset in numbers.tolist():
        axis = (first, second, float(np.sqrt(1.0 - first**2 - second**2)))
        joints.append(MeasuredJoint((x, y, z), axis, offset))
    digest = joints_fingerprint(robot.pin_model, robot.base)
    arm = MeasuredArm(robot.name, digest, tuple(zip(robot.joint_names, joints, strict=True)))
    return load_robot(robot.name, calibration=arm), numbers


def measured(
    arm: Robot, rng: np.random.Generator, rows: int, gross: float
) -> tuple[Measurements, NDArray[np.intp], dict[str, Any]]:
    """What an instrument says, which rows (k,) are grossly wrong, and how it was made."""
    q = arm.sample(rng, rows)
    places = np.array([arm.forward_kinematics(row).homogeneous for row in q])
    sigma = 10.0 ** rng.uniform(-4.5, -2.5)  # [m]
    options: dict[str, Any] = {"base": "known", "tool": "known"}
    if rng.random() < 0.4:
        options["tool"] = "unknown"
        places = places @ pose(rng.uniform(-0.05, 0.05, 3)).homogeneous
    if rng.random() < 0.4:
        options["base"] = "unknown"
        places = pose(rng.uniform(-0.5, 0.5, 3), rpy=rng.uniform(-0.5, 0.5, 3)).homogeneous @ places
    kind = ("positions", "poses", "distances")[int(rng.integers(3))]
    wrong = rng.choice(rows, int(gross * rows), replace=False)
    places[:, :3, 3] += sigma * rng.normal(size=(rows, 3))
    if kind == "distances":
        points = rng.uniform(-2.0, 2.0, (4, 3))[rng.integers(4, size=rows)]
        values = np.linalg.norm(places[:, :3, 3] - points, axis=1)
        values[wrong] *= rng.choice([0.0, 1e3, np.nan, -1.0, 2.0], len(wrong))
        return Measurements(q, distances=values, points=points, sigma=sigma, **options), wrong, options
    if kind == "poses":
        for place in places:
            turn = 3.0 * sigma * rng.normal(size=3)
            place[:3, :3] = place[:3, :3] @ pose(np.zeros(3), rpy=turn).rotation
        places[wrong, :3, 3] += rng.choice([0.3, -5.0, 1e3, np.nan], (len(wrong), 1))
        return Measurements(q, poses=places, sigma=(sigma, 3.0 * sigma), **options), wrong, options
    places[wrong, :3, 3] += rng.choice([0.3, -5.0, 1e3, np.nan, np.inf], (len(wrong), 1))
    return Measurements(q, positions=places[:, :3, 3], sigma=sigma, **options), wrong, options


def check(robot: Robot, rng: np.random.Generator) -> Iterator[Finding]:
    """One arm."""
    arm, numbers = hidden_arm(robot, rng)
    rows = int(10.0 ** rng.uniform(0.0, 2.0))
    gross = float(rng.choice([0.0, 0.1, 0.3]))  # share of the rows
    measurements, wrong, options = measured(arm, rng, rows, gross)
    groups = rng.choice(["geometry", "offset", "scale", "compliance"], int(rng.integers(1, 4)), replace=False).tolist()
    parameters = "auto" if rng.random() < 0.6 else groups
    given = f"{robot.name}, {rows} {measurements.kind}, {len(wrong)} wrong, {options}, {parameters}"
    try:
        found = calibrate(robot, measurements, parameters)
        texts = [str(found), *map(str, found.rejected), *found.warnings()]
        load_robot(robot.name, calibration=found.measured_arm) if parameters == "auto" else None
    except JacokinError as error:
        # Few rows, most of them wrong, or places that cannot be told from another frame, are refused in words.
        if rows >= 40 and parameters == "auto" and options["base"] == options["tool"] == "known":
            yield Finding("raw", "calibrate", f"{error}; {given}")
        return
    if not all(texts):
        yield Finding("wrong", "calibrate: an empty sentence", given)
    yield from check_covariance(found, given)
    left_out = {each.row for each in found.rejected}
    if rows >= 40 and parameters == "auto" and not left_out >= set(wrong.tolist()):
        yield Finding("wrong", "calibrate: used rows that are wrong", f"{set(wrong.tolist()) - left_out}; {given}")
    if rows >= 40 and parameters == "auto" and len(left_out) > len(wrong) + 2:
        yield Finding("lost", "calibrate: left good rows out", f"{len(left_out)}; {given}")
    if parameters == "auto":
        yield from check_truth(found, numbers, given)


def check_covariance(found: Calibration, given: str) -> Iterator[Finding]:
    """Symmetric, not negative, and nowhere larger than the prior's."""
    covariance = found.covariance
    prior = np.array([each.prior for each in found.parameters.values()])
    scaled = covariance / np.outer(prior, prior)
    values = [each.value for each in found.parameters.values()]
    if not (np.isfinite(covariance).all() and np.isfinite(values).all()):
        yield Finding("wrong", "calibrate: not finite", given)
        return
    eigenvalues = np.linalg.eigvalsh(0.5 * (scaled + scaled.T))
    if np.abs(scaled - scaled.T).max() > ROUNDING or eigenvalues[0] < -ROUNDING or eigenvalues[-1] > 1.0 + ROUNDING:
        yield Finding("wrong", "calibrate: covariance", f"eigenvalues {eigenvalues[0]} to {eigenvalues[-1]}; {given}")
    if not (found.residual >= 0.0 and found.expected_error >= 0.0 and 0.0 <= found.p_value <= 1.0):
        yield Finding("wrong", "calibrate: figures", f"{found.residual}, {found.expected_error}; {given}")


def check_truth(found: Calibration, numbers: Array, given: str) -> Iterator[Finding]:
    """The arm that was measured is not beyond what the covariance allows."""
    keys = ("x", "y", "z", "axis_x", "axis_y", "offset")
    names = list(found.parameters)
    rows, away = [], []
    for joint, row in zip(found.described.joint_names, numbers, strict=True):
        for key, value in zip(keys, row.tolist(), strict=True):
            if f"{joint}.{key}" in found.parameters:
                rows.append(names.index(f"{joint}.{key}"))
                away.append(found.parameters[f"{joint}.{key}"].value - value)
    difference = np.array(away)
    square = float(difference @ np.linalg.pinv(found.covariance[np.ix_(rows, rows)], rcond=1e-12) @ difference)
    if chi2.sf(square, len(rows)) < 1e-9:  # probability of a true arm so far from the one that is found
        yield Finding("wrong", "calibrate: too sure", f"chi square {square:.4g} of {len(rows)}; {given}")
