"""Negative numbers and lists of numbers among the arguments: an option parser would read -1.2 as an option."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

# Options followed by any number of numbers, such as one for each joint.
NUMBER_LISTS = frozenset(
    {"--seed", "--start", "--velocity-limit", "--acceleration-limit", "--box", "--sphere", "--target", "--tool"}
)

_NUMBER = re.compile(r"[-+]?((\d+\.?\d*|\.\d+)(e[-+]?\d+)?|inf(inity)?|nan)", re.IGNORECASE | re.ASCII)


def separated(words: Iterable[str], values: Mapping[str, int]) -> list[str]:
    """The arguments with options first and everything else after `--`, where nothing is taken for an option.

    Args:
        words: the arguments as typed.
        values: how many values follow each option; the names in NUMBER_LISTS take all numbers that follow, which
            become one value.
    """
    ahead = list(words)
    options: list[str] = []
    others: list[str] = []
    while ahead:
        word = ahead.pop(0)
        if word == "--":
            others += ahead
            break
        name, sign, value = word.partition("=")
        if name in NUMBER_LISTS and name in values:
            options += [name, " ".join(_numbers(ahead, [value] if sign else []))]
        elif name in values and values[name] > 0:
            given = [value] if sign else []
            missing = values[name] - len(given)
            if len(ahead) < missing:
                return [*options, name, *given, *ahead]  # the parser says what is missing
            options += [name, *given, *ahead[:missing]]
            del ahead[:missing]
        elif len(word) > 1 and word.startswith("-") and not _NUMBER.fullmatch(word):
            options.append(word)
        else:
            others.append(word)
    return [*options, "--", *others] if others else options


def _numbers(ahead: list[str], taken: list[str]) -> list[str]:
    """Take the numbers ahead; without any, the next word, such as "1 2 3" in quotes or something to refuse."""
    while ahead and _NUMBER.fullmatch(ahead[0]):
        taken.append(ahead.pop(0))
    if not taken and ahead and not ahead[0].startswith("-"):
        taken.append(ahead.pop(0))
    return taken
