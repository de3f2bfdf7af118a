"""Results as tables, for people."""

from __future__ import annotations

import math
import shutil
import sys
import textwrap
from collections.abc import Iterable, Sequence

import click

PIPE_WIDTH = 160  # columns of what is not shown in a terminal, so that little is broken
GAP = 3  # columns between columns
NARROWEST = 16  # columns that text is broken into at least


def say(text: str) -> None:
    """Print a text, its control characters escaped."""
    click.echo(printable(text))


def printable(text: str) -> str:
    """A text whose control characters are escaped: names in files may hold some, and a terminal obeys them."""
    return "".join(char if char.isprintable() or char == "\n" else ascii(char)[1:-1] for char in text)


def table(title: str | None, columns: Sequence[str], rows: Iterable[Sequence[str]], *, text: int = 1) -> str:
    """A table whose first `text` columns are text, broken where it is too wide, and whose others are numbers."""
    lines = [list(columns), *(list(row) for row in rows)]
    widths = _widths(lines, text)
    rule = " " + _dash() * (sum(widths) + GAP * (len(widths) - 1) + 2)
    head = _row(lines[0], widths, text)
    body = [line for row in lines[1:] for line in _row(row, widths, text)]
    return "\n".join([*([] if title is None else [title]), "", *head, rule, *body, ""])


def facts(rows: Iterable[tuple[str, str]], title: str | None = None) -> str:
    """Names and what they are."""
    lines = [list(row) for row in rows]
    widths = _widths(lines, 2)
    body = [line for row in lines for line in _row(row, widths, 2)]
    return "\n".join([*([] if title is None else [title, ""]), *body, ""])


def _widths(lines: Sequence[Sequence[str]], text: int) -> list[int]:
    """Width of each column; the widest text gives way where all do not fit."""
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    space = shutil.get_terminal_size().columns if sys.stdout.isatty() else PIPE_WIDTH
    excess = 2 + sum(widths) + GAP * (len(widths) - 1) - space
    while excess > 0:
        widest = max(range(text), key=widths.__getitem__)
        cut = min(excess, widths[widest] - NARROWEST)
        if cut <= 0:
            break
        widths[widest] -= cut
        excess -= cut
    return widths


def _row(cells: Sequence[str], widths: Sequence[int], text: int) -> list[str]:
    """The lines of a row."""
    broken = [textwrap.wrap(cell, width) or [""] for cell, width in zip(cells, widths, strict=True)]
    lines = []
    for index in range(max(map(len, broken))):
        parts = [
            (cell[index] if index < len(cell) else "").ljust(width)
            if column < text
            else (cell[index] if index < len(cell) else "").rjust(width)
            for column, (cell, width) in enumerate(zip(broken, widths, strict=True))
        ]
        lines.append(f"  {(' ' * GAP).join(parts)}".rstrip())
    return lines


def _dash() -> str:
    return "─" if (sys.stdout.encoding or "").lower().startswith("utf") else "-"


def number(value: float, digits: int = 6, *, missing: str = "unlimited") -> str:
    """A number for a table; an infinite one is said in words."""
    return missing if math.isinf(value) else f"{value:.{digits}f}"


def numbers(values: Iterable[float]) -> str:
    """Numbers beside each other, in columns of one width."""
    return "  ".join(f"{number(float(value)):>10}" for value in values)


def small(value: float, unit: str) -> str:
    """An error with its unit."""
    return f"{value:.2e} {unit}"
