"""Results as tables for people or as JSON for programs, and a progress bar."""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import shutil
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import Enum

import click

from jacokin import model
from jacokin.cli import process
from jacokin.cli.units import Units

COLUMNS = 80  # of a terminal that does not say how many it has
GAP = 3  # columns between columns
PERIOD = 0.1  # [s] between two states of a progress bar
LINE_PERIOD = 10.0  # [s] between two lines where there is no terminal
LOOK_PERIOD = 0.5  # [s] between two looks whether that has passed
CLEAR = "\r\x1b[K"  # back to the start of the line, and erase it


def say(text: str) -> None:
    """Print a text, its control characters escaped."""
    echo(printable(text))


def echo(text: str) -> None:
    """Print a text. Who reads it may have closed the pipe, as `head` does: the command goes on without it."""
    try:
        click.echo(text)
    except BrokenPipeError:
        process.drop_output()


def printable(text: str) -> str:
    """A text whose control characters are escaped: names in files may hold some, and a terminal obeys them."""
    return "".join(char if char.isprintable() or char == "\n" else ascii(char)[1:-1] for char in text)


def show_table(title: str | None, columns: Sequence[str], rows: Iterable[Sequence[str]], *, text: int = 1) -> None:
    """Print a table whose first `text` columns are text, broken where it is too wide, and whose others are numbers."""
    lines = [columns, *rows]
    widths = _widths(lines, text)
    dash = "─" if (sys.stdout.encoding or "").lower().startswith("utf") else "-"
    rule = " " + dash * (sum(widths) + GAP * (len(widths) - 1) + 2)
    head = _row(lines[0], widths, text)
    body = [line for row in lines[1:] for line in _row(row, widths, text)]
    say("\n".join([*([] if title is None else [title]), "", *head, rule, *body, ""]))


def show_facts(rows: Iterable[tuple[str, str]], title: str | None = None) -> None:
    """Print names and what they are."""
    lines = list(rows)
    widths = _widths(lines, 2)
    body = [line for row in lines for line in _row(row, widths, 2)]
    say("\n".join([*([] if title is None else [title, ""]), *body, ""]))


def _widths(lines: Sequence[Sequence[str]], text: int) -> list[int]:
    """Width of each column; the widest text gives way where all do not fit."""
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    # What is not shown in a terminal is so wide that little is broken.
    space = shutil.get_terminal_size().columns if sys.stdout.isatty() else 160
    excess = 3 + sum(widths) + GAP * (len(widths) - 1) - space
    while excess > 0:
        widest = max(range(text), key=widths.__getitem__)
        cut = min(excess, widths[widest] - 16)  # columns that text is broken into at least
        if cut <= 0:
            break
        widths[widest] -= cut
        excess -= cut
    return widths


def _row(cells: Sequence[str], widths: Sequence[int], text: int) -> list[str]:
    """The lines of a row."""
    broken = [textwrap.wrap(cell, width) or [""] for cell, width in zip(cells, widths, strict=True)]
    lines = []
    for parts in itertools.zip_longest(*broken, fillvalue=""):
        texts = [part.ljust(width) for part, width in zip(parts[:text], widths, strict=False)]
        numbers = [part.rjust(width) for part, width in zip(parts[text:], widths[text:], strict=True)]
        lines.append(f"  {(' ' * GAP).join([*texts, *numbers])}".rstrip())
    return lines


def number(value: float, digits: int = 6, *, missing: str = "unlimited") -> str:
    """A number for a table; an infinite one is said in words."""
    return missing if math.isinf(value) else f"{value:.{digits}f}"


def numbers(values: Iterable[float]) -> str:
    """Numbers beside each other, in columns of one width."""
    return "  ".join(f"{number(float(value)):>10}" for value in values)


def small(value: float, unit: str) -> str:
    """An error with its unit."""
    return f"{value:.2e} {unit}"


def print_json(document: Mapping[str, object]) -> None:
    """Print one JSON document; floats as the shortest text that reads back the same, infinite ones as null."""
    echo(json.dumps(plain(document), indent=2, allow_nan=False))


def identity(robot: model.Robot) -> dict[str, object]:
    """The entries of a document that say which robot it is, and the file of its calibration if it has one."""
    return {
        "robot": robot.name,
        **({} if robot.calibration is None else {"calibration": str(robot.calibration.path)}),
    }


def head(robot: model.Robot, units: Units, frame: str | None = None) -> dict[str, object]:
    """The first entries of a document about joint values."""
    return {
        **identity(robot),
        **({} if frame is None else {"frame": frame}),
        "joint_names": robot.joint_names,
        "angle_unit": units.angle,
        "joint_units": units.for_joints(robot).names,
    }


def plain(value: object) -> object:
    """A value in the types of JSON."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # numpy arrays and numpy numbers
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


@contextlib.contextmanager
def progress_bar(title: str) -> Iterator[Callable[[int, int | None], None]]:
    """Show progress on stderr, through a function that takes the counts done and in all, None where that is unknown.

    A terminal gets one line that changes, cut where it ends; a file, a pipe or a terminal without control characters
    (TERM=dumb) gets a line now and then. Where nothing is said for long, as
    in the midst of a slow step, it says how long it has worked.
    """
    on_terminal = sys.stderr.isatty() and os.environ.get("TERM") != "dumb"
    before, after, period = (CLEAR, "", PERIOD) if on_terminal else ("jacokin: ", "\n", LINE_PERIOD)
    began = time.monotonic()
    shown = began - period if on_terminal else began
    first: tuple[float, int] | None = None  # when, and what had been done
    latest, ended = title, threading.Event()

    def write(text: str, now: float) -> None:
        nonlocal shown
        shown = now
        fitting = text[: _columns() - 1] if on_terminal else text  # of a line that is broken, the end only is erased
        sys.stderr.write(f"{before}{fitting}{after}")
        sys.stderr.flush()

    def show(done: int, total: int | None) -> None:
        nonlocal first, latest
        now = time.monotonic()
        first = first or (now, done)
        latest = f"{title} {done}"
        if total is not None:
            latest += f" of {total} ({100.0 * done / max(total, 1):.0f} %)"
        if now - shown > period:
            text, rate = latest, (done - first[1]) / max(now - first[0], PERIOD)
            if rate > 0.0:
                text += f", {rate:.0f}/s"
                if total is not None:
                    text += f", {format_duration((total - done) / rate)} left"
            write(text, now)

    def keep_telling() -> None:
        while not ended.wait(LOOK_PERIOD):
            now = time.monotonic()
            if now - shown > LINE_PERIOD:
                write(f"{latest}, {format_duration(now - began)} so far", now)

    teller = threading.Thread(target=keep_telling, daemon=True)
    teller.start()
    try:
        yield show
    finally:
        ended.set()
        teller.join()
        if on_terminal:
            sys.stderr.write(CLEAR)
            sys.stderr.flush()


def _columns() -> int:
    """Columns of the terminal that stderr is."""
    with contextlib.suppress(OSError, ValueError):
        return os.get_terminal_size(sys.stderr.fileno()).columns or COLUMNS
    return COLUMNS


def format_duration(seconds: float) -> str:
    """A duration [s] in the unit that suits it."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 6000.0 else f"{seconds / 3600.0:.1f} h"
