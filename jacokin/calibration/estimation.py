"""`calibrate`: from measurements to the arm that made them. Read this file first.

The most probable numbers, given the measurements and a prior around the described arm: SciPy's `least_squares` on
residuals over their noise and numbers over their priors. Rows that are grossly off are found by weights that fall to
zero as the fit closes in (graduated non-convexity), and are left out and named; small ones are weighted after Huber.

A fit is refused where it says of itself that it is not one: most rows do not fit, nothing checks those that are left,
residuals are many times what the instrument's error makes them, or the arm is one that hardly exists. Where residuals
are only somewhat larger than stated, the error of the instrument is taken to be as large as they say.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import chi2

from jacokin.arrays import Array
from jacokin.calibration.arm_model import AUTO, ArmModel, Prior, check_sought, checked_groups
from jacokin.calibration.calibration import Calibration
from jacokin.calibration.findings import NOISY, Fit, Rejected, farthest, identify
from jacokin.calibration.measurements import CONTACTS, Measurements, checked_measurements
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.model.angles import wrap_to_pi
from jacokin.model.robot import Robot, checked_robot

ROUNDS = 30  # of weighting
FOLDS = 10  # of the cross-validation
DECIMETRES = 0.1  # [m] from where the described arm is: another unit or frame, not another arm
FEWEST = 3  # configurations: two leave one motion, which turns about one axis and says nothing along it
SAME_CONFIGURATION = 0.01  # [rad] of every joint: nearer, rows repeat each other
MISJUDGED = 3.0  # times that an instrument may be worse than stated: half of the rows being wrong starts beyond
FARTHEST = 10.0  # standard deviations of the prior: arms three times as far off as it says have up to seven or eight


def calibrate(
    robot: Robot,
    measurements: Measurements | Sequence[Measurements],
    parameters: str | Iterable[str] = "auto",
    *,
    prior: Prior | None = None,
    loss: str = "huber",
) -> Calibration:
    """Find the arm that made some measurements.

    Args:
        robot: the arm as it is described, with its masses if joints give under load.
        measurements: one set, or several of different kinds.
        parameters: "auto" for "geometry" and "offset"; or some of "geometry", "offset", "scale" (of the transmissions)
            and "compliance" (of the joints, under gravity). Unknown bases and tools are always found; with an empty
            list nothing else is, and the arm is taken as it is described (hand-eye calibration).
        prior: how far arms are from their description; None for 1 mm, 3 mrad, and 1 degree of offset.
        loss: "huber", which also leaves gross errors out; "none" for plain least squares of all finite rows.

    Returns:
        The calibration: the arm, what is sure about it and what is not.

    Raises:
        InvalidInputError: malformed, of another arm, in other units, or too few; or measurements of which half or more
            are wrong, or that only an arm far from its prior would explain. Says which, and by how much.
        ModelError: a joint slides, or the robot is a calibrated one.
        UnknownNameError: no such frame or group of parameters.
    """
    checked_robot("robot", robot)
    if robot.calibration is not None:
        raise InvalidInputError("robot is calibrated already: give the one of its description")
    sets = checked_measurements("measurements", measurements)
    groups, known = checked_groups(parameters, prior)
    checks.choice("loss", loss, ("huber", "none"))
    check_sought(groups, sets)
    model = ArmModel(robot, sets, groups, known)
    _check_units(model)
    finite = [each.finite for each in sets]
    if not any(mask.any() for mask in finite):
        raise InvalidInputError(f"{', '.join(model.sets_named)}: has no row of finite numbers")
    _check_configurations(sets)
    _check_places(model, finite)

    weights = [mask.astype(np.float64) for mask in finite]
    fit = Estimator(model)
    x = np.zeros(len(model.parameters))
    if loss == "none":
        x = fit.solve(x, weights)
    else:
        x, weights = fit.robust(x, weights, finite)
        _check_majority(model, weights, finite)
        _check_checked(fit, x, weights, finite)
    weights = _as_noisy_as_they_are(fit, x, weights, groups, known)
    _check_prior(model, x)
    x = fit.solve(x, weights)
    return Calibration(robot, model, _finish(fit, x, weights, finite))


class Estimator:
    """Least squares of a model, with weights of rows."""

    def __init__(self, model: ArmModel) -> None:
        """Keep the model."""
        self.model = model

    def solve(self, x: Array, weights: Sequence[Array]) -> Array:
        """The most probable numbers (p,) for weights (n,) of the rows of each set."""
        model = self.model
        count, roots = len(x), [np.sqrt(each) for each in weights]

        @lru_cache(maxsize=1)  # for residuals and slopes are asked for one after the other
        def whitened(u: bytes) -> list[tuple[Array, Array]]:
            return [model.whitened(k, np.frombuffer(u) * model.prior) for k in range(len(roots))]

        def missed(u: Array) -> Array:
            parts = [part * root[:, None] for (part, _), root in zip(whitened(u.tobytes()), roots, strict=True)]
            return np.concatenate([*(part.ravel() for part in parts), u])

        def slopes(u: Array) -> Array:
            parts = [part * root[:, None, None] for (_, part), root in zip(whitened(u.tobytes()), roots, strict=True)]
            return np.vstack([*(part.reshape(-1, count) * model.prior for part in parts), np.eye(count)])

        found = least_squares(missed, x / model.prior, jac=slopes, method="lm", max_nfev=50)  # 4 to 10 are usual
        return np.asarray(found.x * model.prior)

    def squares(self, x: Array) -> list[Array]:
        """Of each row, its residual over its noise, squared."""
        return [np.sum(self.model.whitened(k, x)[0] ** 2, axis=1) for k in range(len(self.model.sets))]

    def jacobian(self, x: Array, weights: Sequence[Array]) -> Array:
        """(m, p) of all rows over their noise, times the roots of their weights."""
        parts = [self.model.whitened(k, x)[1] * np.sqrt(each)[:, None, None] for k, each in enumerate(weights)]
        return np.concatenate([part.reshape(-1, len(x)) for part in parts])

    def covariance(self, jacobian: Array) -> Array:
        """(p, p) of the numbers given rows and prior."""
        prior = self.model.prior
        _, values, axes = np.linalg.svd(jacobian * prior, full_matrices=len(jacobian) < len(prior))
        shrunk = np.ones(len(prior))
        shrunk[: len(values)] = 1.0 / (1.0 + values**2)
        return np.asarray((axes.T * shrunk) @ axes * np.outer(prior, prior))

    def robust(self, x: Array, weights: list[Array], finite: Sequence[NDArray[np.bool_]]) -> tuple[Array, list[Array]]:
        """Numbers and weights, zero for gross errors."""
        sizes = [each.sigma.shape[1] for each in self.model.sets]
        gates = [float(chi2.isf(1e-6, size)) for size in sizes]  # that one good row in a million is beyond
        near = [
            mask & ~(self.model.distances(k, self.model.predict(k, x)[0]) > DECIMETRES) for k, mask in enumerate(finite)
        ]
        x = self.solve(x, [mask.astype(np.float64) for mask in near])
        width = max(float(each[mask].max(initial=0.0)) for mask, each in zip(near, self.squares(x), strict=True)) / min(
            gates
        )
        shrinking = max(1.6, width ** (1.0 / ROUNDS))
        while width > 1.0:  # weights of Geman and McClure, ever narrower
            squares = self.squares(x)
            weights = [
                mask * (width * gate / (width * gate + each)) ** 2
                for mask, gate, each in zip(near, gates, squares, strict=True)
            ]
            x = self.solve(x, weights)
            width /= shrinking
        good = list(finite)
        for _ in range(ROUNDS):
            squares, noise = self.squares(x), self._noise(x, weights, sizes)
            kept = [mask & (each <= noise * gate) for mask, gate, each in zip(finite, gates, squares, strict=True)]
            before = weights
            weights = [
                mask * np.minimum(1.0, np.sqrt(noise * chi2.isf(0.05, size) / np.maximum(each, 1e-300)))
                for mask, size, each in zip(kept, sizes, squares, strict=True)
            ]
            x = self.solve(x, weights)
            change = max(float(np.abs(a - b).max(initial=0.0)) for a, b in zip(weights, before, strict=True))
            if change < 1e-3 and all((a == b).all() for a, b in zip(kept, good, strict=True)):
                break
            good = kept
        return x, weights

    def _noise(self, x: Array, weights: Sequence[Array], sizes: Sequence[int]) -> float:
        """How many times larger the squares are than the stated noise makes them, by their median; at least 1."""
        ratios = []
        for each, leverage, weight, size in zip(
            self.squares(x), self.leverages(x, weights), weights, sizes, strict=True
        ):
            used = weight > 0.0
            ratios.append(each[used] / (np.maximum(1.0 - leverage[used], 0.1) * chi2.median(size)))
        found = np.concatenate(ratios)
        return max(1.0, float(np.median(found))) if len(found) else 1.0

    def leverages(self, x: Array, weights: Sequence[Array]) -> list[Array]:
        """(n,) of each set: the share of a row's own noise that the fit follows, in the mean of its numbers."""
        covariance = self.covariance(self.jacobian(x, weights))
        found = []
        for k, weight in enumerate(weights):
            rows = self.model.whitened(k, x)[1]
            found.append(weight * np.einsum("nip,pq,niq->n", rows, covariance, rows) / rows.shape[1])
        return found

    def cross_validate(self, x: Array, weights: Sequence[Array]) -> list[Array]:
        """Of each row of each set, how far it is from what the other rows predict [m]; NaN where it is not used."""
        model = self.model
        used = [(k, row) for k, each in enumerate(weights) for row in np.flatnonzero(each > 0.0)]
        found = [np.full(len(each), np.nan) for each in weights]
        for fold in range(min(FOLDS, len(used))):
            left_out, fewer = used[fold::FOLDS], [each.copy() for each in weights]
            for k, row in left_out:
                fewer[k][row] = 0.0
            without = self.solve(x, fewer)
            for k in {k for k, _ in left_out}:
                rows = [row for other, row in left_out if other == k]
                found[k][rows] = model.distances(k, model.predict(k, without)[0])[rows]
        return found


