"""`jacokin crosscheck`: do two descriptions, or Pinocchio and MuJoCo, agree?"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from jacokin import model
from jacokin.cli import display, options
from jacokin.cli.command import Argument, Command
from jacokin.cli.options import RobotOptions
from jacokin.cli.process import NOT_SOLVED
from jacokin.errors import InvalidInputError


def read_pairs(context: click.Context, option: click.Parameter, words: Sequence[str]) -> dict[str, str] | None:
    """Read A=B, A=B, ... as a mapping.

    Raises:
        InvalidInputError: a word is not A=B.
    """
    pairs = {}
    for word in words:
        name, _, other = word.partition("=")
        if not (name and other):
            raise InvalidInputError(f"{option.opts[0]} must be A=B, got {word!r}")
        pairs[name] = other
    return pairs or None


@click.command(cls=Command)
@click.argument("first", cls=Argument, default=model.DEFAULT_ROBOT, metavar="[NAME|FILE]", text=options.NAME_OR_FILE)
@click.argument(
    "second", cls=Argument, required=False, metavar="[NAME|FILE]", text="What to compare it with; MuJoCo if not given."
)
@click.option("--samples", type=click.IntRange(min=1), default=1000, metavar="N", help="Random configurations.")
@click.option("--tolerance", type=float, metavar="T", help="Largest difference allowed in every quantity, in its unit.")
@click.option(
    "--joint",
    "joint_map",
    multiple=True,
    callback=read_pairs,
    metavar="A=B",
    help="Joint A is called B in the second. Repeatable.",
)
@click.option(
    "--frame",
    "frame_map",
    multiple=True,
    callback=read_pairs,
    metavar="A=B",
    help="Compare frame A with frame B. Repeatable.",
)
@click.option("--base", metavar="FRAME", help="Base frame of the first arm.")
@click.option("--tip", metavar="FRAME", help="End of the first arm.")
@click.option("--second-base", metavar="FRAME", help="Base of the second arm; --base if not given.")
@click.option("--second-tip", metavar="FRAME", help="End of the second arm.")
@options.package_dir
@click.option("--calibration", type=options.FILE, metavar="FILE.toml", help="How the first arm differs from its file.")
@options.random_seed
@options.json
def crosscheck(
    first: str,
    second: str | None,
    samples: int,
    tolerance: float | None,
    joint_map: dict[str, str] | None,
    frame_map: dict[str, str] | None,
    base: str | None,
    tip: str | None,
    second_base: str | None,
    second_tip: str | None,
    package_dirs: Sequence[Path],
    calibration: Path | None,
    random_seed: int | None,
    json: bool,
) -> None:
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
    import numpy as np

    from jacokin.model import comparison

    if tolerance is not None and not 0.0 <= tolerance < np.inf:
        raise InvalidInputError(f"--tolerance must be a number >= 0, got {tolerance}")
    limits = comparison.TOLERANCES if tolerance is None else dict.fromkeys(comparison.QUANTITIES, tolerance)
    report = model.crosscheck(
        RobotOptions(first, base, tip, package_dirs, calibration=calibration).load(),
        None if second is None else RobotOptions(second, second_base or base, second_tip, package_dirs).load(),
        samples=samples,
        rng=None if random_seed is None else np.random.default_rng(random_seed),
        joint_map=joint_map,
        frame_map=frame_map,
    )
    if json:
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
