"""Results as tables, for people."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

PIPE_WIDTH = 160  # columns of a table that is not shown in a terminal, so that nothing is cut


def console(*, stderr: bool = False) -> Console:
    """Where tables go; wide enough for them when it is a file or a pipe."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    return Console(file=stream, width=None if stream.isatty() else PIPE_WIDTH, highlight=False, soft_wrap=False)


def printable(text: str) -> str:
    """A text whose control characters are escaped: names in files may hold some, and a terminal obeys them."""
    return "".join(char if char.isprintable() or char == "\n" else ascii(char)[1:-1] for char in text)


def say(screen: Console, text: str) -> None:
    """Print a text as it is, without markup."""
    screen.print(printable(text), markup=False)


def table(title: str | None, columns: Sequence[str], rows: Iterable[Sequence[str]], *, text: int = 1) -> Table:
    """A table whose first `text` columns are text and whose others are numbers."""
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    made = Table(
        title=title and escape(printable(title)), box=box.SIMPLE_HEAD, title_justify="left", title_style="bold"
    )
    for index, column in enumerate(columns):
        made.add_column(escape(printable(column)), justify="left" if index < text else "right", overflow="fold")
    for row in rows:
        made.add_row(*(escape(printable(cell)) for cell in row))
    return made


def facts(rows: Iterable[tuple[str, str]], title: str | None = None) -> Table:
    """A table of names and what they are."""
    made = table(title, ("", ""), rows, text=2)
    made.show_header = False
    return made


def number(value: float, digits: int = 6, *, missing: str = "unlimited") -> str:
    """A number for a table; an infinite one is said in words."""
    return missing if math.isinf(value) else f"{value:.{digits}f}"


def small(value: float, unit: str) -> str:
    """An error with its unit."""
    return f"{value:.2e} {unit}"