def _finish(fit: Estimator, x: Array, weights: list[Array], finite: Sequence[NDArray[np.bool_]]) -> Fit:
    """Everything that is known of a fit."""
    model = fit.model
    jacobian = fit.jacobian(x, weights)
    covariance = fit.covariance(jacobian)
    zero = np.zeros_like(x)
    before = [model.predict(k, zero)[0] for k in range(len(model.sets))]
    after = [model.predict(k, x)[0] for k in range(len(model.sets))]
    rejected = []
    for k, (mask, weight) in enumerate(zip(finite, weights, strict=True)):
        away = model.distances(k, after[k])
        for row in np.flatnonzero(weight == 0.0):
            reason = "is not finite, or beyond 1e6"
            if mask[row]:
                hint = ": another unit?" if away[row] > DECIMETRES else ""
                reason = f"is {1e3 * away[row]:.1f} mm from where the other rows have it{hint}"
            rejected.append(
                Rejected(k, int(row), f"{model.sets_named[k]}, {model.sets[k].name_row(int(row))},", reason)
            )
    used = [weight > 0.0 for weight in weights]
    squares = sum(float(each[mask].sum()) for each, mask in zip(fit.squares(x), used, strict=True))
    numbers = sum(int(mask.sum()) * model.sets[k].sigma.shape[1] for k, mask in enumerate(used))
    held = float(np.sum((jacobian @ covariance) * jacobian))
    return Fit(
        x=checks.read_only(x),
        covariance=checks.read_only(covariance),
        weights=tuple(checks.read_only(each) for each in weights),
        before=tuple(checks.read_only(each) for each in before),
        after=tuple(checks.read_only(each) for each in after),
        leverages=tuple(checks.read_only(each) for each in fit.leverages(x, weights)),
        left_out=tuple(checks.read_only(each) for each in fit.cross_validate(x, weights)),
        rejected=tuple(rejected),
        chi_square=squares,
        freedom=max(numbers - held, 0.0),
        identifiability=identify(jacobian, model.prior, model.parameters),
    )


