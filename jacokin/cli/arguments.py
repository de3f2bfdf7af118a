"""What the commands have in common: options, angles in two units, and arguments that begin with a minus sign."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    from jacokin.model.robot import Robot

DEFAULT_ROBOT = "j2n6s300"

RobotOption = Annotated[
    str, typer.Option("--robot", metavar="NAME|FILE", help="A bundled robot, or the path of a .urdf or .xml (MJCF).")
]
BaseOption = Annotated[
    str | None, typer.Option("--base", metavar="FRAME", help="Base frame of the arm; the file's root if not given.")
]
TipOption = Annotated[
    str | None, typer.Option("--tip", metavar="FRAME", help="Frame at the end of the arm, for a file with several.")
]
FrameOption = Annotated[
    str | None, typer.Option("--frame", metavar="NAME", help="Frame of the tool; `jacokin info` lists them.")
]
DegreesOption = Annotated[bool, typer.Option("--degrees", help="Angles in and out in degrees.")]
JsonOption = Annotated[bool, typer.Option("--json", help="One JSON document on stdout, floats in full precision.")]
SeedOption = Annotated[
    str | None,
    typer.Option(
        "--seed",
        metavar="Q1 .. Q6",
        help="Joint angles to stay near to; the robot's home if not given.",
        show_default=False,
    ),
]
RandomSeedOption = Annotated[
    int | None,
    typer.Option("--random-seed", metavar="N", min=0, help="Seed of the random numbers; fixed if not given."),
]
QArgument = Annotated[
    list[float],
    typer.Argument(metavar="ANGLE", help="Joint angles, base to tip, one for each joint.", show_default=False),
]

_NUMBER = re.compile(r"[-+]?((\d+\.?\d*|\.\d+)(e[-+]?\d+)?|inf(inity)?|nan)", re.IGNORECASE)


def prepared(argv: Sequence[str]) -> list[str]:
    """The arguments, changed so that an option parser reads negative numbers as values.

    A number gets a leading blank, which `float` ignores, and so does not look like an option. The numbers after
    `--seed`, as many as the robot has joints, become one value.
    """
    words: list[str] = []
    seed: list[str] | None = None
    for word in _split_seed(argv):
        number = _NUMBER.fullmatch(word) is not None
        if seed is not None and number:
            seed.append(word)
            words[-1] = " " + " ".join(seed)
        elif word == "--seed":
            words += [word, " "]
            seed = []
        elif seed == [] and not word.startswith("-"):
            words[-1] = word  # `--seed "1 2 3 4 5 6"`, or something to complain about
            seed = None
        else:
            words.append(" " + word if number else word)
            seed = None
    return words


def _split_seed(argv: Sequence[str]) -> list[str]:
    """`--seed=1 2 ...` as `--seed 1 2 ...`."""
    words: list[str] = []
    for word in argv:
        option, sign, value = word.partition("=")
        words += [option, value] if option == "--seed" and sign else [word]
    return words


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


def load(robot: str, base: str | None = None, tip: str | None = None) -> Robot:
    """The robot the options name."""
    from jacokin.model.loading import load_robot

    return load_robot(robot, base=base, tip=tip)
