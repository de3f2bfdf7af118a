"""How smooth trackers are: joints that turn back and forth, errors, and the time until an arm stands still.

``python -m benchmarks.smooth`` plays the streams of `benchmarks.streams` through jacokin's `Tracker` and `Teleop` with
their defaults, and through the loops that users of mink, pink and placo write, as the examples of these packages show
them. Teleoperation ties the tool to the hand anew after silence, so after dropouts it ends elsewhere. pink and placo
run in environments of their own, made on first use. It prints a table in Markdown, a row for each kind of stream and
loop.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import math
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import mink
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import jacokin
from benchmarks import environments, streams
from benchmarks.environments import Peer
from benchmarks.streams import TargetStream
from benchmarks.worker import Worker
from jacokin import Robot, Tracker
from jacokin.arrays import Array
from jacokin.model import poses, to_mujoco
from jacokin.model.written_descriptions import write_urdf
from jacokin.teleop import Teleop

STRONG = 0.05  # of its velocity limit, above which the two directions of a joint make a reversal
WITHIN = 3  # ticks
STILL = 1e-3  # of the velocity limits: slower joints stand
TURNS = 1000.0  # [rad] limits of joints without any, for peers that know none of these
MARGIN = 1e-3  # [rad/s] above its limit from which a velocity counts as too fast: QP solvers have tolerances

PEERS = (
    Peer("pink", "pink `solve_ik`", "pink_tracker", ("pin-pink==4.4.0", "daqp==0.11.0")),
    Peer("placo", "placo `KinematicsSolver`", "placo_tracker", ("placo==0.10.2",), environment="placo"),
)


def reversals(v: Array, limit: Array) -> NDArray[np.int64]:
    """How often each joint turns round within three ticks, at more than 5 % of its velocity limit on both sides.

    Args:
        v: (n, dof) velocity of each tick [rad/s].
        limit: (dof,) velocity limits [rad/s].

    Returns:
        (dof,) counts.
    """
    counts = np.zeros(v.shape[1], dtype=np.int64)
    for joint, part in enumerate((v / limit).T):
        strong = np.flatnonzero(np.abs(part) > STRONG)
        turned = np.sign(part[strong[1:]]) != np.sign(part[strong[:-1]])
        counts[joint] = np.count_nonzero(turned & (np.diff(strong) <= WITHIN))
    return counts


def jolts(v: Array, hardest: Array, dt: float) -> int:
    """How often the joint that does most accelerates hard, and within 0.1 s as hard the other way.

    Args:
        v: (n, dof) velocity of each tick [rad/s].
        hardest: (dof,) acceleration limits [rad/s^2], of which 30 % are hard.
        dt: control step [s].
    """
    most = 0
    for part in (np.diff(v, axis=0) / (dt * hardest)).T:
        hard = np.flatnonzero(np.abs(part) > 0.3)  # of the acceleration limit
        turned = np.sign(part[hard[1:]]) != np.sign(part[hard[:-1]])
        most = max(most, int(np.count_nonzero(turned & (np.diff(hard) * dt <= 0.1 + 1e-9))))  # [s]
    return most


def target_reversals(targets: Sequence[pin.SE3], dt: float, *, linear: float = 0.01, angular: float = 0.05) -> int:
    """How often a target itself turns round within three ticks: the most of its six components.

    Args:
        targets: T_base_tool at each tick.
        dt: control step [s].
        linear: [m/s] above which both sides count.
        angular: [rad/s] likewise.
    """
    moves = [
        np.append(after.translation - before.translation, pin.log3(after.rotation @ before.rotation.T)) / dt
        for before, after in itertools.pairwise(targets)
    ]
    least = np.repeat([linear, angular], 3)
    return int(reversals(np.array(moves).reshape(-1, 6), least / STRONG).max())


def stands_after(v: Array, limit: Array, dt: float, since: int = 0) -> float:
    """Time from a tick on until all joints stay slower than 0.1 % of their limits [s]; infinite for never.

    Args:
        v: (n, dof) velocity of each tick [rad/s].
        limit: (dof,) velocity limits [rad/s].
        dt: control step [s].
        since: the tick from which the target stands.
    """
    moving = np.flatnonzero((np.abs(v) > STILL * limit).any(axis=1))
    last = int(moving[-1]) + 1 if len(moving) else 0
    return math.inf if last >= len(v) else max(last - since, 0) * dt


class Smoothness(NamedTuple):
    """What a loop made of a stream."""

    reversals: int
    """Of all joints."""
    worst: int
    """Of the joint that has most."""
    asked: int
    """Of the target."""
    error: float
    """Median distance of the tool to the motion behind the stream, while it moves [m]."""
    turn_error: float
    """Median angle likewise [rad]."""
    last_error: float
    """Distance at the end [m]."""
    stands: float
    """Time from when the target stands until the arm does [s]."""
    acceleration: float
    """Largest change of a joint's velocity from tick to tick, over dt [rad/s^2]."""
    too_fast: int
    """Ticks in which a joint is faster than its limit."""