def _check_majority(model: ArmModel, weights: Sequence[Array], finite: Sequence[NDArray[np.bool_]]) -> None:
    """Gross errors are told from others by the majority of a set's rows, as long as that is right.

    Raises:
        InvalidInputError: at most half of a set's rows fit.
    """
    for name, weight, mask in zip(model.sets_named, weights, finite, strict=True):
        fitting, given = int((weight[mask] > 0.0).sum()), int(mask.sum())
        if given and 2 * fitting <= given:
            raise InvalidInputError(
                f"{name}: {fitting} of {given} rows fit together, and more than half must: "
                "is what they say true of them all (frame, base, contact, units, sigma)?"
            )


def _check_prior(model: ArmModel, x: Array) -> None:
    """Refuse arms that hardly exist: a base, a tool or a frame that is not where it is said to be looks like one.

    Raises:
        InvalidInputError: a number is far from its prior.
    """
    far, name = farthest(model, x)
    if far > FARTHEST:
        raise InvalidInputError(
            f"{name} would be {far:.1f} standard deviations of the prior from the description, at most {FARTHEST:g}: "
            "is the base, the tool or the frame another one, or unknown? If the arm is that far off, give a wider prior"
        )


def _as_noisy_as_they_are(
    fit: Estimator, x: Array, weights: Sequence[Array], groups: Sequence[str], prior: Prior
) -> list[Array]:
    """Weights of sets whose residuals contradict their sigma, as small as that of the larger errors would make them.

    Raises:
        InvalidInputError: residuals are many times what sigma makes them.
    """
    model, found = fit.model, []
    squares, leverages = fit.squares(x), fit.leverages(x, weights)
    absent = _not_estimated(model, groups, prior)
    for k, (rows, weight, name) in enumerate(zip(model.sets, weights, model.sets_named, strict=True)):
        used = weight > 0.0
        size = rows.sigma.shape[1]
        freedom = size * float(np.sum(1.0 - leverages[k][used]))
        chi_square = float(squares[k][used].sum())
        usual = freedom + float(absent[k][used].sum())
        if not freedom > 0.0 or chi2.sf(chi_square, max(freedom, 1.0)) >= 0.05:  # sigma says more of the instrument
            found.append(weight)
            continue
        larger = math.sqrt(chi_square / freedom)
        # An instrument that is as much worse as it may be is refused once in a hundred times.
        if chi2.sf(chi_square / MISJUDGED**2 * freedom / usual, max(freedom, 1.0)) < 0.01:
            raise InvalidInputError(
                f"{name}: residuals are {larger:.1f} times what sigma says{_each_part(rows, fit, k, x, used)}: most "
                "rows are wrong, or of another arm, frame, base or unit, or the arm has what is not estimated; if the "
                "instrument is that much worse than stated, give the sigma that it has, at least "
                f"{larger / MISJUDGED:.1f} times as large"
            )
        found.append(weight / larger**2)
    return found


