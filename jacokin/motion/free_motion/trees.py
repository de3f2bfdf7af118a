"""Two trees of certified motions, one from the start and one from all goals, that grow until they meet.

RRT-Connect (Kuffner and LaValle: RRT-Connect: an efficient approach to single-query path planning, 2000): the smaller
tree takes a step towards a random configuration, and the other one goes on towards where that led. Unlimited joints
turn the short way round. The end of a step is tested before the motion to it is certified, which costs more.
"""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.seeds import random_configurations
from jacokin.model.angles import TURN
from jacokin.model.contact import Contact
from jacokin.model.robot import Robot

STEP = 1.0  # [rad] by which a tree grows at once, joints weighed by their speed
MEETING = 1e-9  # [rad] two configurations that are nearer are one
PATIENCE = 50  # steps in a row that lead nowhere, after which the larger tree grows, too
FIRST_ROOM = 256  # configurations of a tree, twice as many whenever it is full
MOST_SAMPLES = 200_000  # after which the search is given up, whatever time is left
TOGETHER = 64  # samples that are drawn at once


@dataclass(slots=True)
class Search:
    """What a search found.

    Attributes:
        way: (n, dof) configurations from the start to a goal [rad]; None for none. Unlimited joints turn on.
        goal: number of the goal at its end.
        samples: how many random configurations it took.
        nearest: how near the trees came to each other [s], at full speed.
        hindrances: how often each pair of shapes ended a step.
    """

    way: Array | None = None
    goal: int = -1
    samples: int = 0
    nearest: float = np.inf
    hindrances: Counter[tuple[str, str]] = field(default_factory=Counter)


class Space:
    """Differences of configurations: unlimited joints the short way round; and how long a motion takes."""

    def __init__(self, robot: Robot, velocity: Array) -> None:
        """Take the velocity limits (dof,) [rad/s]."""
        self.robot, self.velocity = robot, velocity
        self._unlimited = robot.unlimited
        self._weights = float(velocity.mean()) / velocity

    def difference(self, start: Array, end: Array) -> Array:
        """From `start` to `end` (..., dof) [rad]."""
        step = end - start
        return np.where(self._unlimited, step - TURN * np.round(step / TURN), step)

    def length(self, step: Array) -> Array:
        """Of motions (..., dof), a joint counting more that is slower [rad]."""
        return np.asarray(np.sqrt(((step * self._weights) ** 2).sum(axis=-1)))

    def time(self, step: Array) -> Array:
        """Of motions (..., dof) at full speed [s]."""
        return np.asarray((np.abs(step) / self.velocity).max(axis=-1))

    def into_limits(self, q: Array) -> Array:
        """A configuration between two others, which rounding may have put past a limit."""
        return np.clip(q, self.robot.lower, self.robot.upper)


class Tree:
    """Configurations, each with the one it was reached from."""

    def __init__(self, space: Space, roots: Array) -> None:
        """Begin with roots (k, dof)."""
        self._space = space
        self._q = np.empty((max(FIRST_ROOM, 2 * len(roots)), roots.shape[1]))
        self._q[: len(roots)] = roots
        self.parents = [-1] * len(roots)

    def __len__(self) -> int:
        """How many configurations it has."""
        return len(self.parents)

    def __getitem__(self, node: int) -> Array:
        """One configuration (dof,)."""
        row: Array = self._q[node]
        return row

    def add(self, q: Array, parent: int) -> int:
        """Add a configuration, and return its number."""
        count = len(self.parents)
        if count == len(self._q):
            self._q = np.concatenate([self._q, np.empty_like(self._q)])
        self._q[count] = q
        self.parents.append(parent)
        return count

    def nearest(self, q: Array) -> tuple[int, Array, float]:
        """The configuration nearest to `q`, the way from it, and how long that is [rad]."""
        steps = self._space.difference(self._q[: len(self.parents)], q)
        lengths = self._space.length(steps)
        node = int(np.argmin(lengths))
        return node, steps[node], float(lengths[node])

    def branch(self, node: int) -> list[int]:
        """Numbers of the configurations from a root to a node."""
        found = []
        while node >= 0:
            found.append(node)
            node = self.parents[node]
        return found[::-1]


class TreeSearch:
    """Grows two trees until they meet."""

    def __init__(self, space: Space, contact: Contact | None, rng: np.random.Generator) -> None:
        """Take what checks motions; None where nothing can touch."""
        self._space, self._contact, self._rng = space, contact, rng
        self._found = Search()

    def find(self, start: Array, goals: Array, deadline: float) -> Search:
        """A way from a clear start (dof,) to one of clear goals (k, dof) [rad].

        Args:
            start: [rad].
            goals: [rad].
            deadline: on the clock of `time.monotonic` [s], when the search is cut.
        """
        found = self._found = Search()
        from_start, to_goals = Tree(self._space, start[None]), Tree(self._space, goals)
        misses = 0
        while found.samples < MOST_SAMPLES and time.monotonic() < deadline:
            for sample in random_configurations(self._space.robot, TOGETHER, self._rng):
                found.samples += 1
                small, large = (from_start, to_goals) if len(from_start) <= len(to_goals) else (to_goals, from_start)
                if misses >= PATIENCE and found.samples % 2:
                    small, large = large, small
                grown = self._step(small, sample)
                misses = misses + 1 if grown is None else 0
                if grown is None:
                    continue
                met = self._connect(large, small[grown])
                if met is not None:
                    ends = (grown, met) if small is from_start else (met, grown)
                    branch = to_goals.branch(ends[1])
                    found.goal = branch[0]
                    rows = [from_start[node] for node in from_start.branch(ends[0])]
                    rows += [to_goals[node] for node in branch[::-1]]
                    found.way = self._unroll(rows)
                    return found
                if time.monotonic() >= deadline:
                    break
        return found

    def _step(self, tree: Tree, q: Array) -> int | None:
        """Grow a tree by at most a step towards `q`; the number of what was added, None for nothing."""
        node, way, length = tree.nearest(q)
        return self._grow(tree, node, way, length)

    def _grow(self, tree: Tree, node: int, way: Array, length: float) -> int | None:
        start = tree[node]
        end = self._space.into_limits(start + (way if length <= STEP else way * (STEP / length)))
        if self._contact is not None:
            pair = self._contact.first_touching(end) or self._contact.in_the_way(start, end)
            if pair is not None:
                self._found.hindrances[pair] += 1
                return None
        return tree.add(end, node)

    def _connect(self, tree: Tree, q: Array) -> int | None:
        """Grow a tree step by step towards `q`; the number of the node that reaches it, None if it is blocked."""
        node, way, length = tree.nearest(q)
        while length > MEETING:
            grown = self._grow(tree, node, way, length)
            self._found.nearest = min(self._found.nearest, float(self._space.time(way)))
            if grown is None:
                return None
            node, way = grown, self._space.difference(tree[grown], q)
            length = float(self._space.length(way))
        return node

    def _unroll(self, rows: list[Array]) -> Array:
        """Configurations one after another, each in the copy that is the short way from the one before."""
        found = [rows[0]]
        for q in rows[1:]:
            step = self._space.difference(found[-1], q)
            if float(self._space.length(step)) > MEETING:
                found.append(np.where(self._space.robot.unlimited, found[-1] + step, q))
        return np.array(found)
