"""`write` writes a set of solutions as a picture: joints over the parameter of curves, or the joints of each point."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from jacokin import files
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, needed
from jacokin.ik.solutions.solution_set import Interval
from jacokin.model import checks
from jacokin.model.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ENDINGS = (".png", ".svg", ".pdf")
STEP = 0.02  # [rad] between configurations along a curve
ROWS, WIDE, HIGH = 2, 2.5, 2.1  # of small multiples, and how large each is [inch]
BEYOND = "0.85"  # colour of what is outside the limits


def write(path: str | Path, draw: Callable[[], Figure]) -> None:
    """Write a picture; see `SolutionSet.plot`.

    Args:
        path: where to, which also tells the format.
        draw: makes the picture.
    """
    out = Path(checks.text("path", str(checks.path("path", path))))
    if out.suffix not in ENDINGS:
        raise InvalidInputError(f"{out}: pictures of sets are written as {', '.join(ENDINGS)}, told by the ending")
    figure = draw()
    with files.replacing(out) as written:
        figure.savefig(written, format=out.suffix[1:], dpi=120)


def draw_curves(runs: Sequence[tuple[Interval, Array, Array]], parameter: str, robot: Robot, title: str) -> Figure:
    """Each other joint over the parameter, one colour for a branch, folds as rings, beyond the limits shaded.

    Args:
        runs: intervals, and along each the parameter (n,) and configurations (n, dof) [rad].
        parameter: its name.
        robot: the arm.
        title: above the picture.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    with needed("matplotlib", "plot"):
        from matplotlib.figure import Figure
    joints = [joint for joint, name in enumerate(robot.joint_names) if name != parameter]
    columns = math.ceil(len(joints) / ROWS)
    figure = Figure(figsize=(WIDE * columns + 0.3, HIGH * ROWS + 0.4), layout="constrained")
    branches = sorted({interval.branch for interval, _, _ in runs})
    colours = {branch: f"C{place % 10}" for place, branch in enumerate(branches)}
    for place, joint in enumerate(joints):
        axes = figure.add_subplot(ROWS, columns, place + 1)
        for interval, p, q in runs:
            colour, column = colours[interval.branch], np.degrees(q[:, joint])
            jumps = np.flatnonzero(np.abs(np.diff(column)) > 180.0) + 1  # to another equivalent of the angle
            x, y = np.insert(np.degrees(p), jumps, np.nan), np.insert(column, jumps, np.nan)
            axes.plot(x, y, color=colour, marker="" if interval.length else ".", linewidth=1.2)
            for end in (0, 1):
                if interval.ends[end].kind == "fold":
                    axes.plot(np.degrees(p[-end]), column[-end], "o", color=colour, fillstyle="none", label="fold")
        _shade(axes, robot, joint)
        name = robot.joint_names[joint]
        axes.set(title=name, xlabel=f"{parameter} [deg]", ylabel="" if place % columns else "[deg]")
    figure.suptitle(f"{robot.label}: {title}")
    return figure


def draw_points(q: Array, within: NDArray[np.bool_], robot: Robot, title: str) -> Figure:
    """The joints of each point, one colour for a point, hollow where it is outside the limits, those shaded.

    Args:
        q: (k, dof) [rad or m].
        within: (k,) whether within the limits.
        robot: the arm.
        title: above the picture.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    with needed("matplotlib", "plot"):
        from matplotlib.figure import Figure
    figure = Figure(figsize=(1.2 * robot.dof + 2.0, 4.4), layout="constrained")
    for joint, name in enumerate(robot.joint_names):
        axes = figure.add_subplot(1, robot.dof, joint + 1)
        scale = 1.0 if robot.sliding[joint] else math.degrees(1.0)
        for index, (row, inside) in enumerate(zip(q, within.tolist(), strict=True)):
            style = "full" if inside else "none"
            axes.plot([index + 1], [scale * row[joint]], "o", color=f"C{index % 10}", fillstyle=style)
        _shade(axes, robot, joint)
        axes.set(title=name, xlabel="point", ylabel=("[m]" if robot.sliding[joint] else "[deg]") if joint == 0 else "")
        axes.locator_params(axis="x", integer=True, nbins=9, min_n_ticks=1)
        axes.set_xlim(0.5, max(len(q), 1) + 0.5)
    figure.suptitle(f"{robot.label}: {title}")
    return figure


def _shade(axes: Axes, robot: Robot, joint: int) -> None:
    """Shade what is beyond the limits of a joint, as far as there is room."""
    scale = 1.0 if robot.sliding[joint] else math.degrees(1.0)
    lower, upper = scale * float(robot.lower[joint]), scale * float(robot.upper[joint])
    low, high = axes.get_ylim()
    known = [end for end in (lower, upper) if math.isfinite(end)]
    low, high = min([low, *known]), max([high, *known])
    room = 0.06 * (high - low)  # of the height, above and below what is drawn
    low, high = low - room, high + room
    if math.isfinite(lower):
        axes.axhspan(low, lower, color=BEYOND, linewidth=0.0)
    if math.isfinite(upper):
        axes.axhspan(upper, high, color=BEYOND, linewidth=0.0)
    axes.set_ylim(low, high)
