"""`Calibration`: the arm that was found, to load, to write and to report on a page with pictures.

And `compare`: whether two calibrations found the same arm.
"""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from scipy.stats import chi2

from jacokin import files
from jacokin.arrays import Array
from jacokin.calibration.arm_model import ArmKinematics
from jacokin.calibration.findings import Findings, pose_in_words
from jacokin.errors import InvalidInputError, needed
from jacokin.model import checks
from jacokin.model.loading import load_robot
from jacokin.model.robot import Robot
from jacokin.model.written_descriptions import write_mjcf, write_urdf

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Calibration(Findings):
    """What `calibrate` returns: what was found, as an arm and as files. Immutable."""

    def __repr__(self) -> str:
        """The arm, and how many parameters and measurements there are; `print` says more."""
        rows = sum(map(len, self.fit.after))
        return f"Calibration({self.described.name!r}, {len(self.parameters)} parameters, {rows} measurements)"

    @cached_property
    def robot(self) -> Robot:
        """The calibrated arm, loaded as the described one was.

        Raises:
            ModelError: transmissions have a scale or joints give under load, which no chain of joints can hold.
        """
        source = self.described.source
        return load_robot(
            source.bundled or source.path,
            base=source.base,
            tip=source.tip,
            finger_angle=self.described.finger_angle,
            limits={joint: (low, high) for joint, low, high in source.limits} or None,
            package_dirs=source.package_dirs,
            calibration=self.measured_arm,
            velocity_limit=source.velocity_limit or None,
            decompose=source.decompose,
            locked=dict(source.locked),
            home=source.home or None,
            srdf=None if source.disabled is None else source.disabled.path,
        )

    def forward_kinematics(self, q: ArrayLike, frame: str | None = None) -> pin.SE3:
        """Pose of a frame in the base at reported angles (dof,) [rad]; transmissions and sag included.

        Raises:
            InvalidInputError: `q` malformed.
            UnknownNameError: no such frame.
        """
        rows = self.described.configuration(q)[np.newaxis]
        chain = ArmKinematics(self.described, frame, sags=bool(self.measured_arm.drives))
        at = chain.at(rows, self.model.joints(self.fit.x))
        return pin.SE3(at.rotation[0], at.position[0])

    def save(self, path: str | Path) -> None:
        """Write the TOML file that `load_robot(calibration=...)` reads.

        Raises:
            InvalidInputError: it cannot be written.
        """
        self.measured_arm.save(path)

    def write_urdf(self, path: str | Path) -> None:
        """Write the calibrated arm as URDF. Errors as of `jacokin.model.write_urdf` and of `robot`."""
        write_urdf(self.robot, path)

    def write_mjcf(self, path: str | Path) -> None:
        """Write the calibrated arm as MJCF. Errors as of `jacokin.model.write_mjcf` and of `robot`."""
        write_mjcf(self.robot, path)

    def report(self, path: str | Path) -> None:
        """Write a page (HTML, one file, with pictures) of what was found and how sure it is.

        Raises:
            InvalidInputError: it cannot be written.
            MissingExtraError: matplotlib is not installed.
        """
        write_report(self, checks.path("path", path))


BEFORE, AFTER = "#b0b0b0", "#1f5fa8"
STYLE = (
    "body{font:16px/1.5 sans-serif;max-width:60em;margin:2em auto;padding:0 1em}"
    "td,th{padding:.1em .8em;text-align:right;font-variant-numeric:tabular-nums}"
    "td:first-child,th:first-child{text-align:left}img{max-width:100%}"
)
SHOWN = {"m": (1e3, "mm"), "rad": (1e3, "mrad"), "1": (1.0, ""), "rad/(N m)": (1e3, "mrad/(N m)")}


