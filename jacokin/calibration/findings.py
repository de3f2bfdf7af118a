"""`Findings`: what a fit says about an arm, what is sure about it, and what the measurements cannot tell apart."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
import pinocchio as pin
from scipy.stats import chi2

from jacokin.arrays import Array, Sealed
from jacokin.calibration.arm_model import ArmModel, Parameter
from jacokin.model import checks
from jacokin.model.measured_arm import MeasuredArm, joints_fingerprint
from jacokin.model.poses import quaternion
from jacokin.model.robot import Robot

POSES, DRAWS = 400, 100  # random configurations and arms that a mean error is taken over
NOISY = 1e-3  # probability of a chi-square that is not the stated noise's


@dataclass(frozen=True, slots=True)
class Estimate:
    """A number, and how sure it is."""

    value: float
    """In `unit`."""
    sigma: float
    """Standard deviation, prior included."""
    unit: str
    """"m", "rad", "rad/(N m)" or "1"."""
    prior: float
    """Standard deviation before anything was measured."""

    @property
    def interval(self) -> tuple[float, float]:
        """Holds the truth in 95 of 100 cases."""
        half = 1.959963984540054 * self.sigma
        return self.value - half, self.value + half


@dataclass(frozen=True, slots=True)
class Rejected:
    """A row that was not used."""

    set: int
    """Number of its set, from 0."""
    row: int
    """Its number there, from 0."""
    place: str
    """Where that is: file and line, or set and row."""
    reason: str
    """In words."""

    def __str__(self) -> str:
        """On one line."""
        return f"{self.place} {self.reason}"


@dataclass(frozen=True, slots=True)
class Trend:
    """Whether what is left unexplained goes with a joint's angle."""

    joint: str
    """Its name."""
    size: float
    """Root mean square of the part that goes with it, over the noise."""
    p_value: float
    """Probability of as much by chance."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit(Sealed):
    """What the estimate knows of itself; arrays are read-only, tuples have an entry for each set."""

    x: Array
    """(p,) the numbers."""
    covariance: Array
    """(p, p)."""
    weights: tuple[Array, ...]
    """(n,) of the rows; 0 where they were not used, and less than 1 where residuals contradict sigma."""
    before: tuple[Array, ...]
    """(n, k) predicted by the description less measured, base and tools aligned [m, rad]."""
    after: tuple[Array, ...]
    """(n, k) predicted by the calibration less measured [m, rad]."""
    leverages: tuple[Array, ...]
    """(n,) the share of a row's noise that the fit follows."""
    left_out: tuple[Array, ...]
    """(n,) how far a row is from what the others predict [m]; NaN where it was not used."""
    rejected: tuple[Rejected, ...]
    chi_square: float
    """Sum of squared residuals over their noise."""
    freedom: float
    """How large that is on average, when the stated noise is the true one."""
    identifiability: Identifiability


