"""Units of what is typed and shown: angles in radians or degrees, sliding joints always in metres."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from jacokin.model.robot import Robot


@dataclass(frozen=True, slots=True)
class Units:
    """The unit in which angles are typed and shown.

    Attributes:
        degrees: True for degrees, False for radians.
    """

    degrees: bool

    @property
    def angle(self) -> str:
        """Name of the unit of angles."""
        return "deg" if self.degrees else "rad"

    def read(self, values: Iterable[float]) -> list[float]:
        """Angles the user typed, in [rad]."""
        return [math.radians(value) for value in values] if self.degrees else [float(value) for value in values]

    def shown(self, value: float) -> float:
        """An angle [rad] in the user's unit."""
        return math.degrees(value) if self.degrees else float(value)

    def of_joints(self, robot: Robot) -> JointUnits:
        """The units of a robot's joints."""
        return JointUnits(self, tuple(bool(slides) for slides in robot.sliding))


@dataclass(frozen=True, slots=True)
class JointUnits:
    """The unit of each joint.

    Attributes:
        units: the unit of angles.
        sliding: True for each joint that slides.
    """

    units: Units
    sliding: tuple[bool, ...]

    @property
    def names(self) -> list[str]:
        """The unit of each joint."""
        return ["m" if slides else self.units.angle for slides in self.sliding]

    def read(self, values: Sequence[float]) -> list[float]:
        """What the user typed for each joint, in [rad] or [m]; a wrong number of values is passed on."""
        if len(values) != len(self.sliding):
            return list(values)
        turned = self.units.read(values)
        return [float(values[k]) if slides else turned[k] for k, slides in enumerate(self.sliding)]

    def read_option(self, values: Sequence[float] | None, *, one_for_all: bool = False) -> list[float] | None:
        """As `read`; None where an option is not given, and one number may stand for all joints."""
        if values is None:
            return None
        return self.read([*values] * len(self.sliding) if one_for_all and len(values) == 1 else values)

    def shown(self, values: Iterable[float]) -> list[float]:
        """Joint values in the user's unit."""
        pairs = zip(values, self.sliding, strict=True)
        return [float(value) if slides else self.units.shown(value) for value, slides in pairs]

    def heading(self, text: str) -> str:
        """A column's heading: with the unit where all joints have the same."""
        return text if any(self.sliding) else f"{text} [{self.units.angle}]"

    def labels(self, names: Iterable[str]) -> list[str]:
        """Names of joints: with the unit of each where they differ."""
        if not any(self.sliding):
            return list(names)
        return [f"{name} [{unit}]" for name, unit in zip(names, self.names, strict=True)]

    def distance(self, value: float) -> float:
        """A distance between configurations: in the unit of angles if every joint turns, else as it is."""
        return float(value) if any(self.sliding) else self.units.shown(value)


def warn_of_degrees(option: str, values: Iterable[float], units: Units) -> None:
    """A note on stderr where angles in radians look like degrees: they exceed a full turn."""
    if not units.degrees and any(abs(value) > 2.0 * math.pi for value in values):
        click.echo(f"jacokin: note: {option} is in radians, and an angle exceeds a full turn", err=True)