def measure(robot: Robot, stream: TargetStream, q: Array, limit: Array | None = None) -> Smoothness:
    """Measure a motion.

    Args:
        robot: whose motion it is.
        stream: what was asked for.
        q: (n, dof) configuration after each tick [rad].
        limit: (dof,) velocity limits [rad/s]; None for the robot's.
    """
    limit = robot.velocity_limit if limit is None else limit
    v = np.diff(q, axis=0, prepend=stream.start[np.newaxis]) / stream.dt
    tools = [robot.forward_kinematics(row) for row in q]
    off = np.array(
        [np.linalg.norm(tool.translation - T.translation) for tool, T in zip(tools, stream.meant, strict=True)]
    )
    turned = np.array(
        [np.linalg.norm(pin.log3(tool.rotation.T @ T.rotation)) for tool, T in zip(tools, stream.meant, strict=True)]
    )
    moving = slice(0, stream.stands or None)
    counts = reversals(v, limit)
    return Smoothness(
        reversals=int(counts.sum()),
        worst=int(counts.max()),
        asked=target_reversals(stream.targets, stream.dt),
        error=float(np.median(off[moving])),
        turn_error=float(np.median(turned[moving])),
        last_error=float(off[-1]),
        stands=stands_after(v, limit, stream.dt, stream.stands),
        acceleration=float(np.abs(np.diff(v, axis=0, prepend=np.zeros((1, robot.dof)))).max() / stream.dt),
        too_fast=int((np.abs(v) > limit + MARGIN).any(axis=1).sum()),
    )


Loop = Callable[[Robot, TargetStream], Array]  # to (n, dof) configurations [rad]


def tracked(robot: Robot, stream: TargetStream) -> Array:
    """The tracker of jacokin, as it comes."""
    tracker = Tracker(robot, dt=stream.dt, q=stream.start)
    return np.array([tracker.step(target).q for target in stream.targets])


def led(robot: Robot, stream: TargetStream) -> Array:
    """The teleoperation of jacokin, as it comes."""
    teleop = Teleop(Tracker(robot, dt=stream.dt, q=stream.start), clutch=True)
    return np.array([teleop.step(hand).q for hand in stream.hand])


def bare_mink(robot: Robot, stream: TargetStream) -> Array:
    """The loop of mink, with the numbers of its examples of arms."""
    model = to_mujoco(robot)
    configuration = mink.Configuration(model)
    configuration.update(stream.start)
    task = mink.FrameTask(robot.default_frame, "site", position_cost=1.0, orientation_cost=1.0, lm_damping=1.0)
    posture = mink.PostureTask(model, cost=1e-3)
    posture.set_target(stream.start)
    speeds = dict(zip(robot.joint_names, robot.velocity_limit, strict=True))
    limits = [mink.ConfigurationLimit(model), mink.VelocityLimit(model, speeds)]
    q = []
    for target in stream.targets:
        task.set_target(mink.SE3(np.concatenate([poses.quat_wxyz(target.rotation), target.translation])))
        velocity = mink.solve_ik(configuration, [task, posture], stream.dt, "daqp", damping=1e-3, limits=limits)
        configuration.integrate_inplace(velocity, stream.dt)
        q.append(configuration.q.copy())
    return np.array(q)


