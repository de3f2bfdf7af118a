"""Every URDF and MJCF below a folder: does it load, is its kinematics right, are its own poses found?

`python -m benchmarks.corpus FOLDER` prints a row for each file that loads, the sentences of those that do not, how many
there are of each, and a table with a line for each folder in FOLDER. Forward kinematics of the default
frame is compared with MuJoCo's on the description as jacokin read it, and with yourdfpy's, which reads the file itself.
Meshes are looked for by the solver that avoids contact, whose time says what they cost. Nothing is written.
"""

from __future__ import annotations

import argparse
import logging
import re
import time
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import jacokin
from jacokin import IKSolver, JacokinError, Robot
from jacokin.errors import ShapeError

SUFFIXES = (".urdf", ".xml", ".mjcf")
SAMPLES = 5  # configurations that kinematics is compared on
MOST_JOINTS = 8  # of an arm whose own poses are solved
CLOSE = 1e-6  # [rad] or [m] between a configuration and the answer to its pose
# What sentences say of files that are sound, and are not one arm.
OBJECT = ("this is an object, not an arm", "degrees of freedom; an arm needs")
SEVERAL = ("several chains start at the base", "the chain branches at joint")


@dataclass(frozen=True, slots=True)
class Row:
    """What became of one file."""

    file: str
    robot: Robot | None = None
    refused: str = ""
    """The sentence, without the path."""
    raw: str = ""
    """An exception that is not one of jacokin's."""
    load: float = 0.0
    """[s] without meshes."""
    mujoco: float = np.nan
    """[m] largest deviation from MuJoCo."""
    other: float = np.nan
    """[m] largest deviation from yourdfpy."""
    structure: str = ""
    found: int = 0
    """Own configurations that were found."""
    asked: int = 0
    solve: float = np.nan
    """[s] median."""
    solver: float = np.nan
    """[s] of the first solver after loading, which ignores contact."""
    shapes: float = np.nan
    """[s] more of the first one that avoids contact, and loads meshes for it; NaN where they cannot be loaded."""

    @property
    def package(self) -> str:
        """The folder in FOLDER that it is in."""
        return self.file.partition("/")[0]

    def is_refused_as(self, kind: tuple[str, ...]) -> bool:
        """Whether the sentence is one of some."""
        return any(words in self.refused for words in kind)


def look(path: Path, folder: Path, own: int) -> Row:
    """Load a file, and look at its kinematics and at `own` poses of its own."""
    file = str(path.relative_to(folder))
    began = time.perf_counter()
    try:
        robot = jacokin.load_robot(path)
        load = time.perf_counter() - began
        began = time.perf_counter()
        solver = IKSolver(robot, collision="ignore")
        ready = time.perf_counter() - began
        structure = jacokin.ik.structure(robot).name
        rng = np.random.default_rng(0)
        found, asked, solve = _own_answers(solver, own, rng)
        return Row(
            file,
            robot,
            "",
            "",
            load,
            _beside_mujoco(robot),
            _beside_yourdfpy(robot, path, rng),
            structure,
            found,
            asked,
            solve,
            ready,
            _time_of_shapes(robot),
        )
    except JacokinError as error:
        return Row(file, refused=str(error).replace(f"{path}: ", ""))
    except Exception as error:  # what this is for
        return Row(file, raw=repr(error))


def _time_of_shapes(robot: Robot) -> float:
    """Time of the first solver that avoids contact [s]; NaN where shapes cannot be loaded."""
    began = time.perf_counter()
    try:
        IKSolver(robot)
    except ShapeError:
        return np.nan
    return time.perf_counter() - began


def _beside_mujoco(robot: Robot) -> float:
    """Largest deviation of all frames [m] on some configurations within the limits."""
    report = jacokin.crosscheck(robot, samples=SAMPLES)
    return float(report.worst("position").value)


def _beside_yourdfpy(robot: Robot, path: Path, rng: np.random.Generator) -> float:
    """Largest deviation of the default frame [m]; NaN of an MJCF, and of files that yourdfpy cannot read."""
    import yourdfpy

    if robot.source.kind != "urdf":
        return np.nan
    try:
        other = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
        worst = 0.0
        for q in robot.sample(rng, SAMPLES):
            other.update_cfg(dict(zip(robot.joint_names, q.tolist(), strict=True)))
            place = other.get_transform(robot.default_frame, robot.base)[:3, 3]
            worst = max(worst, float(np.abs(place - robot.forward_kinematics(q).translation).max()))
    except Exception:  # whatever another reader stumbles over
        return np.nan
    return worst


def _own_answers(solver: IKSolver, count: int, rng: np.random.Generator) -> tuple[int, int, float]:
    """How many of some configurations are found from their own poses, how many were asked for, and the median time."""
    robot = solver.robot
    if robot.dof > MOST_JOINTS or not np.isfinite(np.where(robot.unlimited, 0.0, robot.upper - robot.lower)).all():
        return 0, 0, np.nan
    found, times = 0, list[float]()
    for q in robot.sample(rng, count):
        target = robot.forward_kinematics(q)
        began = time.perf_counter()
        result = solver.solve(target, seed=q)
        times.append(time.perf_counter() - began)
        found += result.success and float(np.abs(result.q - q).max()) < CLOSE
    return found, count, float(np.median(times)) if times else np.nan


