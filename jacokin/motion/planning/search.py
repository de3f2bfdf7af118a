"""The cheapest way up the ladder, by dynamic programming; steps are made smaller where no way leads on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.motion.planning.ladder import Ladder, Links, Rung

FINEST = 2e-5  # [m] and [rad / 5] no step of the path is made smaller
MOST_RUNGS = 6000  # more than the path began with: steps that are halved cost time
TOGETHER = 20_000  # pairs of solutions that are looked at in one go
MOST_REFINED = 24  # steps that are halved at once, the last ones first


@dataclass(slots=True)
class Way:
    """One solution on each rung, as far as the way leads.

    Attributes:
        chosen: the solution on each rung, from the first.
        cost: of all its steps.
    """

    chosen: list[int]
    cost: float


class Search:
    """The ladder of one path, and the best way up; links are made when they are needed and can be cut."""

    def __init__(self, ladder: Ladder, places: Array, near: Array, start_cost: Callable[[Rung], Array]) -> None:
        """Solve at every place.

        Args:
            ladder: makes rungs and links.
            places: (n,) along the path.
            near: (dof,) where the path should begin [rad].
            start_cost: cost of beginning at each solution of the first rung; infinite for "not there".
        """
        self.ladder = ladder
        self.rungs = [*ladder.make(places[:1], near), *ladder.make(places[1:])]
        self._links: list[Links | None] = [None] * len(self.rungs)  # from the rung before
        self._most = len(self.rungs) + MOST_RUNGS
        self._start_cost = start_cost
        self._costs: list[Array] = []
        self._back: list[NDArray[np.intp]] = []
        self._valid = 0  # rungs whose costs are still right

    def best(self) -> Way:
        """The cheapest way to the end; when there is none, the cheapest to the last rung that can be reached."""
        while True:
            reached = self._climb()
            if reached == len(self.rungs) - 1 or not self._refined(reached):
                return self._way(reached)

    def cut(self, rung: int, first: int, second: int) -> None:
        """Two solutions do not follow each other after all: `first` on the rung before, `second` on this one."""
        links = self._links[rung]
        assert links is not None
        links.alive &= ~((links.first == first) & (links.second == second))
        self._valid = min(self._valid, rung)

    def charge(self, rung: int, first: int, second: int, cost: float) -> bool:
        """Make the step from `first`, on the rung before, to `second` cost so much at least; whether that is more."""
        links = self._links[rung]
        assert links is not None
        cheap = (links.first == first) & (links.second == second) & (links.cost < cost)
        links.cost[cheap] = cost
        if cheap.any():
            self._valid = min(self._valid, rung)
        return bool(cheap.any())

    def _climb(self) -> int:
        """Costs of all solutions, rung by rung; returns the last rung that can be reached, -1 for none."""
        if self._valid == 0:
            self._costs, self._back = [self._start_cost(self.rungs[0])], [np.empty(0, dtype=np.intp)]
            self._valid = 1
        del self._costs[self._valid :], self._back[self._valid :]
        if not np.isfinite(self._costs[-1]).any():
            return self._valid - 2
        for index in range(self._valid, len(self.rungs)):
            links = self._links[index]
            if links is None:
                links = self._link(index)
            size = len(self.rungs[index].x)
            total = np.where(links.alive, self._costs[-1][links.first] + links.cost, np.inf)
            cost, back = np.full(size, np.inf), np.full(size, -1, dtype=np.intp)
            order = np.argsort(-total, kind="stable")  # the cheapest is written last
            cost[links.second[order]] = total[order]
            back[links.second[order]] = links.first[order]
            self._costs.append(cost)
            self._back.append(back)
            self._valid = index + 1
            if not np.isfinite(cost).any():
                return index - 1
        return len(self.rungs) - 1

    def _link(self, index: int) -> Links:
        """Make the links of a rung, and with it those of the next ones that have none."""
        last, pairs = index, 0
        while last < len(self.rungs) and self._links[last] is None and pairs < TOGETHER:
            pairs += len(self.rungs[last - 1].x) * len(self.rungs[last].x)
            last += 1
        self._links[index:last] = self.ladder.links(self.rungs[index - 1 : last])
        links = self._links[index]
        assert links is not None
        return links

    def _way(self, reached: int) -> Way:
        if reached < 0:
            return Way([], np.inf)
        node = int(np.argmin(self._costs[reached]))
        cost = float(self._costs[reached][node])
        chosen = [node]
        for index in range(reached, 0, -1):
            node = int(self._back[index][node])
            chosen.append(node)
        return Way(chosen[::-1], cost)

    def _refined(self, reached: int) -> bool:
        """Halve the steps at which ways ended, the last ones first; False when all are as small as they get."""
        ended = []
        for index in range(min(reached + 1, len(self.rungs) - 1), 0, -1):
            if self._ends(index) and self._size(index) > FINEST:
                ended.append(index)
            if len(ended) == MOST_REFINED:
                break
        if not ended or len(self.rungs) + len(ended) > self._most:
            return False
        for index in ended:  # from the end: earlier numbers stay as they are
            self.halve(index)
        return True

    def halve(self, index: int) -> None:
        """Put a rung half way before a rung."""
        middle = 0.5 * (self.rungs[index - 1].u + self.rungs[index].u)
        self.rungs.insert(index, self.ladder.make(np.array([middle]))[0])
        self._links[index : index + 1] = [None, None]
        self._valid = min(self._valid, index)

    def can_halve(self, index: int) -> bool:
        """Whether the step before a rung can be made smaller."""
        return self._size(index) > FINEST and len(self.rungs) < self._most

    def _size(self, index: int) -> float:
        """Length of the step before a rung: metres, or a fifth of the radians."""
        a, b = self.rungs[index - 1].u, self.rungs[index].u
        lengths = self.ladder.manifold.path.lengths[min(int(a), self.ladder.manifold.path.lines - 1)]
        return float((b - a) * max(lengths[0], 0.2 * lengths[1]))

    def _ends(self, index: int) -> bool:
        """Whether a way that reached the rung before ends there though this rung has solutions that nothing reaches."""
        links = self._links[index]
        if links is None or index - 1 >= len(self._costs):
            return False
        a, b = np.isfinite(self._costs[index - 1]), len(self.rungs[index].x)
        left, entered = np.zeros(len(a), dtype=np.bool_), np.zeros(b, dtype=np.bool_)
        left[links.first[links.alive]] = True
        entered[links.second[links.alive]] = True
        return bool((a & ~left).any() and not entered.all())
