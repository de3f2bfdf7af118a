"""Streams of a hand through teleoperation: what stops, what breaks a limit, what touches, how far the tool is off.

Beside, on the same streams: mink's differential IK in the loop that its users write, and ssik's tracker, which runs in
an environment of its own. Run from the repository: ``python -m benchmarks.teleop --streams 60``. With ``--output`` each
stream becomes a line of a file; a second run with it goes on where the first one ended.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import jacokin
from benchmarks import environments
from benchmarks.tracker import DT, MinkLoop
from benchmarks.worker import Worker
from jacokin import Robot, Tracker
from jacokin.ik import Floor, Scene
from jacokin.model import poses
from jacokin.motion import LimitDistance, Manipulability
from jacokin.teleop import HandOptions, Player, Stream, Teleop, TeleopStatus, make_stream
from jacokin.teleop.streams import KINDS

ACCELERATION = 4.0  # [rad/s^2]
CLEARANCE = 0.005  # [m]
END = 12.0  # [s] after the stream, in which a tool must be back
ARRIVED = 1e-3  # [m]
SLOW = 0.3  # [rad/s] no joint of the exact answer, nearest to the arm, is faster when the hand is slow
PATIENCE = 2.5  # periods of a slow hand until it counts as silent
FAR = 0.01  # [m] off its target, a tool may be asked for what is out of reach
BRANCH = 0.3  # [rad] an answer farther away is on another branch
EVERY = 5  # ticks, after which contact and the exact answer are looked at
ROUNDING = 1e-9  # [rad/s] a velocity may be over by
RATES = (10.0, 20.0, 60.0, 90.0, 200.0)  # [1/s] of the hands
FINE = 1000.0  # [1/s] of the motion that a hand's poses are samples of
SSIK = {"j2n6s300": "jaco2_ik", "j2s7s300": "j2s7s300_ik"}  # the arms that it ships, by the names of ours

Array = NDArray[np.float64]


class Played(NamedTuple):
    """What a loop made of a stream, tick by tick."""

    q: Array
    """(n, dof) commanded [rad]."""
    asked: list[pin.SE3 | None]
    """T_base_tool that the loop follows; None where it follows nothing."""
    seconds: Array
    """(n,) processor time of each tick [s]."""
    latency: Array
    """(n,) by how much the loop says that it lags behind the hand [s]."""


Loop = Callable[[Robot, list[Array | None], float], Played]


def ticks_of(stream: Stream) -> list[Array | None]:
    """What has been heard at each tick; the last pose is heard again and again in the end."""
    player = Player(stream)
    ticks = range(round((stream.time[-1] + END) / DT))
    return [stream.hand[-1] if player.ended else player.read(tick * DT) for tick in ticks]


def smoothed(robot: Robot, heard: list[Array | None], rate: float) -> Played:
    """Teleoperation, clear of the floor and of itself."""
    return ours(robot, heard, rate, "auto")


def unfiltered(robot: Robot, heard: list[Array | None], rate: float) -> Played:
    """The same with the steps of hands that are slower than the ticks."""
    return ours(robot, heard, rate, None)


def ours(robot: Robot, heard: list[Array | None], rate: float, smoothing: str | None) -> Played:
    """Teleoperation by a hand of some rate [1/s]."""
    tracker = Tracker(
        robot,
        dt=DT,
        scene=Scene([Floor(-0.01)]),
        clearance=CLEARANCE,
        acceleration_limit=ACCELERATION,
        objectives=(LimitDistance(), Manipulability()) if robot.dof > 6 else (),
    )
    teleop = Teleop(
        tracker, clutch=True, recover=0.5, filter=smoothing, hand=HandOptions(watchdog=max(0.1, PATIENCE / rate))
    )
    q, asked, seconds, latency = list[Array](), list[pin.SE3 | None](), list[float](), list[float]()
    for hand in heard:
        began = time.thread_time()
        step = teleop.step(hand)
        seconds.append(time.thread_time() - began)
        q.append(step.q)
        asked.append(step.target if step.status is TeleopStatus.FOLLOWING else None)
        latency.append(step.latency)
    return Played(np.array(q), asked, np.array(seconds), np.array(latency))


def targets_of(robot: Robot, heard: list[Array | None]) -> list[pin.SE3]:
    """The last pose that was one, at every tick: what a loop without teleoperation follows."""
    targets, target = list[pin.SE3](), robot.forward_kinematics(robot.home)
    for hand in heard:
        if hand is not None and np.isfinite(hand).all() and np.linalg.norm(hand[3:]) > 0.5:
            target = pin.SE3(poses.rotation_from_quat_wxyz(hand[3:]), hand[:3])
        targets.append(target)
    return targets


def bare_mink(robot: Robot, heard: list[Array | None], rate: float) -> Played:
    """The loop that mink's examples show: the last pose is the target, nothing guards it but its limits."""
    loop = MinkLoop(robot)
    targets = targets_of(robot, heard)
    q, seconds = list[Array](), list[float]()
    for target in targets:
        began = time.thread_time()
        loop.tick(target)
        seconds.append(time.thread_time() - began)
        q.append(loop.configuration.q.copy())
    return Played(np.array(q), list[pin.SE3 | None](targets), np.array(seconds), np.zeros(len(q)))


