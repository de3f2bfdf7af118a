"""`Faults`: what goes wrong between a driver and its arm, and the `Line` on which it does; drawn from a seed."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, fields
from typing import Generic, Self, TypeVar

import numpy as np

from jacokin.errors import InvalidInputError
from jacokin.model import checks

TICK = 0.01  # [s] of Kinova's base, which takes a command, and plays a velocity, so long (README of kinova-ros)
LONGEST = 10.0  # [s] of a lag or a stall

Command = TypeVar("Command")
Measured = TypeVar("Measured")


@dataclass(frozen=True, slots=True)
class Faults:
    """What goes wrong; nothing where all is 0."""

    lag: float = 0.0
    """Velocities act, and what is measured is told, this much later [s]."""
    loss: float = 0.0
    """Share of the velocities, and of what is told, that never arrives, 0 to 1."""
    stall: float = 0.0
    """Now and then, every 5 s on average, nothing passes for so long, either way [s]."""

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            InvalidInputError: one is out of range.
        """
        for name, most, unit in (("lag", LONGEST, "s"), ("loss", 1.0, ""), ("stall", LONGEST, "s")):
            if checks.non_negative(name, getattr(self, name), unit) > most:
                raise InvalidInputError(f"{name} must be at most {most:g}, got {getattr(self, name):g}")

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read faults from a text such as ``"lag=0.02,loss=0.01,stall"``; a stall without a length takes 0.3 s.

        Raises:
            InvalidInputError: not such a text, or a value out of range.
            UnknownNameError: a fault that does not exist.
        """
        checks.instance("faults", text, str, "a text")
        values: dict[str, float] = {}
        for word in filter(None, (part.strip() for part in text.split(","))):
            name, sign, value = word.partition("=")
            checks.choice("fault", name, [field.name for field in fields(cls)])
            if name in values:
                raise InvalidInputError(f"{name} is given twice")
            if name == "stall" and not sign:
                value = "0.3"  # [s]
            try:
                values[name] = float(value)
            except ValueError:
                raise InvalidInputError(f"faults must be like lag=0.02,loss=0.01,stall=0.3, got {word!r}") from None
        return cls(**values)


class Line(Generic[Command, Measured]):
    """The line between a driver and its arm, tick by tick."""

    def __init__(self, faults: Faults, seed: int = 0) -> None:
        """Draw the faults from a seed."""
        self._faults, self._random = faults, np.random.default_rng(seed)
        self._lag = round(faults.lag / TICK)
        self._sent: deque[tuple[int, Command]] = deque()  # with the tick in which they arrive
        self._told: deque[Measured] = deque(maxlen=self._lag + 1)
        self._now, self._dead = 0, 0  # ticks, and until which one nothing passes
        self.lost, self.stalls = 0, 0

    @property
    def is_dead(self) -> bool:
        """Whether nothing passes now."""
        return self._now < self._dead

    def tick(self, measured: Measured) -> None:
        """Let a tick pass, after which this is measured."""
        self._now += 1
        self._told.append(measured)
        if self._faults.stall and not self.is_dead and self._random.random() < TICK / 5.0:  # [s] on average
            self._dead = self._now + round(self._faults.stall / TICK)
            self.stalls += 1

    def send(self, command: Command) -> None:
        """Send a command to the arm."""
        if self.is_dead or self._is_lost():
            self.lost += 1
        else:
            self._sent.append((self._now + self._lag, command))

    def arrived(self) -> list[Command]:
        """The commands that arrive now, in their order."""
        found = []
        while self._sent and self._sent[0][0] <= self._now:
            found.append(self._sent.popleft()[1])
        return found

    def clear(self) -> None:
        """Forget what is under way to the arm."""
        self._sent.clear()

    @property
    def measured(self) -> Measured:
        """What a driver knows now."""
        return self._told[0]

    def tell(self) -> Measured | None:
        """What a driver tells now, None where that gets lost."""
        return None if self.is_dead or self._is_lost() else self.measured

    def _is_lost(self) -> bool:
        return self._faults.loss > 0.0 and self._random.random() < self._faults.loss
