"""`draw_placement`: a place for the base as a picture, from above and from the side."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from jacokin import files
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, MissingExtraError
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene
from jacokin.reachability.outlines import outline_arm, outline_scene
from jacokin.reachability.placement import BasePlacement

ENDINGS = (".png", ".svg", ".pdf")
AXIS = 0.15  # [m] length of the axes of the base


def draw_placement(path: Path, place: BasePlacement, targets: Array, robot: Robot, scene: Scene | None = None) -> None:
    """Draw a place.

    Args:
        path: where to, which also tells the format.
        place: what `place_base` has found.
        targets: (n, 4, 4) poses in the world.
        robot: the arm, drawn at home.
        scene: obstacles in the world.

    Raises:
        MissingExtraError: matplotlib is not installed.
        InvalidInputError: another ending, or the file cannot be written.
    """
    if path.suffix not in ENDINGS:
        raise InvalidInputError(f"{path}: pictures of places are written as {', '.join(ENDINGS)}, told by the ending")
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("matplotlib", "plot") from error
    base, turn = place.pose.translation, place.pose.rotation
    arm = outline_arm(robot, robot.home) @ turn.T + base
    obstacles = [] if scene is None else outline_scene(scene)
    at = targets[:, :3, 3]
    missed = ~place.success & ~place.touching
    figure = Figure(figsize=(11.0, 5.4), layout="constrained")
    for column, (first, second, title) in enumerate(((0, 1, "from above"), (0, 2, "from the side"))):
        axes = figure.add_subplot(1, 2, column + 1)
        for line in obstacles:
            axes.plot(line[:, first], line[:, second], color="0.6", linewidth=0.8)
        axes.plot(arm[:, first], arm[:, second], color="0.2", linewidth=2.5, label="arm at home")
        for axis, colour in ((first, "tab:red"), (second, "tab:green" if second == 1 else "tab:blue")):
            end = base + AXIS * turn[:, axis]
            axes.plot([base[first], end[first]], [base[second], end[second]], color=colour, linewidth=1.5)
        for rows, colour, mark, name in (
            (place.success, "tab:green", "o", "reached"),
            (place.touching, "tab:orange", "s", "in contact only"),
            (missed, "tab:red", "x", "not reached"),
        ):
            if np.any(rows):
                label = f"{name}: {int(np.sum(rows))}"
                axes.scatter(at[rows, first], at[rows, second], s=18.0, c=colour, marker=mark, label=label, zorder=3)
        axes.set(xlabel=f"{'xyz'[first]} [m]", ylabel=f"{'xyz'[second]} [m]", title=title)
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(visible=True, linewidth=0.3)
    axes.legend(loc="best")
    figure.suptitle(f"{robot.label}: {place.reached} of {len(targets)} targets from here")
    with files.replacing(path) as written:
        figure.savefig(written, format=path.suffix[1:], dpi=120)
