"""Random motions through real nodes: a twin of the driver, and `jacokin run`'s loop or the sender, as processes.

Motions without contact follow each other on one twin, each from where the arm stands, so that a motion takes hardly
longer than the arm moves. What is said to be the end is compared with what the twin publishes once the arm stands, and
the twin's own record says whether a limit was broken. With ``--stop`` what leads them is killed, interrupted or made to
hang in the middle instead, and how long the arm moves on is measured. It takes ROS, see `.ci/run`.
Run from the repository: ``python -m benchmarks.ros --ros 1 2 --way run send`` and ``--stop kill interrupt hang``.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import signal
import subprocess
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
from tests.ros.nodes import Ros, Twin, ros1_with_master, ros2_of_wheels

FAULTS = "lag=0.02,loss=0.01,stall"
REACH = 0.8  # [rad] from the start of a motion to its end, joint by joint
CLEARANCE = 0.03  # [m]
THERE = 0.5  # [deg]
ELSEWHERE = "not there"  # what the sender says of a motion that it did not stop
REST, STANDING = 0.5, np.radians(0.05)  # [s] in which an arm that stands does not move so far [rad]
PATIENCE = 20.0  # [s]
LATE = 0.1  # [s] that a machine with time to spare never is
SIGNALS = {"kill": signal.SIGKILL, "interrupt": signal.SIGINT, "hang": signal.SIGSTOP}
QUICK, MOVES = 0.1, 0.02  # [rad/s] an arm that is in the middle of a motion, and one that does not stand
WITHIN = 0.2  # [s]
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
    status, output, errors = ros.send(*sender_words(version, robot, motion, folder))
    found = re.search(r"ends ([0-9.]+) deg", output + errors)  # in errors where it says that this is too far
    said = float(found[1]) if found else np.nan
    return said, errors.strip().splitlines()[-1] if status else ""


def sender_words(version: int, robot: Robot, motion: Trajectory, folder: Path) -> list[object]:
    """What the sender is told."""
    if version == 1:
        motion.save(folder / "m.kinova.csv")
        return [folder / "m.kinova.csv", "--ros", 1]
    motion.save(folder / "m.json", joint_prefix="j2n6s300_")
    names = [f"j2n6s300_{name}" for name, turns in zip(robot.joint_names, robot.unlimited, strict=True) if turns]
    return [folder / "m.json", "--ros", 2, *CONTROLLER, "--unlimited", *names]


@contextlib.contextmanager
def at_a_twin(ros: Ros, version: int, options: argparse.Namespace) -> Iterator[tuple[Twin, ProcessLink, Path]]:
    """A twin, the way to it, and a folder."""
    joints = [f"j2n6s300_{name}" for name in jacokin.load_robot().joint_names]
    words = ["--ros", str(version), "--faults", options.faults, "--random-seed", str(options.seed)]
    for name, value in ros.environment.items():
        if name.startswith("ROS_"):
            os.environ[name] = value  # of the forwarder
    with contextlib.ExitStack() as stack:
        if version == 1 and options.stop:  # the state 100 times a second
            period = "/j2n6s300_driver/status_interval_seconds"
            setting = f"import rosgraph; rosgraph.Master('/benchmark').setParam('{period}', 0.01)"
            subprocess.run([ros.python, "-c", setting], env=dict(ros.environment), check=True)
        twin = stack.enter_context(ros.twin(*words))
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        link = ProcessLink([ros.python, str(forwarder.__file__), "--ros", str(version)], joints)
        stack.callback(link.close)
        yield twin, link, folder


def arm() -> tuple[Robot, jacokin.IKSolver]:
    """The twin's arm, the fingers open, on a table."""
    robot = jacokin.load_robot(finger_angle=float(SimulatedArm().finger_range[0]))
    return robot, jacokin.IKSolver(robot, scene=Scene([Floor(0.0)]), clearance=CLEARANCE)


def play(ros: Ros, version: int, way: str, options: argparse.Namespace) -> tuple[list[Played], dict[str, Any]]:
    """Play motions one after the other; returns how they ended, and what the twin did."""
    robot, solver = arm()
    rng = np.random.default_rng(options.seed)
    played: list[Played] = []
    metronome = Metronome()
    with at_a_twin(ros, version, options) as (twin, link, folder):
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


