"""Negative numbers among the arguments: an option parser would read them as options."""

from __future__ import annotations

import re
from collections.abc import Sequence

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
