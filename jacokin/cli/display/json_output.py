"""Results as one JSON document, for programs."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from enum import Enum
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from jacokin.cli.arguments.units import Units
    from jacokin.model.robot import Robot


def print_json(document: Mapping[str, object]) -> None:
    """Print one JSON document; floats as the shortest text that reads back the same, infinite ones as null."""
    click.echo(json.dumps(plain(document), indent=2, allow_nan=False))


def head(robot: Robot, units: Units, frame: str | None = None) -> dict[str, object]:
    """What a document about joint values begins with."""
    return {
        "robot": robot.name,
        **({} if frame is None else {"frame": frame}),
        "joint_names": robot.joint_names,
        "angle_unit": units.angle,
        "joint_units": units.of_joints(robot).names,
    }


def plain(value: object) -> object:
    """A value made of what JSON has."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # numpy arrays and numpy numbers
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
