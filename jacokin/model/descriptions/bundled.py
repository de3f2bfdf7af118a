"""The bundled robots: their names, their files, and their table of numbers, `urdf/jaco.toml`."""

from __future__ import annotations

import functools
import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jacokin.errors import ModelError, UnknownNameError

#: The robot that is meant when none is named.
DEFAULT_ROBOT = "j2n6s300"


def urdf_folder() -> Path:
    """Folder of the generated descriptions: inside the installed package, or beside it in a source tree."""
    package = Path(__file__).resolve().parents[2]
    installed = package / "urdf"
    return installed if installed.is_dir() else package.parent / "urdf"


@functools.cache
def robot_table(file_name: str = "jaco.toml") -> Mapping[str, Any]:
    """The whole table as nested dictionaries; treat it as read-only."""
    with (urdf_folder() / file_name).open("rb") as file:
        return tomllib.load(file)


#: Names of the bundled robots, in the order of the table.
NAMES: tuple[str, ...] = tuple(robot_table()["variants"])


def parse_angle(value: float | str) -> float:
    """A number [rad], or an exact multiple of pi such as ``"pi"``, ``"-pi/2"``, ``"pi/3"``.

    Raises:
        ValueError: the text is not such a multiple.
    """
    if not isinstance(value, str):
        return float(value)
    match = re.fullmatch(r"(-?)pi(?:/(\d+))?", value)
    if match is None:
        raise ValueError(f"{value!r} is not an angle; write a number or a string such as 'pi', '-pi/2', 'pi/3'")
    sign, divisor = match.groups()
    return (-math.pi if sign else math.pi) / int(divisor or 1)


def section(group: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Section `name` of a group, completed from the one it names with ``like``.

    Raises:
        UnknownNameError: the group has no such section; lists those it has.
        ModelError: sections name each other in a circle.
    """
    merged: dict[str, Any] = {}
    for ancestor in reversed(ancestors(group, name)):
        for key, value in group[ancestor].items():
            both_tables = isinstance(value, dict) and isinstance(merged.get(key), dict)
            merged[key] = {**merged[key], **value} if both_tables else value
    merged.pop("like", None)
    return merged


def ancestors(group: Mapping[str, Any], name: str) -> list[str]:
    """A section, the one it is ``like``, the one that is like, and so on. Errors as `section`."""
    names: list[str] = []
    following: str | None = name
    while following is not None:
        if following in names:
            raise ModelError(f"sections are like each other in a circle: {' -> '.join([*names, following])}")
        if not isinstance(group.get(following), Mapping):
            raise UnknownNameError(
                "section of the table", following, [k for k, v in group.items() if isinstance(v, dict)]
            )
        names.append(following)
        following = group[following].get("like")
    return names


def variant(name: str) -> Mapping[str, Any]:
    """Row of a bundled robot: its arm, its hand, its home [rad]."""
    row: Mapping[str, Any] = robot_table()["variants"][name]
    return row


def arm(name: str) -> Mapping[str, Any]:
    """Section of the arm of a bundled robot."""
    return section(robot_table()["arms"], variant(name)["arm"])


def arm_joints(name: str) -> dict[str, Mapping[str, Any]]:
    """Rows of the arm joints of a bundled robot, by joint name, base to tip."""
    return {key: row for key, row in arm(name).items() if key.startswith("joint_")}


def hand(name: str) -> Mapping[str, Any]:
    """Section of the hand of a bundled robot."""
    row: Mapping[str, Any] = robot_table()["hands"][variant(name)["hand"]]
    return row


def actuator(group: str) -> Mapping[str, Any]:
    """Row of the actuator of a joint group ("large", "small", "finger"), ranges in [rad/s] and [N m]."""
    row = dict(robot_table()["actuators"][group])
    if "ctrl_range_deg" in row:
        row["ctrl_range"] = [math.radians(value) for value in row.pop("ctrl_range_deg")]
    return row


def source_text(key: str) -> str:
    """What a source letter of the table stands for."""
    return str(robot_table()["sources"][key])


def part_file(robot: str, part: str) -> Path:
    """The MJCF file of the "arm" or the "hand" of a bundled robot."""
    return urdf_folder() / f"{'jaco' if robot == DEFAULT_ROBOT else robot}_{part}.xml"