def play_stops(ros: Ros, version: int, way: str, options: argparse.Namespace) -> list[Stopped]:
    """End motions in the middle, one after the other."""
    robot, solver = arm()
    rng = np.random.default_rng(options.seed)
    stopped: list[Stopped] = []
    metronome = Metronome()
    with at_a_twin(ros, version, options) as (_, link, folder):
        for count in range(options.motions):
            how = options.stop[count % len(options.stop)]
            motion = plan(robot, solver, standing(link), rng)
            process = start(ros, version, way, robot, motion, folder)
            metronome.worst()
            coasted, speed = stop(process, link, robot, how, rng.uniform(0.1, 0.7) * motion.duration)
            stopped.append(Stopped(how, coasted, speed, metronome.worst()))
            if options.verbose:
                print(stopped[-1], file=sys.stderr, flush=True)
    return stopped


class Stopped(NamedTuple):
    """How an arm came to rest."""

    how: str
    """What happened to the process that led it."""
    coasted: float
    """From then until the arm stood [s]."""
    speed: float
    """Of the quickest joint then, over its limit."""
    late: float
    """The longest that the machine let a thread wait meanwhile [s]."""


def start(ros: Ros, version: int, way: str, robot: Robot, motion: Trajectory, folder: Path) -> subprocess.Popen[str]:
    """The process that leads the arm."""
    if way == "run":
        motion.save(folder / "m.csv")
        words = ["run", str(folder / "m.csv"), "--ros", str(version), "--name", "j2n6s300", "--python", ros.python]
        return subprocess.Popen(
            [sys.executable, "-m", "jacokin", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
    return ros.sending(*sender_words(version, robot, motion, folder))


def stop(process: subprocess.Popen[str], link: ProcessLink, robot: Robot, how: str, wait: float) -> tuple[float, float]:
    """End a process in the middle of a motion; returns how long the arm moves on [s], and how fast it was."""
    speed, begun = np.zeros(robot.dof), time.monotonic()
    while np.abs(speed).max() < QUICK and time.monotonic() - begun < PATIENCE:
        link.wait(time.monotonic() + 2e-3)
        speed = velocity(link, speed)
    end = time.monotonic() + wait
    while time.monotonic() < end:
        link.wait(time.monotonic() + 2e-3)
        speed = velocity(link, speed)
    process.send_signal(SIGNALS[how])
    then, share = time.monotonic(), float((np.abs(speed) / robot.velocity_limit).max())
    moved = then
    while time.monotonic() - moved < REST:
        link.wait(time.monotonic() + 2e-3)
        measured = link.hear()
        if measured is not None and measured.v is not None and np.abs(measured.v).max() > MOVES:
            moved = time.monotonic()
    process.kill()
    process.communicate()
    return moved - then, share


def velocity(link: ProcessLink, before: Array) -> Array:
    """The newest velocities (dof,) [rad/s]."""
    measured = link.hear()
    return before if measured is None or measured.v is None else measured.v


def report_stops(version: int, way: str, stopped: list[Stopped]) -> None:
    """A row for each way in which a process ended."""
    for how in dict.fromkeys(each.how for each in stopped):
        those = [each for each in stopped if each.how == how]
        seconds = np.array([each.coasted for each in those])
        over = [each for each in those if each.coasted > WITHIN]
        held = sum(each.late > WITHIN / 4.0 for each in over)
        print(
            f"| {version} | {way} | {how} | {len(those)} | {np.median(seconds):.2f} | {seconds.max():.2f} | "
            f"{len(over)} | {sum(each.speed > 0.85 for each in over)} | {held} |",
            flush=True,
        )


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
    parser.add_argument(
        "--stop", nargs="+", choices=tuple(SIGNALS), default=(), help="end what leads the arm in the middle"
    )
    options = parser.parse_args()
    head = (
        "ROS, way, what happened, times, stands after [s] in the median, at most, over 0.2 s, of those at full speed, "
        "of those machine late"
        if options.stop
        else "ROS, way, faults, motions, there, stopped, elsewhere by exit code, neither, median [deg], largest [deg], "
        "said wrongly, limits broken, stalls, ticks late, machine late, stopped then"
    )
    columns = head.split(", ")
    print("| " + " | ".join(columns) + " |\n" + "| --- " * len(columns) + "|", flush=True)
    for version in options.ros:
        for way in options.way:
            with installed(version) as ros:
                if options.stop:
                    report_stops(version, way, play_stops(ros, version, way, options))
                else:
                    report(version, way, options.faults, *play(ros, version, way, options))


if __name__ == "__main__":
    main()
