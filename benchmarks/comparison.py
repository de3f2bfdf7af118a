"""Jacokin and its peers on the same targets, in turns, judged by the same referee."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.environments import InstallError, Peer, interpreter
from benchmarks.referee import Referee, apart, rotation_angle
from benchmarks.targets import Targets
from benchmarks.worker import Worker, WorkerError
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.model.descriptions import bundled

POSITION_TOLERANCE = 1e-6  # [m], what jacokin promises
ORIENTATION_TOLERANCE = 1e-6  # [rad]
# Where two branches nearly meet, a description that is off by e moves them by about the square root of e.
FOLD_SPREAD = 3.0
SAME_SOURCE = 1e-9  # [m] and [rad]: a peer whose poses are this near is given the targets as they are
WARM_UP = 5  # targets each solver gets before anything is counted


@dataclass(slots=True)
class Contestant:
    """One solver in the comparison."""

    peer: Peer
    version: str = ""
    failure: str = ""
    """Why there are no figures; empty when there are."""
    worker: Worker | None = None
    tool: Array = field(default_factory=lambda: np.eye(4))
    """Constant pose of our frame in the peer's."""
    offset: tuple[float, float] = (0.0, 0.0)
    """How far the peer's description is from ours [m, rad]."""
    answers: dict[str, list[Array]] = field(default_factory=dict)
    """By set of targets: (k, dof) for each target."""
    seconds: dict[str, list[Array]] = field(default_factory=dict)
    """By set of targets: time and processor time (2,) of each call."""

    def close(self) -> None:
        """End the process."""
        if self.worker is not None:
            self.worker.close()
            self.worker = None


@dataclass(frozen=True, slots=True)
class Score:
    """What one solver did on one set of targets; None where there is nothing to count."""

    solved: float
    """Share of targets with an answer inside the limits and the tolerances."""
    within_limits: float | None
    """Share of answers inside every limit, at tolerance 0."""
    position: float | None
    """Worst position error of an answer [m]."""
    orientation: float | None
    """Worst orientation error of an answer [rad]."""
    branches: float
    """Mean number of answers to a target."""
    found: float | None
    """Share of targets whose generating configuration is among the answers."""
    median: float
    """Of the time of a call [s]."""
    p99: float
    processor_p99: float
    """Of the processor time of a call, threads added up: what else the machine does is not in it."""


def run(robot: Robot, peers: Sequence[Peer], sets: Sequence[Targets], rounds: int) -> list[Contestant]:
    """Let every peer answer every target.

    The targets are dealt into rounds, and in each round the solvers take turns, so that what else the machine does
    hits all alike. One process works at a time.
    """
    referee = make_referee(robot)
    contestants = [Contestant(peer) for peer in peers]
    try:
        for contestant in contestants:
            _enter(contestant, robot, referee, sets[0].poses[:WARM_UP])
        for number in range(rounds):
            first = number % len(contestants)
            for contestant in contestants[first:] + contestants[:first]:
                for targets in sets:
                    _answer(contestant, targets.name, targets.poses[number::rounds])
            print(f"round {number + 1} of {rounds}", flush=True)
    finally:
        for contestant in contestants:
            contestant.close()
    return contestants


def make_referee(robot: Robot) -> Referee:
    """Pinocchio on the bundled URDF of a robot, at its end effector."""
    return Referee(bundled.urdf_folder() / f"{robot.name}.urdf", robot.joint_names, "end_effector")


