"""The bundled robots: their names, their files, and their numbers, `urdf/jaco.toml` and `urdf/gen3.toml`."""

from __future__ import annotations

import functools
import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jacokin.errors import ModelError, UnknownNameError

#: The robot that is meant when none is named.
DEFAULT_ROBOT = "j2n6s300"

#: The files that together are the table of numbers; their sections have different names.
TABLES = ("jaco.toml", "gen3.toml")

#: The same as JSON, written by ``urdf/generate.py``: Python reads it in 1 ms, where TOML takes 12.
WRITTEN = "tables.json"

#: What `hand` says of an arm that is bundled without one.
NO_HAND = "none"


def urdf_folder() -> Path:
    """Folder of the generated descriptions: inside the installed package, or beside it in a source tree."""
    package = Path(__file__).resolve().parents[2]
    installed = package / "urdf"
    return installed if installed.is_dir() else package.parent / "urdf"


@functools.cache
def robot_table(*file_names: str) -> Mapping[str, Any]:
    """The whole table, or what the given TOML files hold, as nested dictionaries; treat it as read-only."""
    if file_names:
        return read_tables(urdf_folder(), *file_names)
    table: dict[str, Any] = json.loads((urdf_folder() / WRITTEN).read_bytes())
    return table


def read_tables(folder: Path, *file_names: str) -> dict[str, Any]:
    """TOML files of a folder as nested dictionaries, groups of the same name in one."""
    import tomllib  # only generators and the documentation read them

    whole: dict[str, Any] = {}
    for file_name in file_names:
        with (folder / file_name).open("rb") as file:
            for group, rows in tomllib.load(file).items():
                whole[group] = {**whole.get(group, {}), **rows}
    return whole


#: Names of the bundled robots, in the order of the table.
NAMES: tuple[str, ...] = tuple(robot_table()["variants"])

#: Those of the family of the Jaco, whose arms and hands `jacokin.mujoco_bridge` simulates.
JACOS: tuple[str, ...] = tuple(name for name, row in robot_table()["variants"].items() if row["family"] == "jaco")


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
    """Section of the hand of a bundled robot; empty where it has none."""
    return in_hand(robot_table(), variant(name)["hand"])


def in_hand(table: Mapping[str, Any], hand: str) -> Mapping[str, Any]:
    """Section of a hand, with the `finger` and `finger_tip` of all hands where it has none of its own; {} for none."""
    if hand == NO_HAND:
        return {}
    return {"finger": table["finger"], "finger_tip": table["finger_tip"], **table["hands"][hand]}


def finger(name: str) -> Mapping[str, Any] | None:
    """Row of the fingers of a bundled robot, from open (`lower` [rad]) to closed (`upper`); None where it has none."""
    return hand(name).get("finger")


def open_angle(name: str) -> float | None:
    """Angle of the open fingers of a bundled robot [rad], at which it is loaded; None where it has none."""
    row = finger(name)
    return None if row is None else float(row["lower"])


def actuator(group: str) -> Mapping[str, Any]:
    """Row of the actuator of a joint group such as "large", ranges in [rad/s] and [N m]; empty where none is known."""
    row = dict(robot_table()["actuators"].get(group, {}))
    if "ctrl_range_deg" in row:
        row["ctrl_range"] = [math.radians(value) for value in row.pop("ctrl_range_deg")]
    return row


def source_text(key: str) -> str:
    """What a source letter of the table stands for."""
    return str(robot_table()["sources"][key])


def part_file(robot: str, part: str) -> Path:
    """The MJCF file of the "arm" or the "hand" of a bundled robot of the Jaco's family."""
    return urdf_folder() / f"{'jaco' if robot == DEFAULT_ROBOT else robot}_{part}.xml"