class Findings:
    """What is known of an arm after a fit. Immutable.

    Attributes:
        described: the robot as it is described.
        parameters: name and `Estimate` of each number.
        covariance: (p, p) of them, in their order; read-only.
        unidentified: a sentence for each combination that the measurements say nothing about: it keeps the
            description's value.
        rejected: the rows that were not used.
        measured_arm: the joints, as `load_robot(calibration=...)` takes them.
        base: T_sensor_base, where it was unknown; else None.
        tools: T_frame_target by frame, where it was unknown.
    """

    def __init__(self, robot: Robot, model: ArmModel, fit: Fit) -> None:
        """Keep a fit; users call `calibrate`."""
        self.described, self.model, self.fit = robot, model, fit
        sigma = np.sqrt(fit.covariance.diagonal()).tolist()
        self.parameters: Mapping[str, Estimate] = MappingProxyType(
            {
                each.name: Estimate(value, deviation, each.unit, each.prior)
                for each, value, deviation in zip(model.parameters, fit.x.tolist(), sigma, strict=True)
            }
        )
        self.covariance = fit.covariance
        self.unidentified = fit.identifiability.unidentified
        self.rejected = fit.rejected
        self.base = model.base(fit.x)
        self.tools: Mapping[str | None, pin.SE3] = MappingProxyType(model.tools(fit.x))
        facts = (
            ("measurements", sum(int((each > 0.0).sum()) for each in fit.weights)),
            ("rejected", len(fit.rejected)),
            ("residual [m]", self.residual),
            ("cross_validated [m]", self.cross_validated),
            ("expected_error [m]", self.expected_error),
        )
        self.measured_arm = MeasuredArm(
            robot.name,
            joints_fingerprint(robot.pin_model, robot.base),
            tuple(zip(robot.joint_names, model.measured_joints(fit.x), strict=True)),
            tuple((name, value) for name, value in facts if math.isfinite(value)),
        )

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """For pickle, which takes no read-only mapping."""
        return type(self), (self.described, self.model, self.fit)

    @property
    def placed(self) -> Mapping[str, pin.SE3]:
        """Poses that were unknown, by what they are in words."""
        found = {} if self.base is None else {"base in the instrument's frame": self.base}
        for frame, pose in self.tools.items():
            found[f"tool in {self.described.default_frame if frame is None else frame}"] = pose
        return found

    @property
    def residuals(self) -> Array:
        """(n,) what is left between prediction and measurement, all sets in a row [m]; NaN where not finite."""
        return self._lengths(self.fit.after)

    @property
    def residuals_before(self) -> Array:
        """(n,) the same for the described arm, base and tools aligned [m]."""
        return self._lengths(self.fit.before)

    def _lengths(self, missed: tuple[Array, ...]) -> Array:
        return np.concatenate([self.model.distances(k, each) for k, each in enumerate(missed)])

    @property
    def used(self) -> Array:
        """(n,) weights of the rows, all sets in a row; 0 for those that were not used."""
        return np.concatenate(self.fit.weights)

    @property
    def residual(self) -> float:
        """Root mean square of `residuals` of the rows that were used [m]; what the fit could not follow."""
        return float(np.sqrt(np.mean(self.residuals[self.used > 0.0] ** 2)))

    @property
    def cross_validated(self) -> float:
        """How far measurements are from what the others predict, in the mean [m]: the instrument's error included.

        Each tenth of the rows is left out once, and predicted by an arm that was found without it.
        """
        return float(np.nanmean(np.concatenate(self.fit.left_out)))

    @cached_property
    def expected_error(self) -> float:
        """Mean error of the point at poses that were not measured [m], as the covariance has it: without noise.

        In the instrument's frame: an unknown base may be off by what the numbers of joint_1 make good.
        """
        return mean_error(self.model, self.fit.x, self.covariance, self.described)

    @property
    def noise(self) -> float:
        """How many times larger residuals are than the stated sigma makes them; 1 where it is right."""
        return math.sqrt(self.fit.chi_square / self.fit.freedom) if self.fit.freedom > 0.0 else math.nan

    @property
    def p_value(self) -> float:
        """Probability that the stated sigma makes residuals this large, or larger."""
        return float(chi2.sf(self.fit.chi_square, max(self.fit.freedom, 1.0)))

    @cached_property
    def trends(self) -> tuple[Trend, ...]:
        """Of each joint, whether residuals go with its angle: a model that lacks something leaves a trend."""
        return tuple(_trend(self, k, name) for k, name in enumerate(self.described.joint_names))

    def warnings(self) -> tuple[str, ...]:
        """What an owner should look at, in sentences."""
        found = [str(each) for each in self.rejected]
        if self.p_value < NOISY:
            found.append(
                f"residuals are {self.noise:.2f} times what sigma says: the instrument or the model is worse, and "
                "uncertainties are that much larger"
            )
        far, name = farthest(self.model, self.fit.x)
        if far > 6.0:  # of 36 numbers, one in 10 million arms has one
            found.append(f"{name} is {far:.1f} standard deviations of the prior from the description, which is rare")
        found += [
            f"residuals go with the angle of {each.joint} (p = {each.p_value:.1e})"
            for each in self.trends
            if each.p_value < 0.01 / len(self.trends)
        ]
        return (*found, *self.unidentified)

    def __str__(self) -> str:
        """A few lines for a terminal."""
        used = self.used > 0.0
        before = float(np.sqrt(np.mean(self.residuals_before[used] ** 2)))
        return "\n".join(
            [
                f"{used.sum()} of {len(used)} measurements: "
                f"{1e3 * before:.3f} mm before, {1e3 * self.residual:.3f} mm after",
                f"left out and predicted: {1e3 * self.cross_validated:.3f} mm, the instrument's error included",
                f"expected error elsewhere: {1e3 * self.expected_error:.3f} mm",
                *(f"{name}: {pose_in_words(pose)}" for name, pose in self.placed.items()),
                str(self.measured_arm),
                f"{self.fit.identifiability.rank} of {len(self.parameters)} combinations of numbers show",
                *self.warnings(),
            ]
        )


def farthest(model: ArmModel, x: Array) -> tuple[float, str]:
    """By how many standard deviations of the prior the farthest number of a joint is off, and its words."""
    count = int(model.free_columns.sum())
    if not count:
        return 0.0, ""
    away = np.abs(x[:count]) / model.prior[:count]
    most = int(np.argmax(away))
    return float(away[most]), model.parameters[most].words


def pose_in_words(pose: pin.SE3) -> str:
    """Position and quaternion, with their units."""
    position = ", ".join(f"{value:.6f}" for value in pose.translation)
    quat = ", ".join(f"{value:.6f}" for value in quaternion(pose.rotation))
    return f"position ({position}) m, quaternion w, x, y, z ({quat})"


