"""Angles on the command line: typed and shown in radians or degrees."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from jacokin.errors import InvalidInputError


@dataclass(frozen=True, slots=True)
class Angles:
    """The unit in which angles are typed and shown.

    Attributes:
        degrees: True for degrees, False for radians.
    """

    degrees: bool

    @property
    def unit(self) -> str:
        """Name of the unit."""
        return "deg" if self.degrees else "rad"

    def given(self, values: Iterable[float]) -> list[float]:
        """What the user typed, in [rad]."""
        return [math.radians(value) for value in values] if self.degrees else [float(value) for value in values]

    def shown(self, values: Iterable[float]) -> list[float]:
        """Angles [rad] in the user's unit."""
        return [math.degrees(value) for value in values] if self.degrees else [float(value) for value in values]

    def one(self, value: float) -> float:
        """One angle [rad] in the user's unit."""
        return self.shown([value])[0]

    def seed(self, text: str | None) -> list[float] | None:
        """The value of `--seed` in [rad].

        Raises:
            InvalidInputError: not numbers.
        """
        if text is None:
            return None
        words = text.replace(",", " ").split()
        try:
            values = [float(word) for word in words]
        except ValueError:
            raise InvalidInputError(f"--seed must be joint angles, got {text.strip()!r}") from None
        if not values:
            raise InvalidInputError("--seed must be followed by joint angles")
        return self.given(values)
