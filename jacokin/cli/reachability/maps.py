"""The map that a command names."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from jacokin.cli.arguments import options
from jacokin.cli.arguments.declared import Option
from jacokin.errors import UnknownNameError
from jacokin.model.descriptions.bundled import NAMES

if TYPE_CHECKING:
    from jacokin.reachability.map import ReachabilityMap


def load(folder: str) -> ReachabilityMap:
    """A map in a folder, or the bundled one of a robot.

    Raises:
        UnknownNameError: it is neither.
        InvalidInputError: a folder without a map, or with a damaged one.
    """
    from jacokin.reachability import loading

    if Path(folder).exists():
        return loading.load(folder)
    if folder in NAMES:
        return loading.bundled(folder)
    raise UnknownNameError("map", folder, [*NAMES, "or the folder of a map"])


@dataclass(frozen=True, slots=True)
class MapOptions:
    """What a map was built with, where that is not a bundled robot as it is, without a scene."""

    scene: options.SceneOption = None
    robot: Annotated[
        str | None,
        Option("--robot", metavar="NAME|FILE", help="The robot of the map, where it is not a bundled one as it is."),
    ] = None
    base: options.BaseOption = None
    tip: options.TipOption = None
    package_dir: options.PackageDirOption = None
    limit: options.LimitOption = None
    finger_angle: options.FingerAngleOption = None

    def load(self, folder: str) -> ReachabilityMap:
        """A map in a folder, or the bundled one of a robot, with its robot and scene.

        Raises:
            UnknownNameError: it is neither.
            InvalidInputError: a folder without a map, a damaged one, or a map of another robot or scene.
        """
        from jacokin.reachability import loading

        found = load(folder)
        around, _ = options.surroundings(self.scene, None)
        arm = None
        if self.robot is not None or self.limit or self.finger_angle is not None:
            name = self.robot or found.recipe["robot"]["bundled"] or options.DEFAULT_ROBOT
            arm = options.load(
                name, self.base, self.tip, self.package_dir, limits=self.limit, finger_angle=self.finger_angle
            )
        if arm is None and around is None:
            return found
        return loading.load(found.folder, robot=arm, scene=around)