def descriptions(folder: Path) -> list[Path]:
    """The files below a folder that are a URDF, or an MJCF that is not only a part of another."""
    found = []
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() not in SUFFIXES or not path.is_file():
            continue
        if path.suffix.lower() == ".urdf" or _root(path) in ("robot", "mujoco"):
            found.append(path)
    return found


def _root(path: Path) -> str:
    try:
        return str(next(iter(ET.iterparse(path, events=("start",))))[1].tag)
    except (ET.ParseError, OSError, StopIteration, ValueError):
        return ""


def kind_of(sentence: str) -> str:
    """A sentence without the names and numbers in it."""
    plain = re.sub(r"'[^']*'|\"[^\"]*\"", "X", sentence)
    return re.sub(r"\d[\d.e+-]*", "N", plain).partition(";")[0].partition("(")[0].partition("\n")[0][:90]


def print_rows(rows: Sequence[Row]) -> None:
    """The table, the sentences, and the counts."""
    columns = (
        f"{'joints':>6} {'last joint':24} {'frame':28} {'load':>8} {'MuJoCo':>8} {'yourdfpy':>8} own     structure"
    )
    print(f"{'file':60} {columns}")
    for row in rows:
        if row.robot is not None:
            last, frame = row.robot.joint_names[-1][-24:], row.robot.default_frame[-28:]
            print(
                f"{row.file[-60:]:60} {row.robot.dof:6} {last:24} {frame:28} {1e3 * row.load:5.1f} ms "
                f"{row.mujoco:8.0e} {row.other:8.0e} {row.found:3}/{row.asked:<3} {row.structure}"
            )
    for row in rows:
        if row.robot is None:
            print(f"{row.file[-60:]:60} {'RAW ' + row.raw if row.raw else 'refused: ' + row.refused[:240]}")
    loaded = [row for row in rows if row.robot is not None]
    print(f"\n{len(rows)} files: {len(loaded)} load, {sum(bool(row.raw) for row in rows)} raw exceptions; refused:")
    for kind, count in Counter(kind_of(row.refused) for row in rows if row.refused).most_common():
        print(f"{count:6}  {kind}")
    for kind in ("urdf", "mjcf"):
        times = [row.load for row in loaded if row.robot is not None and row.robot.source.kind == kind]
        if times:
            print(f"load of {len(times)} {kind} files: median {1e3 * np.median(times):.1f} ms")
    for what, deviations in (
        ("MuJoCo", [row.mujoco for row in loaded]),
        ("yourdfpy", [row.other for row in loaded if np.isfinite(row.other)]),
    ):
        if deviations:
            print(f"beside {what}, {len(deviations)} files: at most {max(deviations):.1e} m")
    print(f"own configurations: {sum(row.found for row in loaded)} of {sum(row.asked for row in loaded)} found")


def table(rows: Sequence[Row]) -> str:
    """Markdown: what became of the files of each package, and of all."""
    lines = [
        "| package | files | load | objects | several arms | other refusals | own poses found | deviation [m] | "
        "load [ms] | solver [ms] | with shapes [ms] |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    packages = sorted({row.package for row in rows})
    for name, chosen in [*((name, [row for row in rows if row.package == name]) for name in packages), ("all", rows)]:
        loaded = [row for row in chosen if row.robot is not None]
        objects = sum(row.is_refused_as(OBJECT) for row in chosen)
        several = sum(row.is_refused_as(SEVERAL) for row in chosen)
        worst = max((np.nanmax([row.mujoco, row.other]) for row in loaded), default=np.nan)
        times = [_median_ms([getattr(row, kind) for row in loaded]) for kind in ("load", "solver", "shapes")]
        lines.append(
            f"| {name} | {len(chosen)} | {len(loaded)} | {objects} | {several} | "
            f"{len(chosen) - len(loaded) - objects - several} | "
            f"{sum(row.found for row in loaded)} of {sum(row.asked for row in loaded)} | "
            f"{'' if not loaded else f'{worst:.0e}'} | {' | '.join(times)} |"
        )
    return "\n".join(lines)


def _median_ms(times: Sequence[float]) -> str:
    """The median of times [s] in ms, NaN aside."""
    known = [1e3 * each for each in times if np.isfinite(each)]
    return f"{np.median(known):.1f}" if known else ""


def main(arguments: Sequence[str] | None = None) -> None:
    """Look at every description below a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--own", type=int, default=5, help="poses of its own that each arm solves")
    options = parser.parse_args(arguments)
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)  # what other readers say of files
    try:
        rows = [look(path, options.folder, options.own) for path in descriptions(options.folder)]
    finally:
        logging.disable(before)
    print_rows(rows)
    print(f"\n{table(rows)}")


if __name__ == "__main__":
    main()
