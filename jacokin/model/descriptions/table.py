"""The one table of numbers behind the bundled robots, as the package reads it: `urdf/jaco.toml`."""

from __future__ import annotations

import functools
import math
import re
import tomllib
from collections.abc import Mapping
from typing import Any

from jacokin.model.descriptions import bundled


@functools.cache
def load(file_name: str = "jaco.toml") -> Mapping[str, Any]:
    """The whole table as nested dictionaries; treat it as read-only."""
    with (bundled.urdf_folder() / file_name).open("rb") as file:
        return tomllib.load(file)


def angle(value: float | str) -> float:
    """A number [rad], or an exact multiple of pi such as ``"pi"``, ``"-pi/2"``, ``"pi/3"``.

    Raises:
        ValueError: the text is no such multiple.
    """
    if not isinstance(value, str):
        return float(value)
    match = re.fullmatch(r"(-?)pi(?:/(\d+))?", value)
    if match is None:
        raise ValueError(f"{value!r} is not an angle; write a number or a string such as 'pi', '-pi/2', 'pi/3'")
    sign, divisor = match.groups()
    return (-math.pi if sign else math.pi) / int(divisor or 1)


def section(group: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Section `name` of a group, completed from the one it names with ``like``."""
    own = dict(group[name])
    merged = section(group, own.pop("like")) if "like" in own else {}
    for key, value in own.items():
        both_tables = isinstance(value, dict) and isinstance(merged.get(key), dict)
        merged[key] = {**merged[key], **value} if both_tables else value
    return merged


def variant(name: str) -> Mapping[str, Any]:
    """Row of a bundled robot: its arm, its hand, its home [rad]."""
    row: Mapping[str, Any] = load()["variants"][name]
    return row


def arm_joints(name: str) -> dict[str, Mapping[str, Any]]:
    """Rows of the arm joints of a bundled robot, by joint name, base to tip."""
    rows = section(load()["arms"], variant(name)["arm"])
    return {key: row for key, row in rows.items() if key.startswith("joint_")}


def actuator(group: str) -> Mapping[str, Any]:
    """Row of the velocity actuator of a joint group ("large", "small", "finger"), ranges in [rad/s] and [N m]."""
    row = dict(load()["actuators"][group])
    if "ctrl_range_deg" in row:
        row["ctrl_range"] = [math.radians(value) for value in row.pop("ctrl_range_deg")]
    return row


def source_text(key: str) -> str:
    """What a source letter of the table stands for."""
    return str(load()["sources"][key])
