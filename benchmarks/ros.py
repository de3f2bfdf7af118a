"""Random motions through real nodes: a twin of the driver, and `jacokin run`'s loop or the sender, as processes.

Motions without contact follow each other on one twin, each from where the arm stands, so that a motion takes hardly
longer than the arm moves. What is said to be the end is compared with what the twin publishes once the arm stands, and
the twin's own record says whether a limit was broken. It takes ROS, see `.ci/run`.
Run from the repository: ``python -m benchmarks.ros --ros 1 2 --way run send``.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import jacokin
from jacokin.arrays import Array
from jacokin.ik import Floor, Scene
from jacokin.model import Robot
from jacokin.motion import Trajectory, plan_motion
from jacokin.runner import PlannedMotion, ProcessLink, Runner, RunnerStatus, forwarder, run
from jacokin.twin import SimulatedArm
from tests.ros.nodes import Ros, ros1_with_master, ros2_of_wheels

FAULTS = "lag=0.02,loss=0.01,stall"
REACH = 0.8  # [rad] from the start of a motion to its end, joint by joint
CLEARANCE = 0.03  # [m]
THERE = 0.5  # [deg]
ELSEWHERE = "not there"  # what the sender says of a motion that it did not stop
REST, STANDING = 0.5, np.radians(0.05)  # [s] in which an arm that stands does not move so far [rad]
PATIENCE = 20.0  # [s]
LATE = 0.1  # [s] that a machine with time to spare never is
CONTROLLER = ("--states", "/joint_states", "--action", "/joint_trajectory_controller/follow_joint_trajectory")


class Played(NamedTuple):
    """How a motion ended."""

    away: float
    """From its end, as the twin publishes it [deg]."""
    said: float
    """From its end, as it is said [deg]; NaN where nothing is."""
    why: str
    """Why it was stopped, or that it ends elsewhere, which the sender says; empty where it is said to be there."""
    late: float
    """The longest that the machine let a thread wait meanwhile [s]."""


def standing(link: ProcessLink) -> Array:
    """Where the arm is (dof,) [rad], once it stands."""
    since, seen, begun = time.monotonic(), None, time.monotonic()
    while time.monotonic() - begun < PATIENCE:
        link.wait(time.monotonic() + 0.01)
        measured = link.hear()
        if measured is None:
            continue
        if seen is None or np.abs(measured.q - seen).max() > STANDING:
            since, seen = time.monotonic(), measured.q
        elif time.monotonic() - since > REST:
            return measured.q
    raise RuntimeError("the arm does not come to rest, or nothing says where it is")


def plan(robot: Robot, solver: jacokin.IKSolver, q: Array, rng: np.random.Generator) -> Trajectory:
    """A motion without contact from where the arm stands to somewhere near."""
    while True:
        end = np.clip(q + rng.uniform(-REACH, REACH, robot.dof), robot.lower + 0.02, robot.upper - 0.02)
        motion = plan_motion(solver, q, end, dt=0.01, rng=rng)
        if motion.success and motion.clearance.min() > 0.0:
            return motion


class Metronome:
    """How long a thread with nothing to do waits for the machine: what is late by more is no fault of the twin's."""

    def __init__(self) -> None:
        """Begin."""
        self._worst = 0.0
        threading.Thread(target=self._beat, daemon=True).start()

    def _beat(self) -> None:
        before = time.monotonic()
        while True:
            time.sleep(0.01)
            now = time.monotonic()
            self._worst, before = max(self._worst, now - before - 0.01), now

    def worst(self) -> float:
        """The longest pause since the last call [s]."""
        worst, self._worst = self._worst, 0.0
        return worst


def lead(robot: Robot, motion: Trajectory, link: ProcessLink) -> tuple[float, str]:
    """By the loop of `jacokin run`."""
    runner = Runner(robot, PlannedMotion.of(motion, robot))
    run(runner, link)
    why = f"{runner.status.name}: {runner.message}" if runner.status is not RunnerStatus.ARRIVED else ""
    return float(np.degrees(runner.away)), why