def ssik_loop(robot: Robot, worker: Worker) -> Loop:
    """The tracker of ssik, which knows speeds, and no accelerations and no shapes."""
    setup = {
        "variant": SSIK[robot.name],
        "dt": DT,
        "home": robot.home.tolist(),
        "velocity_limit": robot.velocity_limit.tolist(),
    }
    worker.start(setup)
    T_theirs_ours = np.linalg.inv(worker.forward(robot.home[np.newaxis])[0]) @ robot.forward_kinematics(robot.home)

    def play(robot: Robot, heard: list[Array | None], rate: float) -> Played:
        targets = targets_of(robot, heard)
        worker.start(setup)
        asked = np.array([target.homogeneous for target in targets]) @ np.linalg.inv(T_theirs_ours)
        answers, seconds = worker.solve(asked)
        q = np.concatenate(answers)
        free = robot.unlimited
        q[:, free] = np.unwrap(np.vstack([robot.home, q])[:, free], axis=0)[1:]
        return Played(q, list[pin.SE3 | None](targets), seconds[:, 1], np.zeros(len(q)))

    return play


def judge(robot: Robot, played: Played, acceleration: float | None, motion: Stream | None = None) -> dict[str, object]:
    """Limits at every tick, contact and errors at some of them, from outside; no acceleration limit for a peer.

    With the motion of the hand, of which the loop heard some poses, the errors to where the hand was, too: as long ago
    as the loop says that it lags, and at that time.
    """
    scene = Scene([Floor(-0.01)])
    contact = scene.contact(robot)
    solver = jacokin.IKSolver(robot, scene=scene, clearance=CLEARANCE, collision="reject")
    v = np.diff(played.q, axis=0, prepend=robot.home[np.newaxis]) / DT
    is_broken = not all(robot.within_limits(q) for q in played.q)
    # [rad/s] QP solvers of others have tolerances: mink's is over by 1e-4.
    rounding = 1e-3 if acceleration is None else ROUNDING
    is_broken |= bool((np.abs(v) > robot.velocity_limit + rounding).any())
    if acceleration is not None:
        change = np.diff(v, axis=0, prepend=np.zeros((1, robot.dof)))
        is_broken |= bool((np.abs(change) > acceleration * DT + ROUNDING).any())
    touched, errors, late, now, slow = False, list[float](), list[float](), list[float](), 0
    exact: Array | None = None
    for tick in range(0, len(played.q), EVERY):
        q, asked = played.q[tick], played.asked[tick]
        touched |= contact.touches(q)
        if asked is None or None in played.asked[max(tick - EVERY, 0) : tick]:
            slow, exact = 0, None
            continue
        is_far = _off(robot, q, asked) > FAR
        if is_far and not solver.solve_all(asked, seed=q).within_limits.any():
            slow, exact = 0, None  # quicker than the closest pose that `solve` looks for
            continue
        answer = solver.solve(asked, seed=q)
        near = answer.success and exact is not None and np.abs(answer.q - exact).max() < SLOW * DT * EVERY
        way = float((np.abs(answer.q - q) / robot.velocity_limit).max()) if answer.success else 0.0
        slow = slow + EVERY if near else -math.ceil(way / DT)
        exact = answer.q if answer.success else None
        # For so many ticks it must have been slow, beside those that the joints need to get there at full speed.
        if slow > 200 and np.abs(answer.q - q).max() < BRANCH:
            errors.append(_off(robot, q, asked))
            if motion is not None:
                tool = robot.forward_kinematics(q).translation
                for ago, found in ((float(played.latency[tick]), late), (0.0, now)):
                    row = round((tick * DT - ago) * FINE)
                    found.append(float(np.linalg.norm(tool - motion.hand[min(max(row, 0), len(motion) - 1), :3])))
    last = next((target for target in reversed(played.asked) if target is not None), None)
    is_off = last is None or _off(robot, played.q[-1], last) > ARRIVED
    return {
        # Tied to the hand anew after missing poses, the tool may be asked for what is out of reach.
        "stopped": is_off and (last is None or solver.solve(last, seed=played.q[-1]).success),
        "broken": is_broken,
        "touched": touched,
        "slow_ticks": len(errors),
        "slow_p99": float(np.percentile(errors, 99)) if errors else None,
        "slow_worst": max(errors) if errors else None,
        "hand_late_worst": max(late) if late else None,
        "hand_now_worst": max(now) if now else None,
        "latency": float(played.latency.max()),
        "tick_median": float(np.median(played.seconds)),
        "tick_p999": float(np.percentile(played.seconds, 99.9)),
    }


