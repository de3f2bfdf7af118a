"""Markdown tables, the machine, and the page docs/performance.md."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from benchmarks.environments import ROOT

PAGE = ROOT / "docs" / "performance.md"
STACK = ("numpy", "pin", "mujoco", "mink", "qpsolvers", "daqp")
# Load average of the minute before, a core: more than this and other work was running.
BUSY = 0.25

HEAD = """# Performance

Written by `python -m benchmarks.run`; do not edit. Each figure is of one run on the machine below. Ratios between
rows carry over to other machines, absolute times do not. All calls are from Python, but for the C library's.

**Others are ahead** in some rows, by figures of November 2026 on a machine about as quick as this one: VAMP finds
paths, untimed, in [0.6 of the time of a motion](planning_comparison.md); EAIK and ik-geo, 4.5 to 5.4 us for all
branches of a UR5, are about as quick; jaik gives 800,000 of them a second on a core, unchecked; cartan finds one answer
of a Panda or a Gen3 in 40 to 50 us, for 99 % of poses; a tick of placo within limits takes 5 us, a profile of Ruckig
with limits of jerk 14 us, a pose of bare Pinocchio half of `forward_kinematics`.

**With your own poses**, from a clone: `python -m benchmarks.run --only peers --targets poses.csv`, with the columns x,
y, z [m], qw, qx, qy, qz. `--peers solve_all solve rtb` takes some of the solvers, `--quick` a tenth of the random
poses, `--only costs qp` some of the parts; only a complete run writes this page.

**Poses that cannot be reached take longer**: some milliseconds for the closest configuration, unless
`closest=False`. The peers search until their restarts are used up; so the targets here are reachable.
"""


@dataclass(frozen=True, slots=True)
class Section:
    """One part of the page."""

    title: str
    body: str
    """Markdown."""
    failed: bool = False
    """True when it could not be measured; the body says why."""


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table with aligned columns: the first to the left, the others to the right."""
    widths = [max(len(row[i]) for row in [header, *rows]) for i in range(len(header))]
    rule = ["-" * width if not i else "-" * (width - 1) + ":" for i, width in enumerate(widths)]
    lines = [header, rule, *rows]
    padded = [[row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])] for row in lines]
    return "\n".join("| " + " | ".join(row) + " |" for row in padded)


def condensed(header: Sequence[str], rows: Sequence[Sequence[str]], promised: Sequence[str]) -> str:
    """A table; a sentence before it has those of the promised columns that are the same in all rows."""
    same = [
        column for column, name in enumerate(header) if name in promised and len({row[column] for row in rows}) == 1
    ]
    kept = [column for column in range(len(header)) if column not in same]
    whole = table([header[column] for column in kept], [[row[column] for column in kept] for row in rows])
    if not same:
        return whole
    return f"In every row: {', '.join(f'{header[column]} {rows[0][column]}' for column in same)}.\n\n{whole}"


def seconds(value: float) -> str:
    """A time in the unit that fits."""
    if value < 1e-3:
        return f"{value * 1e6:.3g} us"
    return f"{value * 1e3:.3g} ms" if value < 1.0 else f"{value:.3g} s"


def percent(value: float | None) -> str:
    """A share; 100 % only when it is all, and enough digits to see one in a hundred thousand."""
    if value is None:
        return "-"
    if value in (0.0, 1.0):
        return f"{value:.0%}".replace("%", " %")
    text = f"{100.0 * value:.2f}"
    return f"{text} %" if text != "100.00" else f"{100.0 * value:.4f} %"


def number(value: float | None, unit: str = "") -> str:
    """Two significant digits."""
    return "-" if value is None else f"{value:.2g} {unit}".strip()


def machine() -> str:
    """Processor, cores, system, versions, and whether something else was running."""
    cores = os.cpu_count() or 1
    lines = [
        f"- Processor: {_cpu_model()}, {cores} cores",
        f"- System: {platform.system()} {platform.machine()}, Python {platform.python_version()}",
        "- " + ", ".join(f"{name} {_version(name)}" for name in STACK),
    ]
    if os.getloadavg()[0] > BUSY * cores:
        lines.append(
            "- Other work was running on the machine when the run began: expect times 10 to 50 % too long, and 99 % "
            "quantiles more"
        )
    return "\n".join(lines)


def page(machine_lines: str, sections: Sequence[Section]) -> str:
    """The whole document."""
    parts = [HEAD, machine_lines + "\n"]
    parts += [f"## {section.title}\n\n{section.body.strip()}\n" for section in sections]
    return "\n".join(parts)


def _cpu_model() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
