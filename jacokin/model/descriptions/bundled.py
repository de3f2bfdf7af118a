"""The robots that come with the package and where their files lie."""

from __future__ import annotations

from pathlib import Path

from jacokin.model.descriptions import table
from jacokin.model.descriptions.table import urdf_folder as urdf_folder

#: The robot that is meant when none is named.
DEFAULT_ROBOT = "j2n6s300"
#: Names of the bundled robots, in the order of the table.
NAMES: tuple[str, ...] = tuple(table.load()["variants"])


def part_file(robot: str, part: str) -> Path:
    """The MJCF file of the "arm" or the "hand" of a bundled robot."""
    return urdf_folder() / f"{'jaco' if robot == DEFAULT_ROBOT else robot}_{part}.xml"