@contextlib.contextmanager
def peer_loop(robot: Robot, peer: Peer) -> Iterator[Loop]:
    """A loop that runs in an environment of its own, started anew for each stream."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        description = plain_urdf(robot, folder / "arm.urdf")
        worker = stack.enter_context(Worker(environments.interpreter(peer), peer.module))

        def play(robot: Robot, stream: TargetStream) -> Array:
            setup = {
                "urdf": str(description),
                "frame": robot.default_frame,
                "joints": list(robot.joint_names),
                "velocity_limit": robot.velocity_limit.tolist(),
                "start": stream.start.tolist(),
                "dt": stream.dt,
            }
            worker.start(setup)
            theirs = worker.forward(stream.start[np.newaxis])[0]
            T_theirs_ours = np.linalg.inv(theirs) @ robot.forward_kinematics(stream.start).homogeneous
            asked = np.array([target.homogeneous for target in stream.targets]) @ np.linalg.inv(T_theirs_ours)
            answers, _ = worker.solve(asked)
            return np.concatenate(answers)

        yield play


def plain_urdf(robot: Robot, path: Path) -> Path:
    """A URDF of the arm alone, for everyone: no shapes, other joints held, wide limits where a joint has none."""
    write_urdf(robot, path)
    tree = ET.parse(path)
    root = tree.getroot()
    for link in root.findall("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    for joint in root.findall("joint"):
        if joint.get("name") not in robot.joint_names:
            joint.set("type", "fixed")
        elif joint.get("type") == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            assert limit is not None
            limit.set("lower", str(-TURNS))
            limit.set("upper", str(TURNS))
    tree.write(path)
    return path


def compare(
    robot: Robot, loops: dict[str, Loop], kinds: Sequence[str], count: int, seed: int, dt: float
) -> dict[tuple[str, str], list[Smoothness]]:
    """What each loop makes of the same streams, by kind and loop."""
    found: dict[tuple[str, str], list[Smoothness]] = {}
    for kind in kinds:
        for number in range(count):
            stream = streams.make(robot, kind, np.random.default_rng([seed, number]), dt=dt)
            for name, loop in loops.items():
                if loop is led and stream.stands == 0:
                    continue  # a hand leads from where the arm is, and a step before its first pose is none
                found.setdefault((kind, name), []).append(measure(robot, stream, loop(robot, stream)))
    return found


def table(found: dict[tuple[str, str], list[Smoothness]]) -> str:
    """A table in Markdown."""
    heads = (
        "stream",
        "loop",
        "reversals, all",
        "worst stream",
        "the targets' own",
        "median error [mm]",
        "[mrad]",
        "at the end [mm]",
        "stands after [s], median",
        "worst",
        "largest acceleration [rad/s²]",
        "ticks too fast",
    )
    lines = ["| " + " | ".join(heads) + " |", "|---|---|" + "---:|" * (len(heads) - 2)]
    for (kind, name), rows in found.items():
        stands = [row.stands for row in rows]
        numbers = (
            f"{sum(row.reversals for row in rows)}",
            f"{max(row.reversals for row in rows)}",
            f"{sum(row.asked for row in rows)}",
            f"{1e3 * np.median([row.error for row in rows]):.2f}",
            f"{1e3 * np.median([row.turn_error for row in rows]):.1f}",
            f"{1e3 * np.median([row.last_error for row in rows]):.2f}",
            _seconds(float(np.median(stands))),
            _seconds(max(stands)),
            f"{max(row.acceleration for row in rows):.3g}",
            f"{sum(row.too_fast for row in rows)}",
        )
        lines.append(f"| {kind} | {name} | " + " | ".join(numbers) + " |")
    return "\n".join(lines)


def _seconds(time: float) -> str:
    return "never" if math.isinf(time) else f"{time:.2f}"


def main() -> None:
    """Play the streams and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="j2n6s300", help="a bundled robot, or a URDF file")
    parser.add_argument("--kinds", nargs="+", choices=list(streams.KINDS), default=list(streams.KINDS))
    parser.add_argument("--streams", type=int, default=10, help="of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rate", type=float, default=100.0, help="control steps in a second [1/s]")
    parser.add_argument("--peers", nargs="*", choices=["mink", "pink", "placo"], default=["mink", "pink", "placo"])
    arguments = parser.parse_args()
    robot = jacokin.load_robot(arguments.robot)
    with ExitStack() as stack:
        loops: dict[str, Loop] = {"jacokin `Tracker`": tracked, "jacokin `Teleop`": led}
        if "mink" in arguments.peers:
            loops["mink `solve_ik`"] = bare_mink
        for peer in PEERS:
            if peer.name in arguments.peers:
                loops[peer.title] = stack.enter_context(peer_loop(robot, peer))
        found = compare(robot, loops, arguments.kinds, arguments.streams, arguments.seed, 1.0 / arguments.rate)
    print(table(found))


if __name__ == "__main__":
    main()
