"""`jacokin crosscheck`: do two descriptions, or Pinocchio and MuJoCo, agree?"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from jacokin.cli import display, options
from jacokin.cli.declared import Argument, Option
from jacokin.cli.exit_codes import NOT_SOLVED
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    from jacokin.model.comparison import CrossCheckReport


def crosscheck(
    first: Annotated[
        str, Argument(metavar="[NAME|FILE]", help="A bundled robot, or the path of a .urdf or .xml (MJCF).")
    ] = options.DEFAULT_ROBOT,
    second: Annotated[
        str | None, Argument(metavar="[NAME|FILE]", help="What to compare it with; MuJoCo if not given.")
    ] = None,
    samples: Annotated[int, Option("--samples", metavar="N", at_least=1, help="Random configurations.")] = 1000,
    tolerance: Annotated[
        float | None,
        Option("--tolerance", metavar="T", help="Largest difference allowed in every quantity, in its unit."),
    ] = None,
    joint: Annotated[
        list[str] | None, Option("--joint", metavar="A=B", help="Joint A is called B in the second. Repeatable.")
    ] = None,
    frame: Annotated[
        list[str] | None, Option("--frame", metavar="A=B", help="Compare frame A with frame B. Repeatable.")
    ] = None,
    base: Annotated[str | None, Option("--base", metavar="FRAME", help="Base frame of the first arm.")] = None,
    tip: Annotated[str | None, Option("--tip", metavar="FRAME", help="End of the first arm.")] = None,
    second_base: Annotated[
        str | None, Option("--second-base", metavar="FRAME", help="Base of the second arm; --base if not given.")
    ] = None,
    second_tip: Annotated[str | None, Option("--second-tip", metavar="FRAME", help="End of the second arm.")] = None,
    package_dir: options.PackageDirOption = None,
    random_seed: options.RandomSeedOption = None,
    json: options.JsonOption = False,
) -> None:
    """Compare two descriptions, or Pinocchio and MuJoCo.

    Compares poses, Jacobians, mass matrices and gravity torques over random configurations.
    Without a tolerance: 1e-12 for kinematics, 1e-11 for dynamics.
    Exit code: 0 within the tolerance, 1 past it, 2 wrong input.

    Examples:
      jacokin crosscheck                                     the j2n6s300 in Pinocchio and in MuJoCo
      jacokin crosscheck urdf/j2n6s300.urdf urdf/j2n6s300.xml --base link_base
      jacokin crosscheck j2n6s300 my_jaco.urdf --joint joint_1=j1 --joint joint_2=j2 --frame end_effector=tool0
    """
    import numpy as np

    from jacokin.model import comparison as checking

    if tolerance is not None and not 0.0 <= tolerance < np.inf:
        raise InvalidInputError(f"--tolerance must be a number >= 0, got {tolerance}")
    limits = checking.TOLERANCES if tolerance is None else dict.fromkeys(checking.QUANTITIES, tolerance)
    report = checking.crosscheck(
        options.load(first, base, tip, package_dir),
        None if second is None else options.load(second, second_base or base, second_tip, package_dir),
        samples=samples,
        rng=None if random_seed is None else np.random.default_rng(random_seed),
        joint_map=_pairs("--joint", joint),
        frame_map=_pairs("--frame", frame),
    )
    if json:
        display.print_json(_document(report, limits))
    else:
        _show(report, limits)
    if not report.within(limits):
        raise SystemExit(NOT_SOLVED)


def _pairs(option: str, words: list[str] | None) -> dict[str, str] | None:
    """A=B, A=B, ... as a mapping.

    Raises:
        InvalidInputError: a word is not A=B.
    """
    if not words:
        return None
    pairs = {}
    for word in words:
        name, sign, other = word.partition("=")
        if not (name and sign and other):
            raise InvalidInputError(f"{option} must be A=B, got {word!r}")
        pairs[name] = other
    return pairs


def _document(report: CrossCheckReport, limits: dict[str, float]) -> dict[str, object]:
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


def _show(report: CrossCheckReport, limits: dict[str, float]) -> None:
    kinematic = [
        name for name in ("position", "rotation", "jacobian") if any(row.quantity == name for row in report.deviations)
    ]
    frames = list(dict.fromkeys(row.frame for row in report.deviations if row.frame))
    value = {(row.quantity, row.frame): row.value for row in report.deviations}
    rows = [(frame, *(_verdict(value[name, frame], limits[name]) for name in kinematic)) for frame in frames]
    columns = ("frame", *(f"{name} [{_unit(report, name)}]" for name in kinematic))
    title = f"{report.first} against {report.second}: largest difference in {report.samples} random configurations"
    display.say(display.table(title, columns, rows))
    display.say(
        display.facts(
            (row.quantity.replace("_", " "), f"{_verdict(row.value, limits[row.quantity])} {row.unit}")
            for row in report.deviations
            if not row.frame
        )
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


def _unit(report: CrossCheckReport, quantity: str) -> str:
    return report.worst(quantity).unit