def write_report(findings: Findings, path: Path) -> None:
    """Write the page. Errors as `Calibration.report`."""
    pictures = [_picture(figure) for figure in (_rows(findings), _by_joint(findings), _by_place(findings))]
    arm = findings.measured_arm
    page = "\n".join(
        [
            "<!DOCTYPE html>",
            f"<html lang='en'><head><meta charset='utf-8'><title>Calibration of {_text(arm.robot)}</title>",
            f"<style>{STYLE}</style></head><body>",
            f"<h1>Calibration of {_text(arm.robot)}</h1>",
            _table(("", ""), _facts(findings)),
            "<h2>To look at</h2>",
            _list(findings.warnings()[: len(findings.warnings()) - len(findings.unidentified)] or ("Nothing.",)),
            "<h2>Measured points, before (grey) and after (blue)</h2>",
            *pictures,
            "<h2>Numbers</h2>",
            _table(("number", "value", "± 95 %", "before ± 95 %", "unit"), _numbers(findings)),
            "<h2>What these measurements cannot tell apart</h2>",
            "<p>These combinations keep the description's values; no prediction depends on them.</p>",
            _list(findings.unidentified or ("Nothing: every number shows.",)),
            "</body></html>",
        ]
    )
    with files.replacing(path) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _facts(findings: Findings) -> list[tuple[str, str]]:
    used = findings.used > 0.0
    before, after = findings.residuals_before[used], findings.residuals[used]
    fit = findings.fit
    facts = [
        ("measurements used", f"{used.sum()} of {len(used)}"),
        ("before, root mean square", _mm(float(np.sqrt(np.mean(before**2))))),
        ("after, root mean square", _mm(float(np.sqrt(np.mean(after**2))))),
        (
            "left out and predicted by the others, mean",
            f"{_mm(findings.cross_validated)}, instrument's error included",
        ),
        ("expected at poses that were not measured, mean", _mm(findings.expected_error)),
        ("residuals over the stated sigma", f"{findings.noise:.2f} (p = {findings.p_value:.2g})"),
        ("combinations of numbers that show", f"{fit.identifiability.rank} of {len(findings.parameters)}"),
    ]
    return facts + [(name, pose_in_words(pose)) for name, pose in findings.placed.items()]


def _numbers(findings: Findings) -> Iterable[tuple[str, ...]]:
    for name, each in findings.parameters.items():
        factor, unit = SHOWN[each.unit]
        low, high = each.interval
        half = 0.5 * (high - low)
        numbers = [factor * each.value, factor * half, factor * half * each.prior / each.sigma]
        yield name, *(f"{number:.4g}" for number in numbers), unit


def _rows(findings: Findings) -> Figure:
    figure = _figure(2.8)
    axes = figure.add_subplot()
    numbers = np.arange(len(findings.residuals))
    axes.bar(numbers, 1e3 * findings.residuals_before, color=BEFORE)
    axes.bar(numbers, 1e3 * findings.residuals, color=AFTER)
    out = numbers[findings.used == 0.0]
    low, high = _shown_range(findings)
    axes.set(xlabel="measurement", ylabel="residual [mm]", yscale="log", ylim=(low, high))
    axes.plot(out, np.full(len(out), low), "x", color="red", label="not used", clip_on=False)
    if len(out):
        axes.legend()
    return figure


