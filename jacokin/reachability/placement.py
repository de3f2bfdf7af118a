"""`place_base`: where to put the base of an arm, so that it reaches as many of some targets as possible.

The map counts quickly how many targets each place of a grid reaches. The best places are then checked with the closed
form itself, and moved in smaller and smaller steps as long as that reaches more targets, or the same with more margin.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin import files
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, needed
from jacokin.ik.results import Frozen
from jacokin.model import checks, poses
from jacokin.model.contact import ContactInWorld
from jacokin.model.scene import Scene, checked_scene
from jacokin.reachability.folder import (
    count_in_contact_or_not,
    count_reaching,
    count_with_rows,
    one_by_one,
    usable_rows,
)
from jacokin.reachability.map import ReachabilityMap, checked_poses
from jacokin.reachability.pictures import outline_arm, outline_scene
from jacokin.reachability.samples import NOWHERE, Grid, turn_about_base, turn_about_z

STARTS = 12  # places from the grid that are checked and moved
TURNS = 256  # steps of a full turn, for which the nearest orientation of each target is looked up once
APART = 0.5  # cells between two places that are worth naming both
FIRST_TARGETS = 8  # by which places near one that is known are compared first, besides those that it misses
PLACES = 64  # places whose distances to all targets are held at the same time


@poses.giving_copies("pose")
@dataclass(frozen=True, slots=True, eq=False)
class BasePlacement(Frozen):
    """A place for the base."""

    pose: pin.SE3
    """T_world_base: the base, where the targets are given in the world."""
    reached: int
    """How many targets it reaches, by the closed form."""
    margin: float
    """Smallest limit margin among those [rad], each in its best configuration; NaN if there are none."""
    success: NDArray[np.bool_]
    """(n,) which targets it reaches."""
    touching: NDArray[np.bool_]
    """(n,) which targets it would reach if nothing stood in the way: it touches the scene, or itself."""


def place_base(
    map: ReachabilityMap,  # noqa: A002 - the name of the contract; the builtin is not needed here
    targets: Sequence[pin.SE3] | ArrayLike,
    *,
    scene: Scene | None = None,
    x: tuple[float, float] | None = None,
    y: tuple[float, float] | None = None,
    heights: ArrayLike | None = None,
    yaws: int = 8,
    count: int = 5,
) -> tuple[BasePlacement, ...]:
    """Rank places for the base of the robot of a map, upright.

    Args:
        map: of the robot, frame and tool. Obstacles that it was built with are mounted on the base and move with it.
        targets: (n, 4, 4) poses of the tool, or a sequence of `pin.SE3`, in the world [m].
        scene: obstacles in the world, which neither the arm nor its base may touch; the base may stand on them.
        x: from and to where the base may stand in the world [m]; None for anywhere.
        y: as x.
        heights: (k,) z at which the base may stand [m]; None for any.
        yaws: turns of the base that are tried, where joint 1 does not turn freely.
        count: how many places to return, at most.

    Returns:
        The best places, best first: most targets, then the largest margin.

    Raises:
        InvalidInputError: malformed targets, scene or numbers, or a map of a robot that was not given to `load`.
    """
    checks.instance("map", map, ReachabilityMap, "a ReachabilityMap")
    wanted = checked_poses(targets)
    levels = None if heights is None else np.sort(_levels(heights))
    count = checks.whole_number("count", count, lowest=1)
    yaws = checks.whole_number("yaws", yaws, lowest=1)
    turns = map.samples.symmetries.turns
    angles = [0.0] if turns else (2.0 * np.pi * np.arange(yaws) / yaws).tolist()
    starts: list[tuple[int, float, Array]] = []
    world = None
    if scene is not None:
        obstacles = checked_scene("scene", scene)
        world = ContactInWorld(map.robot, obstacles.surroundings)
    slow = world is not None or one_by_one(map.solver, False)
    bounds = np.array([_bounds("x", x), _bounds("y", y), (-np.inf, np.inf)]).T
    search = _Refinement(map, wanted, bounds, levels is not None, slow, world)
    for yaw in angles:
        places, counts = _count_places(map, wanted, yaw, bounds, levels)
        best = _choose_apart(places, counts, 2.0 * map.grid.spacing, functools.partial(search.may_stand, yaw))
        starts += [(int(counts[index]), yaw, places[index]) for index in best]
    starts.sort(key=lambda start: -start[0])
    if world is not None:  # the map does not see obstacles
        starts = sorted(starts[:STARTS], key=lambda start: search.score(start[1], start[2]), reverse=True)
    few = 3 if slow else STARTS  # where each target takes milliseconds
    found = [search.settle(yaw, place) for _, yaw, place in starts[:few]]
    if not slow and found and max(placement.reached for placement in found) < len(wanted):
        found.append(search.scan(max(found, key=lambda placement: placement.reached)))
    found.sort(key=lambda placement: (-placement.reached, -np.nan_to_num(placement.margin, nan=-np.inf)))
    distinct: list[BasePlacement] = []
    for placement in found:
        away = [np.linalg.norm(placement.pose.translation - other.pose.translation) for other in distinct]
        if all(distance > APART * map.grid.spacing for distance in away):
            distinct.append(placement)
    return tuple(distinct[:count])


def _bounds(name: str, given: tuple[float, float] | None) -> tuple[float, float]:
    if given is None:
        return -np.inf, np.inf
    low, high = checks.vector(name, given, 2, "m")
    if low > high:
        raise InvalidInputError(f"{name} must be from where and to where [m], got {low} and {high}")
    return float(low), float(high)


def _levels(heights: ArrayLike) -> Array:
    values = np.atleast_1d(checks.array("heights", heights, "numbers (k,)", "m"))
    if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
        raise checks.refusal("heights", "finite numbers (k,)", heights, "m")
    return values


def _targets_in_base(targets: Array, place: Array, yaw: float) -> Array:
    """Targets in a base at a place (3,), turned by `yaw` about the vertical."""
    seen = targets.copy()
    turn = turn_about_z(-yaw)
    seen[:, :3, 3] = (targets[:, :3, 3] - place) @ turn.T
    seen[:, :3, :3] = turn @ targets[:, :3, :3]
    return seen


def _count_places(
    map: ReachabilityMap,  # noqa: A002 - as above
    targets: Array,
    yaw: float,
    bounds: Array,
    levels: Array | None,
) -> tuple[Array, NDArray[np.int_]]:
    """Places (n, 3) in the world for a base turned by `yaw`, and how many targets the map says each reaches."""
    local = _targets_in_base(targets, np.zeros(3), yaw)
    positions, grid, turn = local[:, :3, 3], map.grid, turn_about_z(yaw)
    lower, upper = positions.max(axis=0) - grid.upper, positions.min(axis=0) - grid.lower
    # Places from which all targets are in the grid; if there are none, those from which any is.
    if (upper - lower < grid.spacing).any():
        lower, upper = positions.min(axis=0) - grid.upper, positions.max(axis=0) - grid.lower
    step = max(grid.spacing, float((upper - lower).max()) / 60.0)
    places = Grid(lower, upper, step).centres().reshape(-1, 3)
    if levels is not None:
        flat = np.unique(places[:, :2], axis=0)
        places = np.concatenate([np.column_stack([flat, np.full(len(flat), level)]) for level in levels])
    if np.isfinite(bounds).any():
        places = np.unique(np.clip(places @ turn.T, *bounds) @ turn, axis=0)
    table = _orientation_table(map, local[:, :3, :3])
    counts = np.empty(len(places), dtype=np.int_)
    for first in range(0, len(places), PLACES):
        some = places[first : first + PLACES]
        offsets = positions[None] - some[:, None]
        cells = map.samples.cell_of(offsets.reshape(-1, 3)).reshape(offsets.shape[:2])
        steps = np.zeros(offsets.shape[:2], dtype=np.int_)
        if map.samples.symmetries.turns:
            angle = np.arctan2(offsets[..., 1], offsets[..., 0])
            steps = np.rint(angle / (2.0 * np.pi) * TURNS).astype(np.int_) % TURNS
        orientation = table[np.arange(len(local)), steps]
        hit = (map.counts[np.maximum(cells, 0), orientation] > 0) & (cells != NOWHERE)
        counts[first : first + PLACES] = hit.sum(axis=1)
    return places @ turn.T, counts


def _orientation_table(map: ReachabilityMap, rotations: Array) -> NDArray[np.int_]:  # noqa: A002 - as above
    """(n, steps) the nearest orientation of each target, for every direction that it may lie in from the base."""
    if not map.samples.symmetries.turns:
        return map.samples.nearest(rotations)[:, None]
    angles = 2.0 * np.pi * np.arange(TURNS) / TURNS
    columns = [map.samples.nearest(turn_about_base(rotations, np.full(len(rotations), -angle))) for angle in angles]
    return np.stack(columns, axis=1)


def _choose_apart(
    places: Array, counts: NDArray[np.int_], distance: float, may_stand: Callable[[Array], bool]
) -> list[int]:
    """The best places that are not next to a better one, of those where the base may stand."""
    chosen: list[int] = []
    for index in np.argsort(-counts, kind="stable").tolist():
        apart = all(np.linalg.norm(places[index] - places[other]) > distance for other in chosen)
        if apart and may_stand(places[index]):
            chosen.append(index)
            if len(chosen) == STARTS:
                break
    return chosen


#: Targets reached, and the smallest margin [rad]: places are compared by that.
_Score = tuple[int, float]


class _Measured(NamedTuple):
    """What is reached from n places, of some targets (k,)."""

    hits: NDArray[np.bool_]
    """(n, k) which are reached."""
    margins: Array
    """(n, k) with what limit margin [rad]."""
    touching: NDArray[np.bool_]
    """(n, k) which would be if nothing stood in the way."""

    @classmethod
    def nothing(cls, places: int) -> _Measured:
        """No targets."""
        none = np.zeros((places, 0), np.bool_)
        return cls(none, np.zeros((places, 0)), none)

    @property
    def scores(self) -> list[_Score]:
        """Of each place."""
        smallest = np.where(self.hits, self.margins, np.inf).min(axis=1, initial=np.inf)
        return list(zip(self.hits.sum(axis=1).tolist(), smallest.tolist(), strict=True))

    def of(self, places: Sequence[bool] | Sequence[int]) -> _Measured:
        """Of some of the places."""
        return _Measured(self.hits[places], self.margins[places], self.touching[places])

    def with_more(self, more: _Measured) -> _Measured:
        """With more targets after these."""
        return _Measured(
            np.concatenate([self.hits, more.hits], axis=1),
            np.concatenate([self.margins, more.margins], axis=1),
            np.concatenate([self.touching, more.touching], axis=1),
        )

    def in_order(self, numbers: NDArray[np.int_]) -> _Measured:
        """With the targets, which are these by number, in the order of their numbers."""
        back = np.argsort(numbers)
        return _Measured(self.hits[:, back], self.margins[:, back], self.touching[:, back])


#: Of places (n, 3), a turn of the base, and targets by number.
_Measure = Callable[[Array, float, NDArray[np.int_]], _Measured]


@dataclass(frozen=True, slots=True, eq=False)
class _Refinement:
    """Looks for better places near given ones, by the closed form.

    Attributes:
        map: of the robot.
        targets: (n, 4, 4) in the world.
        bounds: (2, 3) from and to where the base may stand [m].
        fixed_height: whether places move horizontally only.
        slow: whether each target takes milliseconds.
        world: what stands in the world; None for nothing.
    """

    map: ReachabilityMap
    targets: Array
    bounds: Array
    fixed_height: bool
    slow: bool
    world: ContactInWorld | None

    def may_stand(self, yaw: float, place: Array) -> bool:
        """Whether the base does not stand inside an obstacle."""
        return self.world is None or not self.world.is_blocked(pin.SE3(turn_about_z(yaw), place))

    def score(self, yaw: float, place: Array) -> _Score:
        """Targets reached and smallest margin at a place."""
        return self._measure(place[None], yaw, np.arange(len(self.targets))).scores[0]

    def settle(self, yaw: float, place: Array) -> BasePlacement:
        """The best place that smaller and smaller steps lead to; if slow, one from which all are reached will do."""
        moves = np.stack(np.meshgrid(*([-1.0, 0.0, 1.0],) * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        if self.fixed_height:
            moves = moves[moves[:, 2] == 0.0]
        steps = np.abs(moves).sum(axis=1)
        moves = moves[(steps == 1.0) if self.slow else (steps > 0.0)]
        step = self.map.grid.spacing
        best = self._measure(place[None], yaw, np.arange(len(self.targets)))
        for _ in range(40):
            if self.slow and best.scores[0][0] == len(self.targets):
                break
            around = np.clip(place + step * moves, *self.bounds)
            better = self._best(around, yaw, best)
            if better is not None:
                place, best = better
            elif step > 0.001:  # [m]
                step /= 2.0
            else:
                break
        reached, margin = best.scores[0]
        seal, pose = checks.sealed, pin.SE3(turn_about_z(yaw), place)
        return BasePlacement(pose, reached, margin if reached else np.nan, seal(best.hits[0]), seal(best.touching[0]))

    def scan(self, near: BasePlacement) -> BasePlacement:
        """The best place that steps lead to from the best one of a close grid around a place that misses some targets.

        Steps only go to where more is reached, and the places from which all targets are can be a small spot.
        """
        flat = self.fixed_height
        steps = np.linspace(-1.0, 1.0, 31 if flat else 13) * self.map.grid.spacing
        moves = np.stack(np.meshgrid(steps, steps, [0.0] if flat else steps, indexing="ij"), axis=-1).reshape(-1, 3)
        yaw = float(np.arctan2(near.pose.rotation[1, 0], near.pose.rotation[0, 0]))
        place = near.pose.translation
        best = self._measure(place[None], yaw, np.arange(len(self.targets)))
        places = np.clip(place + moves, *self.bounds)
        for first in range(0, len(places), PLACES):
            better = self._best(places[first : first + PLACES], yaw, best)
            if better is not None:
                place, best = better
        return self.settle(yaw, place)

    def _best(self, places: Array, yaw: float, than: _Measured) -> tuple[Array, _Measured] | None:
        """Of places (n, 3) the best one, and what is measured there; None if none is better than one that is known.

        Targets that the known place misses, and those that it reaches with the least margin, come first: most places
        are worse by one of those, and the others need not be looked at there.
        """
        hits, solver = than.hits[0], self.map.solver
        order = np.argsort(np.where(hits, than.margins[0], -np.inf), kind="stable")
        first, bound = int((~hits).sum()) + FIRST_TARGETS, than.scores[0]
        if not one_by_one(solver, False) and (self.world is not None or solver.verifier.avoids_contact):
            places, _ = self._better(self._measure_in_contact_or_not, places, yaw, order, first, bound)
        places, seen = self._better(self._measure, places, yaw, order, first, bound)
        if not len(places):
            return None
        index = max(range(len(places)), key=seen.scores.__getitem__)
        return places[index], seen.of([index]).in_order(order)

    def _better(
        self, measure: _Measure, places: Array, yaw: float, order: NDArray[np.int_], first: int, bound: _Score
    ) -> tuple[Array, _Measured]:
        """Those of places (n, 3) that score more than a bound, looked at from the first targets on (k,), by number."""
        seen, begin, count = _Measured.nothing(len(places)), 0, first
        while begin < len(order) and len(places):
            seen = seen.with_more(measure(places, yaw, order[begin : begin + count]))
            begin, count = begin + count, 2 * count
            left = max(len(order) - begin, 0)
            better = [(reached + left, margin) > bound for reached, margin in seen.scores]
            places, seen = places[better], seen.of(better)
        return places, seen

    @staticmethod
    def _seen_from(places: Array, yaw: float, targets: Array) -> Array:
        """The targets (places targets, 4, 4) in a base at each of some places (n, 3)."""
        return np.ascontiguousarray(np.concatenate([_targets_in_base(targets, place, yaw) for place in places]))

    def _measure_in_contact_or_not(self, places: Array, yaw: float, numbers: NDArray[np.int_]) -> _Measured:
        """As if nothing touched anything, which takes less time: no place scores more."""
        found = count_in_contact_or_not(self.map.solver, self._seen_from(places, yaw, self.targets[numbers]))
        shape = len(places), len(numbers)
        return _Measured((found.counts > 0).reshape(shape), found.margins.reshape(shape), np.zeros(shape, np.bool_))

    def _measure(self, places: Array, yaw: float, numbers: NDArray[np.int_]) -> _Measured:
        """What is reached of some targets (k,), by number, from each of some places (n, 3)."""
        seen = self._seen_from(places, yaw, self.targets[numbers])
        if self.world is None:
            counts, margins, in_contact = count_reaching(self.map.solver, seen)
        else:
            (counts, margins, in_contact), rows_of = count_with_rows(self.map.solver, seen)
        hits = (counts > 0).reshape(len(places), len(numbers))
        margins = margins.reshape(hits.shape)
        touching = ~hits & (in_contact > 0).reshape(hits.shape)
        if self.world is not None:
            for index, place in enumerate(places):
                base = pin.SE3(turn_about_z(yaw), place)
                blocked = self.world.is_blocked(base)
                for target in np.flatnonzero(hits[index]):
                    number = index * len(numbers) + int(target)
                    margin = None if blocked else self._clear_margin(*rows_of(number), base)
                    touching[index, target] = margin is None
                    margins[index, target] = np.nan if margin is None else margin
            hits &= ~touching
        return _Measured(hits, margins, touching)

    def _clear_margin(self, rows: Array, margins: Array, base: pin.SE3) -> float | None:
        """The first of some limit margins (k,) whose configuration (k, dof) is clear of the world; None for none."""
        assert self.world is not None  # the caller has asked
        for q, margin in zip(rows, margins, strict=True):
            if not self.world.touching(q, base):
                return float(margin)
        return None


def _posture(
    map: ReachabilityMap,  # noqa: A002 - as above
    place: BasePlacement,
    targets: Array,
    scene: Scene | None,
) -> tuple[Array, str]:
    """A configuration (dof,) that reaches the first target that a place reaches, and what it is; home without any."""
    world = None if scene is None else ContactInWorld(map.robot, scene.surroundings)
    yaw = float(np.arctan2(place.pose.rotation[1, 0], place.pose.rotation[0, 0]))
    for number in np.flatnonzero(place.success).tolist():
        (seen,) = _targets_in_base(targets[number : number + 1], place.pose.translation, yaw)
        for q in usable_rows(map.solver, seen)[0]:
            if world is None or not world.touching(q, place.pose):
                return q, f"arm at target {number + 1}"
    return map.robot.home, "arm at home"


PLACE_ENDINGS = (".png", ".svg", ".pdf")


def draw_placement(
    path: Path,
    place: BasePlacement,
    targets: Array,
    map: ReachabilityMap,  # noqa: A002 - as above
    scene: Scene | None = None,
) -> None:
    """Draw a place, and the arm at the first target that it reaches.

    Args:
        path: where to, which also tells the format.
        place: what `place_base` has found.
        targets: (n, 4, 4) poses in the world.
        map: of the robot.
        scene: obstacles in the world.

    Raises:
        MissingExtraError: matplotlib is not installed.
        InvalidInputError: another ending, or the file cannot be written.
    """
    if path.suffix not in PLACE_ENDINGS:
        raise InvalidInputError(
            f"{path}: pictures of places are written as {', '.join(PLACE_ENDINGS)}, told by the ending"
        )
    with needed("matplotlib", "plot"):
        from matplotlib.figure import Figure
    base, turn = place.pose.translation, place.pose.rotation
    robot = map.robot
    q, shown = _posture(map, place, targets, scene)
    arm = outline_arm(robot, q) @ turn.T + base
    obstacles = [] if scene is None else outline_scene(scene)
    at = targets[:, :3, 3]
    missed = ~place.success & ~place.touching
    figure = Figure(figsize=(11.0, 5.4), layout="constrained")
    for column, (first, second, title) in enumerate(((0, 1, "from above"), (0, 2, "from the side"))):
        axes = figure.add_subplot(1, 2, column + 1)
        for line in obstacles:
            axes.plot(line[:, first], line[:, second], color="0.6", linewidth=0.8)
        axes.plot(arm[:, first], arm[:, second], color="0.2", linewidth=2.5, label=shown)
        for axis, colour in ((first, "tab:red"), (second, "tab:green" if second == 1 else "tab:blue")):
            end = base + 0.15 * turn[:, axis]  # [m]
            axes.plot([base[first], end[first]], [base[second], end[second]], color=colour, linewidth=1.5)
        for rows, colour, mark, name in (
            (place.success, "tab:green", "o", "reached"),
            (place.touching, "tab:orange", "s", "in contact only"),
            (missed, "tab:red", "x", "not reached"),
        ):
            if np.any(rows):
                label = f"{name}: {int(np.sum(rows))}"
                axes.scatter(at[rows, first], at[rows, second], s=18.0, c=colour, marker=mark, label=label, zorder=3)
        axes.set(xlabel=f"{'xyz'[first]} [m]", ylabel=f"{'xyz'[second]} [m]", title=title)
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(visible=True, linewidth=0.3)
    axes.legend(loc="best")
    figure.suptitle(f"{robot.label}: {place.reached} of {len(targets)} targets from here")
    with files.replacing(path) as written:
        figure.savefig(written, format=path.suffix[1:], dpi=120)
