"""The obstacles that `jacokin track` keeps clear of."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from jacokin.cli.arguments.units import numbers

if TYPE_CHECKING:
    from jacokin.ik.tracking.clearance import Clearance
    from jacokin.model.obstacles import Obstacle


def read(
    clearance: float | None,
    boxes: list[str] | None,
    spheres: list[str] | None,
    floor: float | None,
    scene: Path | None,
) -> Clearance | None:
    """What the options ask to keep apart; None if they ask for nothing.

    Args:
        clearance: distance kept between all shapes [m]; the tracker's own if None.
        boxes: centre and edge lengths of each [m].
        spheres: centre and radius of each [m].
        floor: height of the floor [m].
        scene: a file of obstacles.

    Raises:
        InvalidInputError: a malformed number or scene.
    """
    if clearance is None and floor is None and not boxes and not spheres and scene is None:
        return None
    from jacokin.ik.tracking.clearance import CLEARANCE, Clearance
    from jacokin.model.obstacles import Box, Floor, Sphere

    obstacles: list[Obstacle] = []
    for index, text in enumerate(boxes or (), start=1):
        values = numbers("--box", text, 6) or []
        obstacles.append(Box(f"--box {index}", values[3:], values[:3]))
    for index, text in enumerate(spheres or (), start=1):
        values = numbers("--sphere", text, 4) or []
        obstacles.append(Sphere(f"--sphere {index}", values[3], values[:3]))
    if floor is not None:
        obstacles.append(Floor(floor))
    if scene is not None:
        from jacokin.model.scenes.scene import Scene

        obstacles.extend(Scene.load(scene))
    return Clearance(CLEARANCE if clearance is None else clearance, obstacles)