def _off(robot: Robot, q: Array, target: pin.SE3) -> float:
    return float(np.linalg.norm(robot.forward_kinematics(q).translation - target.translation))


def rows(path: Path | None) -> Iterator[dict[str, object]]:
    """What a file has of earlier runs."""
    if path is not None and path.exists():
        for line in path.read_text().splitlines():
            yield json.loads(line)


def show(found: list[dict[str, object]]) -> None:
    """Print a row for each kind of stream and loop; errors in mm at slow ticks, the worst of all streams."""
    names = "slow_p99", "slow_worst", "hand_late_worst", "hand_now_worst"
    heads = "streams", "stops", "limits", "contact", "p99", "worst", "hand late", "hand now", "lag ms", "us"
    print(f"{'robot':10}{'stream':14}{'loop':22}" + "".join(f"{head:>10}" for head in heads))
    groups = dict.fromkeys((row["robot"], row["kind"], row["loop"]) for row in found)
    for group in sorted(groups, key=str):
        those = [row for row in found if (row["robot"], row["kind"], row["loop"]) == group]
        robot, kind, loop = group
        counts = [len(those), *(sum(bool(row[name]) for row in those) for name in ("stopped", "broken", "touched"))]
        errors = [[float(str(row[name])) for row in those if row[name] is not None] for name in names]
        numbers = [f"{1e3 * max(values):10.3f}" if values else f"{'-':>10}" for values in errors]
        numbers.append(f"{1e3 * max(float(str(row['latency'])) for row in those):10.0f}")
        numbers.append(f"{1e6 * np.median([float(str(row['tick_median'])) for row in those]):10.0f}")
        print(f"{robot:10}{kind:14}{loop:22}" + "".join(f"{count:10}" for count in counts) + "".join(numbers))


def main() -> None:
    """Play the streams that the file lacks, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--streams", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--robot", default="j2n6s300")
    parser.add_argument("--unfiltered", action="store_true", help="with the steps of slow hands, too")
    parser.add_argument("--peers", nargs="*", choices=["mink", "ssik"], default=["mink", "ssik"])
    parser.add_argument("--output", type=Path, help="keep a line for each stream here, and go on from what it has")
    arguments = parser.parse_args()
    robot = jacokin.load_robot(arguments.robot)
    found = list(rows(arguments.output))
    done = {(row["robot"], row["kind"], row["seed"], row["number"], row["loop"]) for row in found}
    with ExitStack() as stack:
        loops: dict[str, tuple[Loop, float | None]] = {"jacokin.teleop": (smoothed, ACCELERATION)}
        if arguments.unfiltered:
            loops["jacokin, filter=None"] = unfiltered, ACCELERATION
        if "mink" in arguments.peers:
            loops["mink.solve_ik"] = bare_mink, None
        if "ssik" in arguments.peers and robot.name in SSIK:
            peer = next(peer for peer in environments.PEERS if peer.name == "ssik")
            worker = stack.enter_context(Worker(environments.interpreter(peer), "ssik_tracker"))
            loops["ssik.tracker"] = ssik_loop(robot, worker), None
        for number in range(-(-arguments.streams // len(arguments.kinds))):
            for kind in arguments.kinds:
                rng, again = (np.random.default_rng([arguments.seed, number]) for _ in range(2))
                rate = float(rng.choice(RATES))
                heard = ticks_of(make_stream(robot, kind, rng, rate=rate))
                again.choice(RATES)
                # After missing poses the tool is tied to the hand anew, elsewhere.
                motion = None if kind == "dropouts" else make_stream(robot, kind, again, rate=FINE)
                for name, (loop, acceleration) in loops.items():
                    key = (robot.name, kind, arguments.seed, number, name)
                    if key in done:
                        continue
                    row: dict[str, object] = dict(zip(("robot", "kind", "seed", "number", "loop"), key, strict=True))
                    row |= {"rate": rate}
                    row |= judge(robot, loop(robot, heard, rate), acceleration, motion)
                    found.append(row)
                    if arguments.output is not None:
                        with arguments.output.open("a") as file:
                            file.write(json.dumps(row) + "\n")
    show(found)


if __name__ == "__main__":
    main()
