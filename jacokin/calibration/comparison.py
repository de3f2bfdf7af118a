"""`compare`: whether two calibrations found the same arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from jacokin.arrays import Array
from jacokin.calibration.arm_model import ArmKinematics
from jacokin.calibration.calibration import Calibration
from jacokin.errors import InvalidInputError
from jacokin.model import checks

DISAGREE = 0.01  # probability that two calibrations of one arm are said to differ
RANK = 1e-9  # of the largest variance of a difference: below, both know nothing
NULL = 1e-6  # of a combination that does not show: a smaller part of it is rounding
POSES = 400  # random configurations that a difference in metres is taken over


@dataclass(frozen=True, slots=True)
class Comparison:
    """How far two calibrations are from each other."""

    agree: bool
    """Whether they may be those of one arm: `p_value` is at least 0.01."""
    p_value: float
    """Probability that two calibrations of one arm differ as much, or more."""
    distance: float
    """Mean distance of their tips at random configurations [m]."""
    expected: float
    """What it is on average for two calibrations of one arm [m]."""
    largest: tuple[str, float]
    """The number that differs most, and by how many standard deviations of the difference."""

    def __str__(self) -> str:
        """One sentence."""
        name, size = self.largest
        verdict = "agree" if self.agree else "do not agree"
        return (
            f"they {verdict} (p = {self.p_value:.2g}): tips differ by {1e3 * self.distance:.3f} mm, for one arm "
            f"{1e3 * self.expected:.3f} mm are usual; most differs {name}, by {size:.1f} standard deviations"
        )


def compare(first: Calibration, second: Calibration) -> Comparison:
    """Whether two calibrations, from measurements that have no row in common, agree within their uncertainty.

    Both are drawn towards the description by their prior, which does not count as agreement.

    Raises:
        InvalidInputError: not calibrations, or of different robots, numbers or priors.
    """
    for name, each in (("first", first), ("second", second)):
        checks.instance(name, each, Calibration, "a Calibration")
    joints = [name for name, _ in first.measured_arm.joints]
    names = [name for name in first.parameters if name.rpartition(".")[0] in joints]
    others = [name for name in second.parameters if name.rpartition(".")[0] in joints]
    if first.measured_arm.fingerprint != second.measured_arm.fingerprint or names != others:
        raise InvalidInputError("the calibrations must be those of one robot, and of the same numbers")
    prior = np.array([first.parameters[name].prior for name in names])
    if prior.tolist() != [second.parameters[name].prior for name in names]:
        raise InvalidInputError("the calibrations must have the same prior")
    size = len(names)
    apart = (first.fit.x[:size] - second.fit.x[:size]) / prior
    pulled, spread = np.zeros((size, size)), np.zeros((size, size))
    for sign, each in ((1.0, first), (-1.0, second)):
        covariance = each.covariance[:size, :size] / np.outer(prior, prior)
        # The estimate is (1 - covariance) truth + noise, and the truth as far from zero as the prior has it.
        kept = np.eye(size) - covariance
        pulled += sign * kept
        spread += kept @ covariance
    spread = pulled @ pulled.T + 0.5 * (spread + spread.T)
    shown = _shown(first, size)
    along = shown @ apart
    p_value = float(chi2.sf(along @ np.linalg.solve(shown @ spread @ shown.T, along), len(along)))
    deviation = np.sqrt(np.maximum(spread.diagonal(), RANK * spread.diagonal().max()))
    most = int(np.argmax(np.abs(apart) / deviation))
    distance, expected = _tips(first, second, spread * np.outer(prior, prior))
    largest = names[most], float(apart[most] / deviation[most])
    return Comparison(p_value >= DISAGREE, p_value, distance, expected, largest)


def _shown(calibration: Calibration, size: int) -> Array:
    """Combinations (k, size) of the joints' numbers that show, whatever base and tool are; orthonormal rows.

    Along the others an estimate keeps the description, and the rest of a difference there is of second order.
    """
    known = calibration.fit.identifiability.known
    hidden = np.linalg.svd(known)[2][len(known) :, :size]
    _, values, rows = np.linalg.svd(hidden)
    return np.asarray(rows[int(np.sum(values > NULL)) :])


def _tips(first: Calibration, second: Calibration, spread: Array) -> tuple[float, float]:
    """Mean distance of the tips at random configurations, and what it is for differences of a covariance [m]."""
    rng = np.random.default_rng(0)
    robot = first.described
    sags = bool(first.measured_arm.drives or second.measured_arm.drives)
    chain, q = ArmKinematics(robot, None, sags=sags), robot.sample(rng, POSES)
    ours, theirs = (chain.at(q, each.model.joints(each.fit.x)) for each in (first, second))
    free = first.model.free_columns
    jacobian = ours.linear.reshape(POSES, 3, -1)[:, :, free]
    values, axes = np.linalg.eigh(spread)
    draws = axes * np.sqrt(np.maximum(values, 0.0)) @ rng.normal(size=(len(values), 100))
    expected = float(np.linalg.norm(jacobian @ draws, axis=1).mean())
    return float(np.linalg.norm(ours.position - theirs.position, axis=1).mean()), expected