def mean_error(model: ArmModel, x: Array, covariance: Array, robot: Robot) -> float:
    """Mean distance [m] between where arms of a covariance have the first set's point, and the mean arm has it.

    Over random configurations of a fixed seed, in the instrument's frame.
    """
    rng = np.random.default_rng(0)
    jacobian = model.point_jacobian(0, x, robot.sample(rng, POSES))
    values, axes = np.linalg.eigh(covariance)
    root = axes * np.sqrt(np.maximum(values, 0.0))
    moved = (jacobian @ root) @ rng.normal(size=(len(x), DRAWS))
    return float(np.linalg.norm(moved, axis=1).mean())


def _trend(findings: Findings, joint: int, name: str) -> Trend:
    """The part of the residuals that goes with the angle, its sine and its cosine."""
    fit, model = findings.fit, findings.model
    explained = freedom = 0.0
    count = 0
    for k, rows in enumerate(model.sets):
        good = fit.weights[k] > 0.0
        q = rows.q[good, joint]
        if len(q) < 2 or not np.ptp(q):
            continue
        waves = np.column_stack([q, np.cos(q), np.sin(q)])
        left, values, _ = np.linalg.svd(waves - waves.mean(axis=0), full_matrices=False)
        left = left[:, values > 1e-6 * values[0]]
        scaled = fit.after[k][good] / rows.sigma[good]
        scaled = scaled / np.sqrt(np.maximum(1.0 - fit.leverages[k][good], 0.1))[:, None]
        explained += float(np.sum((left.T @ (scaled - scaled.mean(axis=0))) ** 2))
        freedom += left.shape[1] * scaled.shape[1]
        count += scaled.size
    if not freedom:
        return Trend(name, 0.0, 1.0)
    noise = max(findings.noise, 1.0) ** 2 if math.isfinite(findings.noise) else 1.0
    return Trend(name, math.sqrt(explained / count), float(chi2.sf(explained / noise, freedom)))


NAMED = 4  # parameters of a combination that a sentence names
EQUAL = 1e-6  # of a size: what differs by less is equal, and comes in the order of the arm


@dataclass(frozen=True, slots=True, eq=False)
class Identifiability(Sealed):
    """Which combinations of the numbers show in some measurements; arrays are read-only."""

    singular_values: Array
    """(p,) of the Jacobian, rows over their noise and columns times the prior: above 1, data know more than it."""
    rank: int
    """How many combinations show at all."""
    known: Array
    """(rank, p) those combinations, in parameters over their priors; orthonormal rows."""
    unidentified: tuple[str, ...]
    """A sentence for each of the others."""


def identify(jacobian: Array, prior: Array, parameters: Sequence[Parameter]) -> Identifiability:
    """Judge a Jacobian.

    Args:
        jacobian: (m, p) rows over their noise.
        prior: (p,) standard deviations.
        parameters: the p numbers.
    """
    count = len(prior)
    scaled = np.vstack([jacobian * prior, np.zeros((max(count - len(jacobian), 0), count))])
    _, values, rows = np.linalg.svd(scaled, full_matrices=False)
    # Rounding leaves 1e-15, and real ones have 1e-5.
    rank = int(np.sum(values > 1e-10 * values[0])) if values[0] > 0.0 else 0
    # What a user places has a wider prior than numbers are off, to be free.
    usual = prior / np.minimum(prior, 1e-2)
    sentences = tuple(_sentence(row * usual, parameters) for row in _sparse(rows[rank:]))
    return Identifiability(checks.read_only(values), rank, checks.read_only(rows[:rank]), sentences)


def _sparse(basis: Array) -> Array:
    """Rows that span the same and have few parts: each has a number that the others have not.

    Which numbers these are, the largest of what is left one after another, does not depend on the basis, which is
    another one on another machine.
    """
    left, own = basis.copy(), []
    for _ in basis:
        sizes = np.linalg.norm(left, axis=0)
        own.append(int(np.argmax(sizes > (1.0 - EQUAL) * sizes.max(initial=0.0))))
        unit = left[:, own[-1]] / sizes[own[-1]]
        left -= np.outer(unit, unit @ left)
    return np.asarray(np.linalg.solve(basis[:, own], basis))


def _sentence(row: Array, parameters: Sequence[Parameter]) -> str:
    """What one combination says in words."""
    size = np.abs(row)
    order = np.argsort(-np.round(size / (EQUAL * size.max())), kind="stable")
    parts = [int(k) for k in order if size[k] > 0.02 * size.max()]
    named = [parameters[k].words for k in parts[:NAMED]]
    if len(parts) > NAMED:
        named.append(f"{len(parts) - NAMED} more")
    if len(named) == 1:
        return f"{named[0]} does not show in the measurements"
    return f"{', '.join(named[:-1])} and {named[-1]} cannot be told apart"