def _by_joint(findings: Findings) -> Figure:
    names = [name for name, _ in findings.measured_arm.joints]
    q = np.vstack([each.q for each in findings.model.sets])
    figure = _figure(1.6 * ((len(names) + 2) // 3) + 0.6)
    for k, name in enumerate(names):
        axes = figure.add_subplot((len(names) + 2) // 3, 3, k + 1)
        axes.plot(q[:, k], 1e3 * findings.residuals_before, ".", color=BEFORE)
        axes.plot(q[:, k], 1e3 * findings.residuals, ".", color=AFTER)
        axes.set(title=f"{name} (p = {findings.trends[k].p_value:.2f})", yscale="log")
        axes.set(xlabel="[rad]", ylabel="[mm]" if k % 3 == 0 else "", ylim=_shown_range(findings))
        axes.set_xlim(*_padded(q[findings.used > 0.0, k]))
    return figure


def _shown_range(findings: Findings) -> tuple[float, float]:
    """From the least to the largest residual of the rows that were used [mm]: one in millimetres hides no other."""
    used = findings.used > 0.0
    sizes = np.maximum(1e3 * np.concatenate([findings.residuals_before[used], findings.residuals[used]]), 1e-6)
    return 0.7 * float(sizes.min()), 1.4 * max(float(sizes.max()), 2e-6)


def _padded(values: Array) -> tuple[float, float]:
    """From the least to the largest of some angles (n,), and a little more [rad]."""
    room = 0.05 * max(float(np.ptp(values)), 0.1)
    return float(values.min()) - room, float(values.max()) + room


def _by_place(findings: Findings) -> Figure:
    model, fit = findings.model, findings.fit
    places = [model.kinematics(rows.q, rows.frame, fit.x).position for rows in model.sets]
    x, y, z = np.vstack(places).T
    figure = _figure(4.0)
    for k, (across, up, labels) in enumerate(
        ((x, y, ("x [m]", "y [m]")), (np.hypot(x, y), z, ("from joint 1 [m]", "z [m]")))
    ):
        axes = figure.add_subplot(1, 2, k + 1)
        good = findings.used > 0.0
        dots = axes.scatter(across[good], up[good], c=1e3 * findings.residuals[good], cmap="viridis", s=30)
        axes.set(xlabel=labels[0], ylabel=labels[1], aspect="equal")
        figure.colorbar(dots, ax=axes, label="residual after [mm]", shrink=0.8)
    return figure


def _figure(height: float) -> Figure:
    with needed("matplotlib", "plot"):
        from matplotlib.figure import Figure
    return Figure(figsize=(9.0, height), layout="constrained")


def _picture(figure: Figure) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return f"<img alt='' src='data:image/png;base64,{base64.b64encode(buffer.getvalue()).decode()}'>"


def _table(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = ["<table>"]
    if any(heading):
        lines.append("<tr>" + "".join(f"<th>{_text(cell)}</th>" for cell in heading) + "</tr>")
    lines += ["<tr>" + "".join(f"<td>{_text(cell)}</td>" for cell in row) + "</tr>" for row in rows]
    return "\n".join([*lines, "</table>"])


def _list(sentences: Iterable[str]) -> str:
    return "<ul>" + "".join(f"<li>{_text(sentence)}</li>" for sentence in sentences) + "</ul>"


def _text(value: str) -> str:
    return html.escape(value)


def _mm(length: float) -> str:
    return f"{1e3 * length:.3f} mm"


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
    # Below a billionth of the largest variance both know nothing.
    deviation = np.sqrt(np.maximum(spread.diagonal(), 1e-9 * spread.diagonal().max()))
    most = int(np.argmax(np.abs(apart) / deviation))
    distance, expected = _tips(first, second, spread * np.outer(prior, prior))
    largest = names[most], float(apart[most] / deviation[most])
    return Comparison(p_value >= 0.01, p_value, distance, expected, largest)


def _shown(calibration: Calibration, size: int) -> Array:
    """Combinations (k, size) of the joints' numbers that show, whatever base and tool are; orthonormal rows.

    Along the others an estimate keeps the description, and the rest of a difference there is of second order.
    """
    known = calibration.fit.identifiability.known
    hidden = np.linalg.svd(known)[2][len(known) :, :size]
    _, values, rows = np.linalg.svd(hidden)
    return np.asarray(rows[int(np.sum(values > 1e-6)) :])  # smaller parts are rounding


def _tips(first: Calibration, second: Calibration, spread: Array) -> tuple[float, float]:
    """Mean distance of the tips at random configurations, and what it is for differences of a covariance [m]."""
    rng = np.random.default_rng(0)
    robot = first.described
    sags = bool(first.measured_arm.drives or second.measured_arm.drives)
    chain, q = ArmKinematics(robot, None, sags=sags), robot.sample(rng, 400)
    ours, theirs = (chain.at(q, each.model.joints(each.fit.x)) for each in (first, second))
    free = first.model.free_columns
    jacobian = ours.linear.reshape(len(q), 3, -1)[:, :, free]
    values, axes = np.linalg.eigh(spread)
    draws = axes * np.sqrt(np.maximum(values, 0.0)) @ rng.normal(size=(len(values), 100))
    expected = float(np.linalg.norm(jacobian @ draws, axis=1).mean())
    return float(np.linalg.norm(ours.position - theirs.position, axis=1).mean()), expected