def score(contestant: Contestant, targets: Targets, rounds: int, referee: Referee) -> Score:
    """Figures of one solver on one set of targets."""
    order = np.concatenate([np.arange(len(targets.poses))[number::rounds] for number in range(rounds)])
    # A peer with its own, slightly other numbers is not blamed for the difference.
    tolerance = np.array([POSITION_TOLERANCE, ORIENTATION_TOLERANCE]) + contestant.offset
    known = targets.generating.size > 0 and not np.isnan(targets.generating).any()
    # [rad] on the circle: an answer this near is the configuration a target was made from.
    near = max(1e-4, FOLD_SPREAD * max(contestant.offset) ** 0.5)
    solved, found = 0, 0
    positions, orientations, insides = [np.empty(0)], [np.empty(0)], [np.empty(0, dtype=bool)]
    for index, q in zip(order, contestant.answers[targets.name], strict=True):
        if not len(q):
            continue
        position, orientation = referee.errors(q, targets.poses[index])
        inside = referee.within_limits(q)
        solved += bool((inside & (position <= tolerance[0]) & (orientation <= tolerance[1])).any())
        found += known and bool((apart(q, targets.generating[index]) <= near).any())
        positions.append(position)
        orientations.append(orientation)
        insides.append(inside)
    inside = np.concatenate(insides)
    count = len(order)
    seconds = np.array(contestant.seconds[targets.name])
    return Score(
        solved=solved / count,
        within_limits=float(inside.mean()) if len(inside) else None,
        position=float(np.concatenate(positions).max()) if len(inside) else None,
        orientation=float(np.concatenate(orientations).max()) if len(inside) else None,
        branches=len(inside) / count,
        found=found / count if known and contestant.peer.all_branches else None,
        median=float(np.median(seconds[:, 0])),
        p99=float(np.percentile(seconds[:, 0], 99)),
        processor_p99=float(np.percentile(seconds[:, 1], 99)),
    )


def _enter(contestant: Contestant, robot: Robot, referee: Referee, warm_up: Array) -> None:
    """Install, start and check one solver; its description must be our robot's."""
    try:
        contestant.worker = Worker(interpreter(contestant.peer), contestant.peer.module)
        contestant.version = contestant.worker.start(_setup(robot, contestant.peer))
        q = robot.sample(np.random.default_rng(0), 200)  # configurations on which descriptions are compared
        theirs, ours = contestant.worker.forward(q), referee.forward(q)
        contestant.tool = np.linalg.inv(theirs[0]) @ ours[0]
        contestant.offset = _deviation(theirs @ contestant.tool, ours)
        if max(_deviation(theirs, ours)) < SAME_SOURCE:
            contestant.tool = np.eye(4)
        if max(contestant.offset) > 1e-4:  # [m] and [rad]: a peer whose description is farther off has another robot
            raise WorkerError(
                f"its description differs by {contestant.offset[0]:.3g} m, {contestant.offset[1]:.3g} rad"
            )
        contestant.worker.solve(warm_up @ np.linalg.inv(contestant.tool))
    except (InstallError, WorkerError) as error:
        _fail(contestant, str(error))


def _answer(contestant: Contestant, name: str, poses: Array) -> None:
    """One round of one solver on some poses of a set."""
    if contestant.worker is None:
        return
    try:
        answers, seconds = contestant.worker.solve(poses @ np.linalg.inv(contestant.tool))
    except WorkerError as error:
        _fail(contestant, str(error))
        return
    contestant.answers.setdefault(name, []).extend(answers)
    contestant.seconds.setdefault(name, []).extend(seconds)


def _fail(contestant: Contestant, reason: str) -> None:
    contestant.failure = reason
    contestant.close()


def _setup(robot: Robot, peer: Peer) -> dict[str, Any]:
    """What a solver is told: files, joints, limits (null where a joint turns freely) and the start."""
    folder = bundled.urdf_folder()
    limits = [
        [None, None] if free else [low, high]
        for low, high, free in zip(robot.lower, robot.upper, robot.unlimited, strict=True)
    ]
    return {
        "robot": robot.name,
        "urdf": str(folder / f"{robot.name}.urdf"),
        "arm_mjcf": str(folder / "jaco_arm.xml"),
        "joints": list(robot.joint_names),
        "limits": limits,
        "home": robot.home.tolist(),
        "variant": peer.variant,
    }


def _deviation(a: Array, b: Array) -> tuple[float, float]:
    """Largest position [m] and orientation [rad] difference of poses (n, 4, 4)."""
    position = np.linalg.norm(a[:, :3, 3] - b[:, :3, 3], axis=1).max()
    return float(position), float(rotation_angle(a[:, :3, :3], b[:, :3, :3]).max())
