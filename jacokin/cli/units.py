"""Units of what is typed and shown: angles in radians or degrees, prismatic joints always in metres."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import click

from jacokin import model
from jacokin.errors import InvalidInputError

# In a message: a number, numbers before "rad", and what was given where angles are needed.
NUMBER = re.compile(r"(?<![\w.^])-?\d+(?:\.\d*)?(?:e[-+]?\d+)?(?!\w)")
ANGLES = re.compile(rf"\[?{NUMBER.pattern}(?:(?:, | to ){NUMBER.pattern})*\]? rad\b")
GIVEN = re.compile(r"\[rad\b[^]]*\](, got (?!shape\b).*)?", re.DOTALL)
UNIT = re.compile(r"\brad\b")
DIGITS = 6  # of an angle in a message, or as many as it has there


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
        return GIVEN.sub(_turned, ANGLES.sub(_turned, message))

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
        """What the user typed for each joint, in [rad] or [m]."""
        turned = self.units.to_si(values)
        return [float(values[k]) if is_prismatic else turned[k] for k, is_prismatic in enumerate(self.prismatic)]

    def configuration(self, option: str, values: Sequence[float]) -> list[float]:
        """What the user typed for a configuration, in [rad] or [m]; with a note where radians look like degrees.

        Raises:
            InvalidInputError: not one value for each joint.
        """
        if len(values) != len(self.prismatic):
            raise InvalidInputError(f"{option} must be {len(self.prismatic)} numbers, got {len(values)}")
        turning = [value for value, slides in zip(values, self.prismatic, strict=False) if not slides]
        warn_of_degrees(option, turning, self.units)
        if self.units.degrees and 0.0 < max(map(abs, turning), default=0.0) < 2.0 * math.pi:
            _note(
                f"{option} is in degrees, and no angle exceeds {2.0 * math.pi:.3g}; without --degrees they are radians"
            )
        return self.to_si(values)

    def seed(self, option: str, values: Sequence[float] | None) -> list[float] | None:
        """A configuration [rad] or [m] to start near to; None where the option is not given."""
        return None if values is None else self.configuration(option, values)

    def limits(self, option: str, values: Sequence[float] | None, unit: str) -> list[float] | None:
        """Limits of the joints, typed in a unit such as "rad/s", one for all or one for each; None where not given.

        Raises:
            InvalidInputError: neither one value nor one for each joint.
        """
        if values is None:
            return None
        if len(values) not in (1, len(self.prismatic)):
            raise InvalidInputError(f"{option} must be one number or {len(self.prismatic)}, got {len(values)}")
        all_values = [*values] * len(self.prismatic) if len(values) == 1 else values
        turning = [value for value, slides in zip(all_values, self.prismatic, strict=False) if not slides]
        warn_of_degrees(option, turning, self.units, unit)
        return self.to_si(all_values)

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


def warn_of_degrees(
    option: str, values: Iterable[float], units: Units, unit: str = "rad", advice: str = "--degrees is for degrees"
) -> None:
    """A note on stderr where angles in radians look like degrees: they exceed a full turn, or one in a second."""
    if not units.degrees and any(2.0 * math.pi < abs(value) < math.inf for value in values):
        what = "an angle exceeds a full turn" if unit == "rad" else f"{2.0 * math.pi:.3g} {unit} are a full turn"
        _note(f"{option} is in {unit.replace('rad', 'radians', 1)}, and {what}; {advice}")


def warn_of_millimetres(option: str, position: Iterable[float]) -> None:
    """A note on stderr where a position in metres looks like one in millimetres; `pose` says it of its own."""
    from jacokin.model.poses import FARTHEST  # with NumPy, not for the command line's help

    if any(abs(value) > FARTHEST for value in position):
        _note(f"{option} is in metres, and {list(position)} exceeds {FARTHEST:g} m; 350 mm are 0.35")


def _turned(found: re.Match[str]) -> str:
    """A part of a message, its angles in degrees."""
    numbers = NUMBER.sub(lambda number: f"{math.degrees(float(number[0])):.{_digits(number[0])}g}", found[0])
    return UNIT.sub("deg", numbers)


def _digits(number: str) -> int:
    """How many digits to write of an angle that is written so in radians."""
    return min(max(DIGITS, sum(map(str.isdigit, number.partition("e")[0]))), sys.float_info.dig)


def _note(text: str) -> None:
    click.echo(f"jacokin: note: {text}", err=True)
