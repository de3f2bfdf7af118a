"""The benchmark: everything docs/performance.md shows, in one command. Read this file first.

    python -m benchmarks.run                          all of it, about twenty minutes; writes docs/performance.md
    python -m benchmarks.run --only peers --targets poses.csv --peers solve_all ssik rtb

The peers are installed into .venv-bench on the first run. One that cannot be installed or run is in the table with the
reason. Modules of this folder that print their figures, such as `bridge` or `viewer`, are run from here too.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

import jacokin
from benchmarks import (
    comparison,
    completeness,
    costs,
    environments,
    pose_files,
    qp_success,
    reachability,
    report,
    solution_sets,
    targets,
)
from jacokin import Robot
from jacokin.errors import JacokinError


@dataclass(frozen=True, slots=True)
class Printing:
    """A module that prints its figures when run."""

    title: str
    """Of its part of the page."""
    arguments: tuple[str, ...] = ()
    quick: tuple[str, ...] = ()
    """Arguments in their place for a quick run."""
    picture: str = ""
    """File in docs/images that it draws when given `--picture`."""


PRINTING = {
    "bridge": Printing("The MuJoCo bridge beside dm_control"),
    "tracker": Printing("One tick of the tracker"),
    "library": Printing("The compiled kernels, and the first answer", quick=("--quick",)),
    "c_calls": Printing("The C library beside Python", quick=("--quick",)),
    "six_joints": Printing("Arms of any structure", quick=("--quick",)),
    "latency": Printing("Single calls, the slowest included", picture="latency.png"),
    "closest": Printing("The closest configuration", ("--count", "30"), ("--count", "3")),
    "planning": Printing("Planned paths"),
    "motion": Printing("Free motions", ("--problems", "30", "--step", "0.02"), ("--problems", "3", "--step", "0.02")),
    "tasks": Printing("Environments beside bare MuJoCo", quick=("reach_site",)),
    "viewer": Printing("A move in the viewer", quick=("--moves", "50")),
}
SECTIONS = ("peers", "costs", "files", "reachability", "completeness", "sets", "qp", *PRINTING)
PRINTING_TIMEOUT = 600.0  # [s]

PEERS_INTRODUCTION = f"""Every solver gets the same poses, in rounds in which they take turns, one process at a time.
Pinocchio on `urdf/j2n6s300.urdf` measures every answer. Each has the arm from that URDF (mink: from
`urdf/jaco_arm.xml`), but dm_control and ssik bring their own, whose angles are rounded; how far they are off is shown,
and added to their tolerance. All start from home, ssik without a start. Times are of the call from Python alone.