def _each_part(rows: Measurements, fit: Estimator, k: int, x: Array, used: NDArray[np.bool_]) -> str:
    """Of poses, how many times larger positions and orientations are than sigma says, in words."""
    if rows.kind != "poses":
        return ""
    missed = fit.model.whitened(k, x)[0][used]
    place, turn = (float(np.sqrt(np.mean(part**2))) for part in (missed[:, :3], missed[:, 3:]))
    return f" (positions {place:.1f}, orientations {turn:.1f} times)"


def _not_estimated(model: ArmModel, groups: Sequence[str], prior: Prior) -> list[Array]:
    """Of each row of each set, the mean square that numbers of the arm which are not estimated add to its residual."""
    missing = [group for group in AUTO if group not in groups]
    if not missing:
        return [np.zeros(len(each)) for each in model.sets]
    other = ArmModel(model.robot, model.sets, missing, prior)
    count, zero = int(other.free_columns.sum()), np.zeros(len(other.prior))
    return [
        np.sum((other.whitened(k, zero)[1][:, :, :count] * other.prior[:count]) ** 2, axis=(1, 2))
        for k in range(len(model.sets))
    ]


def _check_configurations(sets: Sequence[Measurements]) -> None:
    """Refuse measurements at too few configurations to say anything of an arm, however many they are.

    Raises:
        InvalidInputError: fewer than three that differ.
    """
    different: list[Array] = []
    for q in np.vstack([each.q[each.finite] for each in sets]):
        turned = [np.abs(wrap_to_pi(q - other)).max() for other in different]
        if not turned or min(turned) > SAME_CONFIGURATION:
            different.append(q)
            if len(different) == FEWEST:
                return
    raise InvalidInputError(
        f"measurements are at {len(different)} configuration{'s' if len(different) > 1 else ''} of the arm that differ "
        f"by more than {SAME_CONFIGURATION:g} rad, and at least {FEWEST} are needed: 20 to 30 are a good number"
    )


