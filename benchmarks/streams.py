"""Streams of targets, made by code: what trackers, teleoperation and other people's loops are fed.

`make(robot, kind, rng)` says what was heard at each tick, and what the one who sends it meant. Those without gaps are
for every loop; those of hands have ticks in which nothing was heard.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jacokin import IKSolver, Robot
from jacokin.arrays import Array
from jacokin.model import poses

DT = 0.01  # [s]
SECONDS = 10.0  # [s] that a stream lasts
REST = 3.0  # [s] of it at the end, in which the target stands
FAR = 2.5  # times the tool's distance at home: out of everyone's reach
WAY = 0.15  # [m] that targets wander to each side of home
TURN = 0.35  # [rad] likewise
SPEED = 0.8  # part of the joints' limits of velocity at which targets across folds move
TRIES = 100  # joint motions, until one crosses a singular pose
TURNED = 0.04  # part of the frames that are turned
MISSING = 0.1  # part of the frames that are missing in bursts with dropouts
GAP = 0.25  # [s] for which nothing is heard at all, twice


@dataclass(frozen=True, slots=True, eq=False)
class TargetStream:
    """Targets over time."""

    kind: str
    """What it does, a name of `KINDS`."""
    dt: float
    """Control step [s]."""
    start: Array
    """(dof,) where the arm is at first [rad]."""
    heard: Sequence[pin.SE3 | None]
    """T_base_tool that came since the last tick, None for nothing; the first one is a pose."""
    meant: Sequence[pin.SE3]
    """T_base_tool of the motion behind it, at each tick."""
    stands: int
    """The tick from which the target stands."""

    def __len__(self) -> int:
        """Ticks."""
        return len(self.heard)

    @property
    def targets(self) -> list[pin.SE3]:
        """The last pose that was heard, at each tick."""
        found = list[pin.SE3]()
        for pose in self.heard:
            found.append(found[-1] if pose is None else pose)
        return found

    @property
    def hand(self) -> list[Array | None]:
        """What was heard, as `jacokin.teleop` takes it: position [m] and quaternion wxyz, None for nothing."""
        return [None if T is None else np.append(T.translation, poses.quat_wxyz(T.rotation)) for T in self.heard]


def make(
    robot: Robot, kind: str, rng: np.random.Generator, *, dt: float = DT, seconds: float = SECONDS
) -> TargetStream:
    """A stream that starts with the tool where it is at home; across folds with the arm on any branch.

    Args:
        robot: whose reach it is about.
        kind: a name of `KINDS`: "standing" within reach; "unreachable", which stands out of reach; "beyond", which
            goes out of reach and comes back; "circling" around the base, also out of reach; "spinning" about the tool;
            "moving" smoothly; "shoulder", over the axis of the first joint; "folds", across singular poses; "bursts" of
            a moving hand's poses, at 72 Hz in packets of five; "turned", one by one, some frames turned by 90 degrees;
            "turned_bursts", both; "dropouts", bursts with missing frames and silence.
        rng: randomness.
        dt: control step [s].
        seconds: how long it lasts [s], the last three with a target that stands.
    """
    ticks = round(seconds / dt)
    time = np.arange(ticks, dtype=np.float64) * dt
    moves = max(seconds - REST, 0.5 * seconds)
    if kind in ("bursts", "turned", "turned_bursts", "dropouts"):  # that have ticks in which nothing is heard
        motion = KINDS["moving"](robot, rng, moves)
        heard = _hand(motion, rng, time, moves, kind)
    else:
        motion = KINDS[kind](robot, rng, moves)
        heard = [motion(t) for t in time]
    stands = 0 if kind in ("standing", "unreachable") else min(round(moves / dt) + 1, ticks - 1)
    start = _branch(robot, rng) if kind == "folds" else robot.home
    return TargetStream(kind, dt, start, heard, [motion(t) for t in time], stands)


Motion = Callable[[float], pin.SE3]


def _standing(robot: Robot, rng: np.random.Generator, moves: float) -> Motion:
    target = robot.forward_kinematics(robot.sample(rng))
    return lambda t: target


def _unreachable(robot: Robot, rng: np.random.Generator, moves: float) -> Motion:
    T = robot.forward_kinematics(robot.sample(rng))
    start = robot.forward_kinematics(robot.home).translation
    way = start + rng.normal(size=3) * 0.5 * np.linalg.norm(start)
    target = pin.SE3(T.rotation, FAR * np.linalg.norm(start) * way / np.linalg.norm(way))
    return lambda t: target


def _through(start: pin.SE3, ways: list[Array], turns: list[Array], moves: float) -> Motion:
    """From corner to corner, at rest at each, with the least jerk in between; back at the start in the end."""
    corners = np.hstack([np.vstack([np.zeros(3), *ways, np.zeros(3)]), np.vstack([np.zeros(3), *turns, np.zeros(3)])])
    times = np.linspace(0.0, moves, len(corners))

    def at(t: float) -> pin.SE3:
        row = min(int(np.searchsorted(times, t, side="right")) - 1, len(times) - 2)
        part = min((t - times[row]) / (times[row + 1] - times[row]), 1.0)
        smooth = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
        moved = corners[row] + smooth * (corners[row + 1] - corners[row])
        return pin.SE3(pin.exp3(moved[3:]) @ start.rotation, start.translation + moved[:3])

    return at


def _moving(robot: Robot, rng: np.random.Generator, moves: float) -> Motion:
    start = robot.forward_kinematics(robot.home)
    ways, turns = rng.uniform(-WAY, WAY, (3, 3)), rng.uniform(-TURN, TURN, (3, 3))
    return _through(start, list(ways), list(turns), moves)


def _beyond(robot: Robot, rng: np.random.Generator, moves: float) -> Motion:
    start = robot.forward_kinematics(robot.home)
    way = start.translation + rng.normal(size=3) * 0.3 * np.linalg.norm(start.translation)
    way *= FAR * np.linalg.norm(start.translation) / np.linalg.norm(way)
    return _through(start, [way], [rng.uniform(-TURN, TURN, 3)], moves)


def _circling(robot: Robot, rng: np.random.Generator, moves: float) -> Motion:
    """From the tool onto a circle around the base, most often out of reach, or faster than the first joint."""
    start = robot.forward_kinematics(robot.home)
    distance = np.linalg.norm(start.translation)
    radius, height = rng.uniform(0.3, 2.0) * distance, rng.uniform(0.0, 1.5) * distance
    rate, begin = rng.uniform(0.2, 1.0), rng.uniform(0.0, 2.0 * np.pi)

    def at(t: float) -> pin.SE3:
        turned, part = rate * min(t, moves), min(t, 1.0)
        place = np.array([radius * np.cos(begin + turned), radius * np.sin(begin + turned), height])
        away = part**3 * (10.0 - 15.0 * part + 6.0 * part**2) * (place - start.translation)
        return pin.SE3(pin.exp3(np.array([0.0, 0.0, turned])) @ start.rotation, start.translation + away)

    return at


def _spinning(robot: Robot, rng: np.random.Generator, moves: float) -> Motion:
    """About an axis through the tool, which stays where it is."""
    start, axis, rate = robot.forward_kinematics(robot.home), rng.normal(size=3), rng.uniform(0.3, 1.5)
    axis /= np.linalg.norm(axis)
    return lambda t: pin.SE3(start.rotation @ pin.exp3(rate * min(t, moves) * axis), start.translation)


def _shoulder(robot: Robot, rng: np.random.Generator, moves: float) -> Motion:
    start = robot.forward_kinematics(robot.home)
    over = np.append(rng.uniform(-0.02, 0.02, 2), start.translation[2] + rng.uniform(0.0, 0.25)) - start.translation
    return _through(start, [over, 1.4 * over, over], [np.zeros(3)] * 3, moves)


def _folds(robot: Robot, rng: np.random.Generator, moves: float) -> Motion:
    """Where an arm would be that moves from home through its joints and back, across a singular pose if one is near."""
    most = SPEED * robot.velocity_limit * moves / np.pi
    for _ in range(TRIES):
        end = np.clip(robot.home + rng.uniform(-most, most), robot.lower, robot.upper)
        if robot.dof != 6 or _handed(robot, robot.home) * _handed(robot, end) < 0.0:
            break

    def at(t: float) -> pin.SE3:
        part = 0.5 - 0.5 * np.cos(2.0 * np.pi * min(t / moves, 1.0))
        return robot.forward_kinematics(robot.home + part * (end - robot.home))

    return at


def _handed(robot: Robot, q: Array) -> float:
    """A number that changes its sign in singular poses, of six joints."""
    return float(np.linalg.slogdet(robot.jacobian(q))[0])


def _branch(robot: Robot, rng: np.random.Generator) -> Array:
    """(dof,) a configuration with the tool where it is at home, of any branch: others fold back elsewhere."""
    if robot.dof != 6:
        return robot.home
    found = IKSolver(robot).solve_all(robot.forward_kinematics(robot.home), seed=robot.home).q_within_limits
    return np.array(found[rng.integers(len(found))]) if len(found) else robot.home


def _hand(motion: Motion, rng: np.random.Generator, time: Array, moves: float, kind: str) -> list[pin.SE3 | None]:
    """What a loop hears of a hand: the newest pose of the packets that came since its last tick."""
    sent = np.arange(0.0, time[-1], 1.0 / 72.0)  # [1/s] of a headset
    size = 1 if kind == "turned" else 5  # poses that a radio link delivers at once
    arrives = sent[np.minimum((np.arange(len(sent)) // size + 1) * size - 1, len(sent) - 1)]  # with its packet
    frames = [motion(t) for t in sent]
    kept = np.ones(len(sent), dtype=bool)
    if kind in ("turned", "turned_bursts"):
        is_newest = np.arange(len(sent)) % size == size - 1  # of its packet
        for row in np.flatnonzero((rng.random(len(sent)) < TURNED) & is_newest & (sent < moves)):
            axis = rng.normal(size=3)
            turn = pin.exp3(0.5 * np.pi * axis / np.linalg.norm(axis))
            frames[row] = pin.SE3(turn @ frames[row].rotation, frames[row].translation)
    if kind == "dropouts":
        kept = rng.random(len(sent)) > MISSING
        for begin in rng.uniform(0.1 * moves, 0.9 * moves, 2):
            kept &= (sent < begin) | (sent > begin + GAP)
        kept |= sent > moves
    rows = np.flatnonzero(kept)
    newest = np.searchsorted(arrives[rows], time, side="right") - 1
    heard = [
        frames[rows[new]] if new >= 0 and (tick == 0 or new > newest[tick - 1]) else None
        for tick, new in enumerate(newest)
    ]
    heard[0] = motion(0.0)
    return heard


KINDS: dict[str, Callable[[Robot, np.random.Generator, float], Motion]] = {
    "standing": _standing,
    "unreachable": _unreachable,
    "beyond": _beyond,
    "circling": _circling,
    "spinning": _spinning,
    "moving": _moving,
    "shoulder": _shoulder,
    "folds": _folds,
    "bursts": _moving,
    "turned": _moving,
    "turned_bursts": _moving,
    "dropouts": _moving,
}
