"""`jacokin crosscheck`: do two descriptions, or Pinocchio and MuJoCo, agree?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import click

from jacokin import model
from jacokin.cli import display, options
from jacokin.cli.command import command, option
from jacokin.cli.groups import RobotOptions, load_generator
from jacokin.cli.process import NOT_SOLVED
from jacokin.errors import InvalidInputError


def read_pairs(context: click.Context, option: click.Parameter, words: Sequence[str]) -> dict[str, str] | None:
    """Read A=B, A=B, ... as a mapping.

    Raises:
        InvalidInputError: a word is not A=B, or A is given twice.
    """
    pairs = {}
    for word in words:
        name, _, other = word.partition("=")
        if not (name and other):
            raise InvalidInputError(f"{option.opts[0]} must be A=B, got {word!r}")
        if name in pairs:
            raise InvalidInputError(f"{option.opts[0]} is given twice for {name!r}")
        pairs[name] = other
    return pairs or None


@dataclass(frozen=True, slots=True)
class CrossCheckOptions:
    """What is compared with what."""

    first: str = option(default=model.DEFAULT_ROBOT, metavar="[NAME|FILE]", text=options.NAME_OR_FILE)
    second: str | None = option(
        required=False, metavar="[NAME|FILE]", text="What to compare it with; MuJoCo if not given."
    )
    samples: int = option(
        "--samples", type=click.IntRange(min=1), default=1000, metavar="N", help="Random configurations."
    )
    tolerance: float | None = option(
        "--tolerance", metavar="T", help="Largest difference allowed in every quantity, in its unit."
    )
    joint_map: dict[str, str] | None = option(
        "--joint",
        multiple=True,
        callback=read_pairs,
        metavar="A=B",
        help="Joint A is called B in the second. Repeatable.",
    )
    frame_map: dict[str, str] | None = option(
        "--frame", multiple=True, callback=read_pairs, metavar="A=B", help="Compare frame A with frame B. Repeatable."
    )
    base: str | None = option("--base", metavar="FRAME", help="Base frame of the first arm.")
    tip: str | None = option("--tip", metavar="FRAME", help="End of the first arm.")
    second_base: str | None = option(
        "--second-base", metavar="FRAME", help="Base of the second arm; --base if not given."
    )
    second_tip: str | None = option("--second-tip", metavar="FRAME", help="End of the second arm.")
    package_dirs: Sequence[Path] = options.package_dirs()
    calibration: Path | None = option(
        "--calibration", metavar="FILE.toml", help="How the first arm differs from its file."
    )
    random_seed: int | None = options.random_seed()
    json: bool = options.json()


@command()
def crosscheck(given: CrossCheckOptions) -> None:
    """Compare two descriptions, or Pinocchio and MuJoCo.

    Compares poses, Jacobians, mass matrices and gravity torques over random configurations.
    Without a tolerance: 1e-12 for kinematics, 1e-11 for dynamics.
    Exit code: 0 within the tolerance, 1 past it, 2 wrong input.

    Examples:
      jacokin crosscheck                                     the j2n6s300 in Pinocchio and in MuJoCo
      jacokin crosscheck urdf/j2n6s300.urdf urdf/j2n6s300.xml --base link_base
      jacokin crosscheck j2n6s300 my_jaco.urdf --joint joint_1=j1 --joint joint_2=j2 --frame end_effector=tool0
      jacokin crosscheck j2n6s300 j2n6s300 --calibration my_arm.toml   how far the arm is from its datasheet
    """
    from jacokin.model import comparison

    if given.tolerance is not None and not 0.0 <= given.tolerance < math.inf:
        raise InvalidInputError(f"--tolerance must be a number >= 0, got {given.tolerance}")
    for flag, frame in (("--second-base", given.second_base), ("--second-tip", given.second_tip)):
        if frame is not None and given.second is None:
            raise InvalidInputError(f"{flag} is for a second description: give it, too")
    limits = comparison.TOLERANCES if given.tolerance is None else dict.fromkeys(comparison.QUANTITIES, given.tolerance)
    report = model.crosscheck(
        RobotOptions(given.first, given.base, given.tip, given.package_dirs, calibration=given.calibration).load(),
        None
        if given.second is None
        else RobotOptions(given.second, given.second_base or given.base, given.second_tip, given.package_dirs).load(),
        samples=given.samples,
        rng=load_generator(given.random_seed),
        joint_map=given.joint_map,
        frame_map=given.frame_map,
    )
    if given.json:
        display.print_json(_document(report, limits))
    else:
        _show(report, limits)
    if not report.within(limits):
        raise SystemExit(NOT_SOLVED)


def _document(report: model.CrossCheckReport, limits: dict[str, float]) -> dict[str, object]:
    return {
        "first": report.first,
        "second": report.second,
        "samples": report.samples,
        "within_tolerance": report.within(limits),
        "deviations": [
            {
                "quantity": row.quantity,
                "frame": row.frame or None,
                "value": row.value,
                "unit": row.unit,
                "tolerance": limits[row.quantity],
                "q": row.q,
            }
            for row in report.deviations
        ],
        "notes": report.notes,
    }


def _show(report: model.CrossCheckReport, limits: dict[str, float]) -> None:
    kinematic = [
        name for name in ("position", "rotation", "jacobian") if any(row.quantity == name for row in report.deviations)
    ]
    frames = list(dict.fromkeys(row.frame for row in report.deviations if row.frame))
    value = {(row.quantity, row.frame): row.value for row in report.deviations}
    rows = [(frame, *(_verdict(value[name, frame], limits[name]) for name in kinematic)) for frame in frames]
    columns = ("frame", *(f"{name} [{report.worst(name).unit}]" for name in kinematic))
    title = f"{report.first} against {report.second}: largest difference in {report.samples} random configurations"
    display.show_table(title, columns, rows)
    display.show_facts(
        (row.quantity.replace("_", " "), f"{_verdict(row.value, limits[row.quantity])} {row.unit}")
        for row in report.deviations
        if not row.frame
    )
    allowed = ", ".join(f"{name.replace('_', ' ')} {limit:.0e}" for name, limit in limits.items())
    display.say(f"allowed: {allowed}")
    for note in report.notes:
        display.say(note)
    if not report.within(limits):
        row = max(report.deviations, key=lambda row: row.value / max(limits[row.quantity], 1e-300))
        place = f" of {row.frame}" if row.frame else ""
        angles = " ".join(f"{angle:.17g}" for angle in row.q)
        display.say(f"They differ most in {row.quantity.replace('_', ' ')}{place}, at q = {angles}")


def _verdict(value: float, limit: float) -> str:
    """A difference, marked when it is past the limit."""
    return f"{value:.1e}" if value <= limit else f"{value:.1e} DIFFERS"