*Solved*: an answer within the limits, {comparison.POSITION_TOLERANCE:g} m and
{comparison.ORIENTATION_TOLERANCE:g} rad. *In limits*: share of answers within the limits, at tolerance 0. *Position*,
*orientation*: the worst error of all answers. *Branches*: mean number of answers within the limits. *Found*: the
configuration the pose was made from is among them. *p99 CPU*: processor time of all threads, without other work on the
machine. *Ratio*: of the median to that of the first solver."""

HEADER = (
    "solver",
    "solved",
    "in limits",
    "position",
    "orientation",
    "branches",
    "found",
    "median",
    "p99",
    "p99 CPU",
    "ratio",
)
PROMISED = ("in limits",)


def peers_section(robot: Robot, sets: Sequence[targets.Targets], names: Sequence[str], rounds: int) -> report.Section:
    """The comparison, as a table for each set of targets."""
    peers = [peer for peer in environments.PEERS if peer.name in names]
    contestants = comparison.run(robot, peers, sets, rounds)
    referee = comparison.make_referee(robot)
    parts = [PEERS_INTRODUCTION]
    for wanted in sets:
        rows = []
        first = 0.0  # median of the first solver [s]
        for contestant in contestants:
            if contestant.failure:
                rows.append((contestant.peer.title, "not measured", *("-" for _ in HEADER[2:])))
                continue
            score = comparison.score(contestant, wanted, rounds, referee)
            first = first or score.median
            rows.append((*_score_row(contestant.peer, score), f"{score.median / first:.1f}"))
        parts += [f"{len(wanted.poses):,} poses, {wanted.name}:", report.condensed(HEADER, rows, PROMISED)]
    alike: dict[tuple[str, str], list[str]] = {}
    for contestant in contestants:
        title, *cells = _version_row(contestant)
        alike.setdefault((cells[0], cells[1]), []).append(title)
    rows = [(", ".join(titles), *cells) for cells, titles in alike.items()]
    parts.append(report.table(("solver", "versions", "description off by"), rows))
    parts += [f"{c.peer.title} was not measured: {c.failure}" for c in contestants if c.failure]
    return report.Section("Beside its peers", "\n\n".join(parts))


def _score_row(peer: environments.Peer, score: comparison.Score) -> tuple[str, ...]:
    return (
        peer.title,
        report.percent(score.solved),
        report.percent(score.within_limits),
        report.number(score.position, "m"),
        report.number(score.orientation, "rad"),
        f"{score.branches:.2f}" if peer.all_branches else "one",
        report.percent(score.found),
        report.seconds(score.median),
        report.seconds(score.p99),
        report.seconds(score.processor_p99),
    )


def _version_row(contestant: comparison.Contestant) -> tuple[str, str, str]:
    position, orientation = contestant.offset
    same = max(contestant.offset) < comparison.SAME_SOURCE
    off = "-" if same or contestant.failure else f"{position:.2g} m, {orientation:.2g} rad"
    return contestant.peer.title, contestant.version or "-", off


def printed_section(name: str, *, quick: bool = False, pictures: bool = False) -> report.Section:
    """What `python -m benchmarks.NAME` prints, as it is; with pictures, what it draws is written to docs/images."""
    printing = PRINTING[name]
    if not (Path(__file__).parent / f"{name}.py").is_file():
        return report.Section(printing.title, "Not measured: this part is not there.", failed=True)
    command = [sys.executable, "-m", f"benchmarks.{name}", *(printing.quick if quick else printing.arguments)]
    drawn = pictures and printing.picture != ""
    if drawn:
        command += ["--picture", str(report.PAGE.parent / "images" / printing.picture)]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=PRINTING_TIMEOUT, cwd=environments.ROOT, check=False
        )
    except subprocess.TimeoutExpired:
        return report.Section(printing.title, f"Not measured: no result within {PRINTING_TIMEOUT:.0f} s.", failed=True)
    if done.returncode and not done.stdout.strip():
        reason = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return report.Section(printing.title, f"Not measured: {reason}", failed=True)
    body = f"```text\n{done.stdout.rstrip()}\n```"
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or ["a bound of this benchmark was missed"])[-1]
        body += f"\n\nIt ended with code {done.returncode}: {reason}"
    if drawn:
        body += f"\n\n![Histograms of the durations](images/{printing.picture})"
    return report.Section(printing.title, body, failed=done.returncode != 0)


def measured(title: str, measure: Callable[[], report.Section]) -> report.Section:
    """A section; where it cannot be measured, the reason."""
    print(f"\n== {title}", flush=True)
    try:
        return measure()
    except Exception as error:  # one part that fails must not cost the others
        return report.Section(title, f"Not measured: {type(error).__name__}: {error}", failed=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is asked for; 1 when a part could not be measured."""
    names = [peer.name for peer in environments.PEERS]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=SECTIONS, default=list(SECTIONS), help="parts to run")
    parser.add_argument("--peers", nargs="+", choices=names, default=names, help="solvers to compare")
    parser.add_argument("--targets", type=Path, help="CSV of poses for the peers: x, y, z, qw, qx, qy, qz")
    parser.add_argument("--quick", action="store_true", help="a tenth of the targets everywhere")
    parser.add_argument("--count", type=int, default=1000, help="random poses for the peers; a fifth is tool-down")
    parser.add_argument("--rounds", type=int, default=10, help="rounds in which the peers take turns")
    parser.add_argument("--output", type=Path, help="page to write; the default run writes docs/performance.md")
    options = parser.parse_args(arguments)

    share = 10 if options.quick else 1
    lines = report.machine()
    print(lines)
    robot = jacokin.load_robot()
    rng = np.random.default_rng(1)
    if options.targets:
        try:
            sets = [targets.from_csv(options.targets)]
        except JacokinError as error:
            parser.error(f"--targets: {error}")
    else:
        count = max(options.count // share, options.rounds)
        sets = [
            targets.random_configurations(robot, rng, count),
            targets.vertical_tool(robot, rng, max(count // 5, options.rounds)),
            targets.structured(robot, rng, max(count // 5, options.rounds)),
        ]
    measure: dict[str, Callable[[], report.Section]] = {
        "peers": lambda: peers_section(robot, sets, options.peers, options.rounds),
        "costs": lambda: costs.section(robot),
        "files": lambda: pose_files.section(robot),
        "reachability": lambda: reachability.section(share),
        "completeness": lambda: completeness.section(share),
        "sets": lambda: solution_sets.section(300 // share),
        "qp": lambda: qp_success.section(
            robot, [targets.random_configurations(robot, rng, 300 // share)], qp_success.QP_SOLVERS
        ),
    }
    everything = options.only == list(SECTIONS) and options.peers == names and not (options.targets or options.quick)
    measure |= {name: partial(printed_section, name, quick=options.quick, pictures=everything) for name in PRINTING}
    sections = [measured(name, measure[name]) for name in SECTIONS if name in options.only]
    text = report.page(lines, sections)
    print("\n" + text)
    output = options.output or (report.PAGE if everything else None)
    if output is not None:
        output.write_text(text, encoding="utf-8")
        print(f"written: {output}")
    return int(any(section.failed for section in sections))


if __name__ == "__main__":
    sys.exit(main())
