"""Units of what is typed and shown: angles in radians or degrees, prismatic joints always in metres."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import click

from jacokin import model

ANGLE = re.compile(r"(-?\d+(?:\.\d+)?(?:e[-+]?\d+)?) rad\b")  # in a message
FARTHEST = 10.0  # [m] no arm of this kind reaches so far


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

    def to_si(self, values: Iterable[float]) -> list[float]:
        """Angles the user typed, in [rad]."""
        return [math.radians(value) for value in values] if self.degrees else [float(value) for value in values]

    def from_si(self, value: float) -> float:
        """An angle [rad] in the user's unit."""
        return math.degrees(value) if self.degrees else float(value)

    def in_words(self, message: str) -> str:
        """A message of the library, whose angles are in radians, in the user's unit."""
        if not self.degrees:
            return message
        return ANGLE.sub(lambda found: f"{math.degrees(float(found[1])):.6g} deg", message)

    def for_joints(self, robot: model.Robot) -> JointUnits:
        """The units of a robot's joints."""
        return JointUnits(self, tuple(bool(is_prismatic) for is_prismatic in robot.sliding))


@dataclass(frozen=True, slots=True)
class JointUnits:
    """The unit of each joint.

    Attributes:
        units: the unit of angles.
        prismatic: True for each prismatic joint.
    """

    units: Units
    prismatic: tuple[bool, ...]

    @property
    def names(self) -> list[str]:
        """The unit of each joint."""
        return ["m" if is_prismatic else self.units.angle for is_prismatic in self.prismatic]

    def to_si(self, values: Sequence[float]) -> list[float]:
        """What the user typed for each joint, in [rad] or [m]; a wrong number of values is passed on."""
        if len(values) != len(self.prismatic):
            return list(values)
        turned = self.units.to_si(values)
        return [float(values[k]) if is_prismatic else turned[k] for k, is_prismatic in enumerate(self.prismatic)]

    def option_to_si(self, values: Sequence[float] | None, *, one_for_all: bool = False) -> list[float] | None:
        """As `to_si`; None where an option is not given, and one number may stand for all joints."""
        if values is None:
            return None
        return self.to_si([*values] * len(self.prismatic) if one_for_all and len(values) == 1 else values)

    def from_si(self, values: Iterable[float]) -> list[float]:
        """Joint values in the user's unit."""
        pairs = zip(values, self.prismatic, strict=True)
        return [float(value) if is_prismatic else self.units.from_si(value) for value, is_prismatic in pairs]

    def heading(self, text: str) -> str:
        """A column's heading: with the unit where all joints have the same."""
        return text if any(self.prismatic) else f"{text} [{self.units.angle}]"

    def labels(self, names: Iterable[str]) -> list[str]:
        """Names of joints: with the unit of each where they differ."""
        if not any(self.prismatic):
            return list(names)
        return [f"{name} [{unit}]" for name, unit in zip(names, self.names, strict=True)]

    def distance(self, value: float) -> float:
        """A distance between configurations: in the unit of angles if every joint is revolute, else unchanged."""
        return float(value) if any(self.prismatic) else self.units.from_si(value)


def warn_of_degrees(option: str, values: Iterable[float], units: Units) -> None:
    """A note on stderr where angles in radians look like degrees: they exceed a full turn."""
    if not units.degrees and any(abs(value) > 2.0 * math.pi for value in values):
        _note(f"{option} is in radians, and an angle exceeds a full turn; --degrees is for degrees")


def warn_of_joint_degrees(option: str, values: Sequence[float], joints: JointUnits) -> None:
    """As `warn_of_degrees` for one value of each joint, of which those that slide are in metres anyway."""
    turning = [value for value, slides in zip(values, joints.prismatic, strict=False) if not slides]
    warn_of_degrees(option, turning, joints.units)


def warn_of_millimetres(option: str, position: Iterable[float]) -> None:
    """A note on stderr where a position in metres looks like one in millimetres."""
    if any(abs(value) > FARTHEST for value in position):
        _note(f"{option} is in metres, and a coordinate exceeds {FARTHEST:g} m; 350 mm are 0.35")


def _note(text: str) -> None:
    click.echo(f"jacokin: note: {text}", err=True)