def _check_checked(fit: Estimator, x: Array, weights: Sequence[Array], finite: Sequence[NDArray[np.bool_]]) -> None:
    """Refuse rows left out where those that remain could not tell: what a fit can follow fits whatever it is.

    Rows that are decimetres from every arm of this kind need nobody to tell. Where the rest is larger than sigma says,
    it may be wrong as well, and must check itself better.

    Raises:
        InvalidInputError: more numbers were left out than the remaining ones can tell.
    """
    model, freedom, doubtful, numbers = fit.model, 0.0, 0, 0
    squares = sum(float(each[weight > 0.0].sum()) for each, weight in zip(fit.squares(x), weights, strict=True))
    for k, (weight, mask, leverage) in enumerate(zip(weights, finite, fit.leverages(x, weights), strict=True)):
        size = model.sets[k].sigma.shape[1]
        freedom += size * float(np.sum(1.0 - leverage[weight > 0.0]))
        near = ~(model.distances(k, model.predict(k, np.zeros_like(x))[0]) > DECIMETRES)
        out = int((mask & near & (weight == 0.0)).sum())
        doubtful, numbers = doubtful + out, numbers + size * out
    told = freedom if chi2.sf(squares, max(freedom, 1.0)) < NOISY else 2.0 * freedom
    if numbers > told:
        raise InvalidInputError(
            f"measurements: {doubtful} row{'s' if doubtful > 1 else ''} would be left out, and the others cannot tell "
            f"that these are wrong (they have {freedom:.1f} numbers more than the fit follows; {numbers} were left "
            "out): measure more, or look for what is wrong with them"
        )


def _check_units(model: ArmModel) -> None:
    for name, each in zip(model.sets_named, model.sets, strict=True):
        rows = each.q[each.finite]
        if len(rows) and np.median(np.abs(rows).max(axis=1)) > 15.0:
            raise InvalidInputError(
                f"{name}: joint angles must be in radians and look like degrees"
                f"{': read them with degrees=True' if each.source else ''}"
            )


def _check_places(model: ArmModel, finite: Sequence[NDArray[np.bool_]]) -> None:
    """Refuse sets most of whose rows are decimetres from the described arm.

    Raises:
        InvalidInputError: says by how much, and what it may be.
    """
    zero = np.zeros(len(model.parameters))
    for k, (rows, mask) in enumerate(zip(model.sets, finite, strict=True)):
        if rows.kind in CONTACTS or not mask.any():
            continue
        away = float(np.median(model.distances(k, model.predict(k, zero)[0])[mask]))
        if away > DECIMETRES:
            places = model.kinematics(rows.q[mask], rows.frame, zero).position
            ratio = away / float(np.median(np.linalg.norm(places, axis=1)))
            why = "another frame, base or unit?"
            if 300.0 < ratio < 3000.0:
                why = "they look like millimetres"
                if rows.source:
                    why += ": write them in metres, or read them with kinova=True where angles are in degrees, too"
            raise InvalidInputError(
                f"{model.sets_named[k]}: {rows.kind} are {away:.3g} m from where the described arm has them, "
                f"in the median: {why}"
            )
