"""The map that a command names."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from jacokin.model.descriptions.bundled import NAMES

if TYPE_CHECKING:
    from jacokin.reachability.map import ReachabilityMap


def load(folder: str) -> ReachabilityMap:
    """A map in a folder, or the bundled one of a robot.

    Raises:
        InvalidInputError: it is neither.
    """
    from jacokin.reachability import loading

    return loading.bundled(folder) if folder in NAMES and not Path(folder).exists() else loading.load(folder)
