"""The map that a command names."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

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