def send(ros: Ros, version: int, robot: Robot, motion: Trajectory, folder: Path) -> tuple[float, str]:
    """By the sender: velocities to ROS 1, a goal to ROS 2."""
    if version == 1:
        motion.save(folder / "m.kinova.csv")
        status, output, errors = ros.send(folder / "m.kinova.csv", "--ros", 1)
    else:
        motion.save(folder / "m.json", joint_prefix="j2n6s300_")
        names = [f"j2n6s300_{name}" for name, turns in zip(robot.joint_names, robot.unlimited, strict=True) if turns]
        status, output, errors = ros.send(folder / "m.json", "--ros", 2, *CONTROLLER, "--unlimited", *names)
    found = re.search(r"ends ([0-9.]+) deg", output + errors)  # in errors where it says that this is too far
    said = float(found[1]) if found else np.nan
    return said, errors.strip().splitlines()[-1] if status else ""


def play(ros: Ros, version: int, way: str, options: argparse.Namespace) -> tuple[list[Played], dict[str, Any]]:
    """Play motions one after the other; returns how they ended, and what the twin did."""
    fingers = float(SimulatedArm().finger_range[0])
    robot = jacokin.load_robot(finger_angle=fingers)  # open, as the arm's are
    solver = jacokin.IKSolver(robot, scene=Scene([Floor(0.0)]), clearance=CLEARANCE)
    rng = np.random.default_rng(options.seed)
    joints = [f"j2n6s300_{name}" for name in robot.joint_names]
    words = ["--ros", str(version), "--faults", options.faults, "--random-seed", str(options.seed)]
    for name, value in ros.environment.items():
        if name.startswith("ROS_"):
            os.environ[name] = value  # of the forwarder
    played: list[Played] = []
    metronome = Metronome()
    with contextlib.ExitStack() as stack:
        twin = stack.enter_context(ros.twin(*words))
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        link = ProcessLink([ros.python, str(forwarder.__file__), "--ros", str(version)], joints)
        stack.callback(link.close)
        for _ in range(options.motions):
            motion = plan(robot, solver, standing(link), rng)
            metronome.worst()
            said, why = lead(robot, motion, link) if way == "run" else send(ros, version, robot, motion, folder)
            late = metronome.worst()
            away = float(np.degrees(np.abs(standing(link) - motion.q[-1]).max()))
            played.append(Played(away, said, why, late))
            if options.verbose:
                print(f"{motion.duration:.2f} s {played[-1]}", file=sys.stderr, flush=True)
        _, record, _ = twin.ends()
    return played, record


def report(version: int, way: str, faults: str, played: list[Played], record: dict[str, Any]) -> None:
    """A row of the table; distances are those of motions that were not stopped."""
    ended = [each for each in played if not each.why or each.why.startswith(ELSEWHERE)]
    away = np.array([each.away for each in ended])
    there = sum(not each.why and each.away < THERE for each in ended)
    elsewhere = sum(bool(each.why) for each in ended)
    wrong = sum(not abs(each.said - each.away) < 0.2 for each in ended)
    broken = record["margin"] < 0.0 or record["speed"] > 1.02
    held = [each for each in played if each.late > LATE]
    print(
        f"| {version} | {way} | {faults or 'none'} | {len(played)} | {there} | {len(played) - len(ended)} | "
        f"{elsewhere} | {len(ended) - there - elsewhere} | {np.median(away):.2f} | {away.max():.2f} | {wrong} | "
        f"{'yes' if broken else 'no'} | {record['stalls']} | {record['late']} | {len(held)} | "
        f"{sum(bool(each.why) for each in held)} |",
        flush=True,
    )
    for why in sorted({re.sub(r"[0-9.]+", "N", each.why) for each in played if each.why}):
        print(f"  stopped: {why}", file=sys.stderr)


@contextlib.contextmanager
def installed(version: int) -> Iterator[Ros]:
    """A version of ROS."""
    if version == 1:
        with ros1_with_master() as (ros, _):
            yield ros
    else:
        yield ros2_of_wheels()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ros", type=int, nargs="+", choices=(1, 2), default=(1, 2))
    parser.add_argument("--way", nargs="+", choices=("run", "send"), default=("run", "send"))
    parser.add_argument("--motions", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--faults", default=FAULTS)
    parser.add_argument("--verbose", action="store_true", help="a line for each motion")
    options = parser.parse_args()
    head = (
        "ROS, way, faults, motions, there, stopped, elsewhere by exit code, neither, median [deg], largest [deg], "
        "said wrongly, limits broken"
    )
    columns = [*head.split(", "), "stalls", "ticks late", "machine late", "stopped then"]
    print("| " + " | ".join(columns) + " |\n" + "| --- " * len(columns) + "|", flush=True)
    for version in options.ros:
        for way in options.way:
            with installed(version) as ros:
                report(version, way, options.faults, *play(ros, version, way, options))


if __name__ == "__main__":
    main()
