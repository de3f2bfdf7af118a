"""Plot of a trajectory: joints and speeds against their limits, and errors or distances (extra ``plot``)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jacokin.errors import needed
from jacokin.model import checks
from jacokin.motion import files
from jacokin.motion.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMATS = (".png", ".svg", ".pdf")
LEAST_ERROR = 1e-12  # [m, rad] bottom of the logarithmic error axis: below is rounding


def plot_path(result: Trajectory, path: str | Path) -> None:
    """Write the plot of a trajectory to a file; the ending says which kind: .png, .svg or .pdf.

    Raises:
        InvalidInputError: not a trajectory, another ending, or the file cannot be written.
        MissingExtraError: matplotlib is not installed.
    """
    checks.instance("result", result, Trajectory, "a Trajectory (see track_path and plan_motion)")
    files.by_ending(path, FORMATS)
    with needed("matplotlib", "plot"):
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    figure = Figure(figsize=(10.0, 9.0), layout="constrained")  # [inch]
    FigureCanvasAgg(figure)
    angles, speeds, errors = figure.subplots(3, 1, sharex=True)
    for joint, name in enumerate(result.joint_names):
        color = f"C{joint}"
        angles.plot(result.t, result.q[:, joint], color=color, label=name)
        for limit in (result.lower[joint], result.upper[joint]):
            if np.isfinite(limit):
                angles.axhline(limit, color=color, linestyle="--", linewidth=0.8)
        speeds.plot(result.t, result.v[:, joint] / result.velocity_limit[joint], color=color, label=name)
    unit = "rad, m" if result.sliding.any() else "rad"
    angles.set_ylabel(f"joint angle [{unit}]\n(dashed: its limits)")
    angles.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=len(result.joint_names), fontsize="small")
    for limit in (-1.0, 1.0):
        speeds.axhline(limit, color="black", linestyle="--", linewidth=0.8)
    speeds.set_ylabel("joint velocity\n[part of its limit]")
    if not result.follows_path:
        _draw_clearance(errors, result)
        title = "a motion to its goal" if result.success else "no motion to the goal"
    else:
        _draw_errors(errors, result)
        title = "on the path throughout" if result.success else "off the path in places"
    errors.set_xlabel("time [s]")
    figure.suptitle(f"{title}, {result.t[-1]:.2f} s")
    files.save(path, dict.fromkeys(FORMATS, lambda file: figure.savefig(file, dpi=110)))


def _draw_clearance(axes: Axes, motion: Trajectory) -> None:
    """The smallest distance of shapes over time, where it was measured."""
    axes.plot(motion.t, motion.clearance)
    axes.axhline(0.0, color="black", linestyle="--", linewidth=0.8)
    axes.set_ylabel("smallest distance [m]")


def _draw_errors(axes: Axes, result: Trajectory) -> None:
    """The errors over time, and where the arm is off its path."""
    axes.semilogy(result.t, np.maximum(result.position_error, LEAST_ERROR), label="position [m]")
    axes.semilogy(result.t, np.maximum(result.orientation_error, LEAST_ERROR), label="orientation [rad]")
    off = result.off_path
    if off.any():
        axes.fill_between(
            result.t,
            0.0,
            1.0,
            where=off,
            transform=axes.get_xaxis_transform(),
            color="C3",
            alpha=0.2,
            label="off path",
        )
    axes.set_ylabel("error")
    axes.legend(loc="upper right", fontsize="small")
