"""`plan_measurements`: which configurations to measure, and `predict_accuracy`: how good the result will be.

The information of a set of configurations does not depend on what will be measured there. D-optimal designs make the
determinant of its matrix, prior included, as large as they can: chosen one by one, and then exchanged as long as that
helps (Fedorov, Theory of Optimal Experiments, 1972).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from jacokin.arrays import Array
from jacokin.calibration.arm_model import ArmModel, Prior, check_sought, checked_groups
from jacokin.calibration.findings import mean_error
from jacokin.calibration.measurements import Measurements
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.model.contact import Contact, SelfContact
from jacokin.model.robot import Robot, checked_robot
from jacokin.model.scene import Scene

TRIES = 20  # configurations drawn for each candidate, where most touch something or are out of reach
MOST = 1e6  # times the measurements that would halve the error, when the prior of what never shows decides


@dataclass(frozen=True, slots=True)
class Accuracy:
    """How good a calibration will be."""

    before: float
    """Mean error of the described arm at random poses, as its prior has it [m]."""
    after: float
    """Mean error of the calibrated arm [m]: what no estimate beats (Cramer-Rao, with the prior)."""
    halved_by: int | None
    """How many measurements like these, these included, would halve `after`; None where none would."""

    def __str__(self) -> str:
        """One sentence."""
        again = "measuring these again would not halve it, others may"
        more = again if self.halved_by is None else f"{self.halved_by} would halve it"
        return f"{1e3 * self.before:.2f} mm before, {1e3 * self.after:.3f} mm after; {more}"


def plan_measurements(
    robot: Robot,
    n: int = 30,
    *,
    measured: str = "position",
    sigma: float | tuple[float, float] | None = None,
    frame: str | None = None,
    base: str | pin.SE3 | ArrayLike = "known",
    tool: str | pin.SE3 | ArrayLike = "known",
    parameters: str | Iterable[str] = "auto",
    prior: Prior | None = None,
    scene: Scene | None = None,
    within: tuple[ArrayLike, ArrayLike] | Callable[[pin.SE3], bool] | None = None,
    clearance: float = 0.02,
    rng: np.random.Generator | None = None,
) -> Array:
    """Configurations whose measurement says most about an arm.

    Args:
        robot: the arm as it is described.
        n: how many, at most 1000.
        measured: "position" or "pose" of the frame.
        sigma: error of the instrument [m], of poses ([m], [rad]); None for 0.3 mm and 1 mrad.
        frame: the frame that is measured; None for the robot's default frame.
        base: as in `Measurements`.
        tool: as in `Measurements`.
        parameters: as in `calibrate`.
        prior: as in `calibrate`.
        scene: obstacles around the arm.
        within: what the instrument sees: lower and upper corner of a box in the base [m], or a function of T_base_frame
            that returns whether it is seen. None for everything.
        clearance: the arm stays this far from itself and from obstacles [m], as it is not where it is described; as
            that of `IKSolver`, links that are nearer in nearly all configurations keep less.
        rng: chooses the candidates; None for a fixed seed.

    Returns:
        (n, dof) [rad], the most telling first: the first ones of them are a good choice, too.

    Raises:
        InvalidInputError: malformed, or too few configurations are seen and clear of contact.
        ModelError: a joint slides, the robot has a scene and no shapes, or its shapes cannot be loaded.
        UnknownNameError: no such frame, kind or group of parameters.
    """
    checked_robot("robot", robot)
    count = checks.whole_number("n", n, 1, 1000)  # their time goes by the square of their number, a minute for these
    generator = np.random.default_rng(0) if rng is None else checks.generator("rng", rng)
    distance = checks.non_negative("clearance", clearance, "m")
    checks.optional(checks.instance, "scene", scene, Scene, "a Scene")
    seen = _seen(within)
    candidates = _candidates(robot, count, frame, scene, distance, seen, generator)
    instrument = _Instrument(measured, sigma, frame, base, tool)
    rows = _information(robot, candidates, instrument, parameters, prior)[1]
    return candidates[_choose(rows, count)]


def predict_accuracy(
    robot: Robot,
    q: ArrayLike,
    *,
    measured: str = "position",
    sigma: float | tuple[float, float] | None = None,
    frame: str | None = None,
    base: str | pin.SE3 | ArrayLike = "known",
    tool: str | pin.SE3 | ArrayLike = "known",
    parameters: str | Iterable[str] = "auto",
    prior: Prior | None = None,
) -> Accuracy:
    """How good a calibration will be, before anything is measured.

    Args:
        robot: the arm as it is described.
        q: (n, dof) configurations to measure [rad].
        measured: as in `plan_measurements`, as are all that follow.
        sigma: see there.
        frame: see there.
        base: see there.
        tool: see there.
        parameters: see there.
        prior: see there.

    Raises:
        InvalidInputError: malformed.
        UnknownNameError: no such frame, kind or group of parameters.
    """
    checked_robot("robot", robot)
    at = checks.matrix("q", q, robot.dof, "rad")
    model, rows = _information(robot, at, _Instrument(measured, sigma, frame, base, tool), parameters, prior)
    flat = rows.reshape(-1, rows.shape[2])
    information = flat.T @ flat
    scale, zero = np.outer(model.prior, model.prior), np.zeros(len(model.prior))

    def error(times: float) -> float:
        return mean_error(model, zero, np.linalg.inv(times * information + np.eye(len(zero))) * scale, robot)

    after = error(1.0)
    halved_by = None
    if error(MOST) < 0.5 * after:
        times = brentq(lambda power: error(np.exp(power)) - 0.5 * after, 0.0, np.log(MOST), rtol=1e-3)
        halved_by = int(np.ceil(len(at) * np.exp(times)))
    return Accuracy(error(0.0), after, halved_by)


def _seen(within: tuple[ArrayLike, ArrayLike] | Callable[[pin.SE3], bool] | None) -> Callable[[pin.SE3], bool]:
    """Whether an instrument sees a pose.

    Raises:
        InvalidInputError: neither a box nor a function.
    """
    if within is None:
        return lambda pose: True
    if callable(within):
        return within
    corners = checks.matrix("within", np.asarray(within), 3, "m")
    if corners.shape != (2, 3) or not (corners[0] < corners[1]).all():
        raise InvalidInputError("within must be the lower and the upper corner of a box [m], or a function of a pose")
    return lambda pose: bool((corners[0] <= pose.translation).all() and (pose.translation <= corners[1]).all())


def _candidates(
    robot: Robot,
    count: int,
    frame: str | None,
    scene: Scene | None,
    clearance: float,
    seen: Callable[[pin.SE3], bool],
    rng: np.random.Generator,
) -> Array:
    """Configurations that are seen and clear of contact."""
    contact: Contact | None = SelfContact.of(robot) if scene is None else scene.contact(robot)
    if contact is not None:
        contact = contact.with_clearance(clearance)
    frame_id = robot.frame_id(frame)
    wanted = max(1000, 4 * count)
    found: list[Array] = []
    for q in robot.sample(rng, TRIES * wanted):
        if (contact is None or not contact.touches(q)) and seen(robot.placement(q, frame_id).copy()):
            found.append(q)
            if len(found) == wanted:
                break
    if len(found) < count:
        raise InvalidInputError(
            f"only {len(found)} of {TRIES * wanted} random configurations are seen and clear of contact, and {count} "
            "are wanted: give a larger box of what is seen, a smaller clearance, or less around the arm"
        )
    return np.array(found)


class _Instrument(NamedTuple):
    """What measures the arm; the fields are arguments of `plan_measurements`."""

    measured: str
    sigma: float | tuple[float, float] | None
    frame: str | None
    base: str | pin.SE3 | ArrayLike
    tool: str | pin.SE3 | ArrayLike

    def measure(self, robot: Robot, q: Array) -> Measurements:
        """What it would measure of the described arm at configurations (n, dof) [rad], without noise.

        Raises:
            InvalidInputError: malformed.
            UnknownNameError: it measures neither positions nor poses, or there is no such frame.
        """
        kind = checks.choice("measured", self.measured, ("position", "pose"))
        poses = [robot.placement(row, robot.frame_id(self.frame)).homogeneous for row in q]
        sigma = ((3e-4, 1e-3) if kind == "pose" else 3e-4) if self.sigma is None else self.sigma  # [m], [rad]
        seen: dict[str, Any] = {"poses": poses} if kind == "pose" else {"positions": np.array(poses)[:, :3, 3]}
        return Measurements(q, **seen, sigma=sigma, frame=self.frame, base=self.base, tool=self.tool)


def _information(
    robot: Robot, q: Array, instrument: _Instrument, parameters: str | Iterable[str], prior: Prior | None
) -> tuple[ArmModel, Array]:
    """The model, and derivatives (n, k, p) of what would be measured, over its noise, by numbers over their priors."""
    sets, (groups, known) = [instrument.measure(robot, q)], checked_groups(parameters, prior)
    check_sought(groups, sets)
    model = ArmModel(robot, sets, groups, known)
    return model, model.whitened(0, np.zeros(len(model.prior)))[1] * model.prior


def _choose(rows: Array, count: int) -> list[int]:
    """Indices of the configurations with the largest determinant, the most telling first."""
    chosen, covariance = _greedy(rows, range(len(rows)), count)
    for _ in range(5):  # most designs settle in three rounds
        changed = False
        for k, old in enumerate(list(chosen)):
            without = _without(covariance, rows[old])
            best, gain = _best(rows, without, chosen[:k] + chosen[k + 1 :])
            if gain > _gain(rows[[old]], without)[0] + 1e-9:
                chosen[k], changed = best, True
                covariance = _with(without, rows[best])
        if not changed:
            break
    return _greedy(rows, chosen, count)[0]


def _greedy(rows: Array, among: Iterable[int], count: int) -> tuple[list[int], Array]:
    """The most telling of some configurations, one after another, and the covariance when all are measured."""
    left, ordered, covariance = list(among), [], np.eye(rows.shape[2])
    for _ in range(count):
        best = left.pop(int(np.argmax(_gain(rows[left], covariance))))
        ordered.append(best)
        covariance = _with(covariance, rows[best])
    return ordered, covariance


def _gain(rows: Array, covariance: Array) -> Array:
    """(n,) logarithms by which each row makes the determinant larger."""
    inner = rows @ covariance @ np.swapaxes(rows, 1, 2) + np.eye(rows.shape[1])
    return np.asarray(np.linalg.slogdet(inner)[1])


def _best(rows: Array, covariance: Array, taken: list[int]) -> tuple[int, float]:
    gains = _gain(rows, covariance)
    gains[taken] = -np.inf
    return int(np.argmax(gains)), float(gains.max())


def _with(covariance: Array, row: Array) -> Array:
    """The covariance after one more measurement."""
    across = covariance @ row.T
    return np.asarray(covariance - across @ np.linalg.solve(row @ across + np.eye(len(row)), across.T))


def _without(covariance: Array, row: Array) -> Array:
    """The covariance before a measurement that is part of it."""
    across = covariance @ row.T
    return np.asarray(covariance + across @ np.linalg.solve(np.eye(len(row)) - row @ across, across.T))
