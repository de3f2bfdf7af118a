"""How complete and how exact the closed form is: every branch of many targets, judged by Pinocchio.

python -m benchmarks.completeness [--share 10]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import jacokin
from benchmarks import brute_force, environments, report, targets
from benchmarks.referee import apart, rotation_angle
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.model.descriptions import bundled

SAME_CONFIGURATION = 1e-4  # [rad] on the circle: the generating configuration counts as found
REGULAR = 1e-4  # smallest singular value above which a configuration must be found, always
# Random targets, vertical targets each way, and how many of those are compared with brute force.
FIRST_COUNTS = (100_000, 10_000, 50)
COUNTS = (20_000, 2_000, 10)


@dataclass(frozen=True, slots=True)
class Completeness:
    """Figures of one robot and kind of target."""

    robot: str
    targets: str
    count: int
    found: int
    """Targets whose generating configuration is among the branches; of those without a curve."""
    curves: int
    """Targets with a curve of solutions, which the branches stand for but cannot list."""
    regular_lost: int
    """Targets not found although their smallest singular value exceeds 1e-4."""
    solved: int
    """Targets `solve` succeeds on."""
    outside: int
    """Successes of `solve` outside a limit, at tolerance 0."""
    branches: float
    """Mean number of branches."""
    closure: float
    """Worst closure of a branch [m or rad]."""
    tight: float
    """Share of branches that close to 1e-10."""
    duplicates: int
    """Pairs of branches nearer than 1e-6 rad."""
    seconds: float


def measure(robot: Robot, wanted: targets.Targets) -> Completeness:
    """Solve every target and judge every branch."""
    solver = jacokin.IKSolver(robot, collision="ignore")
    curves = found = regular_lost = solved = outside = duplicates = tight = total = 0
    closure = 0.0
    begin = time.perf_counter()
    for pose, q in zip(wanted.poses, wanted.generating, strict=True):
        branches = solver.solve_all(pose)
        total += len(branches)
        if len(branches):
            errors = _closures(robot, branches.q, pose)
            closure = max(closure, float(errors.max()))
            tight += int((errors <= 1e-10).sum())  # [m] and [rad] for 99.9 % of them
            # Two branches nearer than 1e-6 rad are one.
            duplicates += int((apart(branches.q[:, None], branches.q) < 1e-6).sum() - len(branches)) // 2
        if not branches.complete:
            curves += 1
        elif len(branches) and apart(branches.q, q).min() <= SAME_CONFIGURATION:
            found += 1
        else:
            regular_lost += bool(robot.singular_values(q)[-1] > REGULAR)
        result = solver.solve(pose)
        solved += result.success
        outside += result.success and not robot.within_limits(result.q)
    return Completeness(
        robot=robot.name,
        targets=wanted.name,
        count=len(wanted.poses),
        found=found,
        curves=curves,
        regular_lost=regular_lost,
        solved=solved,
        outside=outside,
        branches=total / len(wanted.poses),
        closure=closure,
        tight=tight / max(total, 1),
        duplicates=duplicates,
        seconds=time.perf_counter() - begin,
    )


def dm_control_arm() -> Path | None:
    """dm_control's own MJCF of the arm, from this interpreter or the peers' environment; None when not installed."""
    inside = Path("third_party") / "kinova" / "jaco_arm.xml"
    spec = find_spec("dm_control")
    if spec is not None and spec.origin is not None:
        return Path(spec.origin).parent / inside
    return next(iter(environments.FOLDER.glob(f"*/lib/python*/site-packages/dm_control/{inside}")), None)


def section(share: int = 1) -> report.Section:
    """The part of the page on completeness, with one in `share` of the targets."""
    robots: list[Robot] = [robot for robot in map(jacokin.load_robot, bundled.NAMES) if robot.dof == 6]
    notes = []
    path = dm_control_arm()
    if path is not None:
        robots.append(jacokin.load_robot(path))
    else:
        notes.append("dm_control's MJCF was not measured: dm_control is not installed.")
    rows, brute_rows = [], []
    for index, robot in enumerate(robots):
        rng = np.random.default_rng(100 + index)
        count, vertical, brute = (max(value // share, 1) for value in (COUNTS if index else FIRST_COUNTS))
        sets = [targets.random_configurations(robot, rng, count)]
        sets += [targets.vertical_tool(robot, rng, vertical, up=up) for up in (False, True)]
        for wanted in sets:
            rows.append(_row(measure(robot, wanted)))
            print(" ".join(rows[-1]), flush=True)
        for wanted in sets[1:]:
            sample = targets.Targets(wanted.name, wanted.poses[:brute], wanted.generating[:brute])
            brute_rows.append(brute_force.row(brute_force.compare(robot, sample, rng)))
            print(" ".join(brute_rows[-1]), flush=True)
    parts = [INTRODUCTION, report.condensed(HEADER, rows, PROMISED), *notes]
    parts += [brute_force.INTRODUCTION, report.condensed(brute_force.HEADER, brute_rows, brute_force.PROMISED)]
    return report.Section("Completeness and accuracy of `solve_all`", "\n\n".join(parts))


INTRODUCTION = """Poses of random configurations within the limits, and poses with the tool vertical (where branches
are easily lost). *Curves*: poses with infinitely many solutions (spherical wrist, axes 4 and 6 aligned), of which
`solve_all` gives some. *Found*, of the others: the configuration the pose was made from is among the branches, to 1e-4
rad. *Lost where regular*: not found although the smallest singular value of the Jacobian there exceeds 1e-4.
*Residual*: the worst of a branch [m or rad], by Pinocchio; *tight*: the share of branches below 1e-10. *Duplicates*:
pairs of branches nearer than 1e-6 rad. *Solved*, *outside limits*: what `solve` answers to the same poses. `jaco_arm`
is dm_control's own MJCF."""

HEADER = (
    "robot",
    "targets",
    "number",
    "curves",
    "found",
    "lost where regular",
    "solved",
    "outside limits",
    "branches",
    "residual",
    "tight",
    "duplicates",
)
PROMISED = ("lost where regular", "solved", "outside limits", "duplicates")


def _row(measured: Completeness) -> tuple[str, ...]:
    return (
        measured.robot,
        measured.targets,
        f"{measured.count:,}",
        str(measured.curves),
        report.percent(measured.found / max(measured.count - measured.curves, 1)),
        str(measured.regular_lost),
        report.percent(measured.solved / measured.count),
        str(measured.outside),
        f"{measured.branches:.2f}",
        report.number(measured.closure),
        report.percent(measured.tight),
        str(measured.duplicates),
    )


def _closures(robot: Robot, q: Array, pose: Array) -> Array:
    """The larger of position [m] and orientation [rad] error of each branch."""
    reached = np.array([robot.forward_kinematics(row).homogeneous for row in q])
    position = np.linalg.norm(reached[:, :3, 3] - pose[:3, 3], axis=1)
    return np.asarray(np.maximum(position, rotation_angle(reached[:, :3, :3], pose[:3, :3])))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--share", type=int, default=1, help="one in so many of the targets")
    print(section(parser.parse_args().share).body)


if __name__ == "__main__":
    main()
