"""Contact of an arm with itself, obstacles and other robots, and distances, on the shapes of its description.

Read `kernels/contact/run` for how it is found.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from functools import cached_property, partial
from itertools import product
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.kernels.contact import run
from jacokin.kernels.contact.arm import LAST_PAIR
from jacokin.kernels.contact.between import CheckWork, check_between, make_check_work
from jacokin.kernels.contact.run import ContactWork, among, make_contact_work, run_contact
from jacokin.kernels.contact.shapes import CENTRE, LINK, SIZE
from jacokin.kernels.library import Call, SharedCalls
from jacokin.kernels.motion_rows import make_between_work
from jacokin.model import poses
from jacokin.model.contact_arrays import ShapeRow, arm_arrays, joints_about_z
from jacokin.model.obstacles import NOTHING_AROUND, OtherRobot, Surroundings
from jacokin.model.own_shapes import own_shapes
from jacokin.model.robot import Robot, checked_robot
from jacokin.model.surrounded import (
    Surrounded,
    allowed_pairs,
    among_nothing,
    carried_shapes,
    surround,
    with_clearance,
)

ROWS_AT_ONCE = 64  # configurations that go to the kernels together
NAMED = 3  # pairs of shapes in a message
REFUSED_WITHIN = 1e-4  # [m] of the clearance, a motion is not certain, and counts as touching
Pair = tuple[str, str]

#: What the arm's contact is found with in one scene after another: at one configuration, and at some at once.
_for_one, _for_rows = SharedCalls(run_contact), SharedCalls(run_contact)
_between_rows = SharedCalls(check_between)


class NearestPair(NamedTuple):
    """Two shapes that are nearest to each other."""

    distance: float
    """[m], negative where they overlap; infinite without any pair of shapes."""
    pair: Pair
    """Their names; empty without any pair of shapes."""
    where: float = 0.0
    """On a motion: 0 at its start, 1 at its end."""


class Contact:
    """Contact of one robot with itself and with obstacles; may be shared between threads.

    Attributes:
        geometry: the shapes as the kernels take them: those of the arm, then the obstacles.
        names: names of the shapes.
        pairs: how many pairs of shapes are tested.
    """

    def __init__(
        self,
        robot: Robot,
        around: Surroundings = NOTHING_AROUND,
        *,
        clearance: float = 0.0,
        found: Surrounded | None = None,
    ) -> None:
        """Read the shapes, unless the robot has them.

        Args:
            robot: the arm.
            around: the scene.
            clearance: shapes this near to each other count as touching [m], those of the arm that nearly always are so
                near only where they are much nearer (`kept_less`).
            found: `surround` of both, where it is known.

        Raises:
            InvalidInputError: `robot` is not a Robot, or the scene does not fit it (`surround`).
            UnknownNameError: the scene speaks of a link that is not there.
            ShapeError: the description's shapes cannot be loaded.
        """
        self._robot = checked_robot("robot", robot)
        self._around, self._clearance = around, clearance
        self._all = found = surround(robot, around) if found is None else found
        if clearance > 0.0:
            found = with_clearance(robot, around, found, clearance)
        self._found = found
        self.geometry, self.names, self.pairs = found.geometry, found.names, found.pairs
        self._partly, self._arm_shapes, self._met_partly = found.alone, found.arm_shapes, found.met_partly
        self._local = threading.local()

    def with_clearance(self, clearance: float) -> Contact:
        """These shapes, which count as touching this near to each other [m]."""
        if clearance == self._clearance:
            return self
        return Contact(self._robot, self._around, clearance=clearance, found=self._all)

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """For pickle: made anew of the robot's arrays, as what the kernels are told belongs to a thread."""
        return partial(Contact, self._robot, self._around, clearance=self._clearance), ()

    def touches(self, q: Array) -> bool:
        """Whether any shapes touch at a checked configuration (dof,) [rad]."""
        try:
            work, call = self._local.touch
        except AttributeError:  # its own call: what the kernels are told never changes
            call = _for_one.call(self.geometry.arm, self.fresh_work, partial(among, geometry=self.geometry))
            call.work.numbers[run.ContactNumber.MARGIN_KEPT] = self._clearance
            work = call.work.q
            self._local.touch = work, call
        work[...] = q
        return bool(call() > 0)

    def fresh_work(self) -> ContactWork:
        """Work arrays for kernels that see whether shapes touch at a configuration."""
        work = make_contact_work(self.geometry, 1)
        work.numbers[run.ContactNumber.MARGIN_KEPT] = self._clearance
        return work

    def touching(self, q: ArrayLike) -> list[Pair]:
        """Names of the shapes that touch at `q` (dof,) [rad]; empty when none do.

        Raises:
            InvalidInputError: `q` malformed.
        """
        return self.all_touching(self._robot.configuration(q))

    def all_touching(self, q: Array) -> list[Pair]:
        """Names of the shapes that touch at a checked configuration (dof,) [rad]."""
        return self.list_touching(q) if self.touches(q) else []

    def list_touching(self, q: Array) -> list[Pair]:
        """Names of the shapes that touch, without a quick look first: for a configuration known to be in contact."""
        call = self._call()
        call.work.q[: q.size] = q
        return self._listed(call)

    def touches_at(self, rows: Array) -> NDArray[np.bool_]:
        """Whether any shapes touch at each of some checked configurations (n, dof) [rad]."""
        return self._ask(run.ContactTask.TOUCHES, rows, self._clearance)

    def touching_from(self, T_world_base: pin.SE3, q: Array) -> list[Pair]:
        """Names of the shapes that touch with the base elsewhere: of the base and obstacles those 5 mm deep."""
        call = self._call()
        call.work.q[: q.size] = q
        call.work.places.frames[0] = T_world_base.homogeneous[:3]
        call.work.numbers[run.ContactNumber.BASE_MARGIN] = -0.005  # [m] deep in what it stands on or is screwed to
        try:
            return self._listed(call)
        finally:
            call.work.places.frames[0] = np.eye(3, 4)
            call.work.numbers[run.ContactNumber.BASE_MARGIN] = -np.inf

    def _listed(self, call: Call[ContactWork]) -> list[Pair]:
        """All pairs that touch, the simpler kind of shape first."""
        found = self._run(call, run.ContactTask.LIST_TOUCHING, margin=self._clearance)
        return sorted(self.ordered(a, b, by_kind=True) for a, b in call.work.hits.pairs[:found].tolist())

    def distances(self, rows: Array, *, self_collision: bool = False) -> Array:
        """Smallest distances (n,) [m] of checked configurations; arguments and errors as of `nearest`."""
        found = [
            value[:, 0].copy() for value, _ in self._measured(run.ContactTask.LEAST_DISTANCE, rows, self_collision)
        ]
        return np.concatenate([np.zeros(0), *found])

    def nearest(self, rows: Array, *, self_collision: bool = False) -> list[NearestPair]:
        """The nearest shapes at each of some checked configurations (n, dof) [rad].

        Args:
            rows: the configurations.
            self_collision: True to look at the arm's own shapes among each other too.

        Raises:
            ModelError: the description has no shapes.
        """
        return self._nearest(run.ContactTask.LEAST_DISTANCE, rows, self_collision)

    def nearest_between(self, rows: Array, *, self_collision: bool = False) -> list[NearestPair]:
        """The nearest shapes on each straight motion from one of some configurations (n, dof) [rad] to the next.

        Arguments and errors as of `nearest`. Nothing is stepped over: anywhere on a motion the distance is larger than
        the one found less 1e-4 m. A NaN stands for a motion on which that could not be shown.
        """
        return self._nearest(run.ContactTask.LEAST_ON_MOTION, np.hstack([rows[:-1], rows[1:]]), self_collision)

    def in_the_way(self, start: Array, end: Array, extra: float = 0.0) -> Pair | None:
        """Shapes that touch on the straight motion between two configurations (dof,) [rad]; None if it is clear.

        Nothing is stepped over; shapes that come within 1e-4 m of the clearance may count too. With `extra` [m] the
        clearance is so much larger.
        """
        call = self._call()
        call.work.q[: 2 * len(start)] = *start, *end
        self._run(call, run.ContactTask.CLEAR_MOTION, 1, margin=self._clearance + extra, slack=REFUSED_WITHIN)
        if not call.work.value[0, 0]:
            return None
        a, b = call.work.named[0].tolist()
        return self.ordered(a, b, by_kind=True)

    def are_in_the_way(self, starts: Array, ends: Array, extra: float = 0.0) -> NDArray[np.bool_]:
        """Whether any shapes touch on each straight motion between configurations (n, dof) [rad], as `in_the_way`."""
        both = np.concatenate([starts, ends], axis=1)
        return self._ask(run.ContactTask.CLEAR_MOTION, both, self._clearance + extra, slack=REFUSED_WITHIN)

    def _ask(self, task: int, rows: Array, margin: float, slack: float = 0.0) -> NDArray[np.bool_]:
        """Whether shapes touch, for each row as of `_answers`."""
        answers = self._answers(self._call(), task, rows, margin=margin, slack=slack)
        found = [value[:, 0] != 0.0 for value, _ in answers]
        return np.concatenate([np.zeros(0, dtype=np.bool_), *found])

    def between_rows(self, rows: int) -> Call[CheckWork]:
        """What looks at so many rows of a motion and between them, in this thread; angles and limits are to be set."""
        dof = len(self.geometry.arm.joint_kinds)
        try:
            call: Call[CheckWork] = self._local.between
        except AttributeError:
            call = _between_rows.call(self.geometry.arm, partial(make_check_work, self.geometry), self._among)
            numbers = call.work.contact.numbers
            numbers[run.ContactNumber.MARGIN_KEPT], numbers[run.ContactNumber.SLACK] = self._clearance, REFUSED_WITHIN
            call.work.between.levers[:] = self.levers
        if rows > len(call.work.between.reach):
            more = make_between_work(dof, 2 * rows)
            more.levers[:] = self.levers
            call = Call(check_between, call.work._replace(between=more), call)
        self._local.between = call
        return call

    def _among(self, work: CheckWork) -> CheckWork:
        return work._replace(contact=among(work.contact, self.geometry))

    def _nearest(self, task: int, rows: Array, self_collision: bool) -> list[NearestPair]:
        return [
            NearestPair(distance, self.ordered(a, b) if a >= 0 else ("", ""), where)
            for value, named in self._measured(task, rows, self_collision)
            for (distance, where), (a, b) in zip(value.tolist(), named.tolist(), strict=True)
        ]

    def _measured(self, task: int, rows: Array, self_collision: bool) -> Iterator[tuple[Array, NDArray[np.int64]]]:
        """What a task of measuring says of rows; errors as of `nearest`."""
        self._check_shapes()
        meetings = len(self.geometry.arm.meetings) if self_collision else self._met_partly
        # [m] off the least distance along a motion
        return self._answers(self._measuring(), task, rows, slack=1e-4, meetings=meetings)

    def _answers(
        self,
        call: Call[ContactWork],
        task: int,
        rows: Array,
        *,
        margin: float = 0.0,
        slack: float = 0.0,
        meetings: int | None = None,
    ) -> Iterator[tuple[Array, NDArray[np.int64]]]:
        """What a task says of rows (n, dof) of configurations or (n, 2 dof) of the ends of motions, some at a time.

        Values (k, 2), and the numbers (k, 2) of two shapes; overwritten by the next.
        """
        at_once = ROWS_AT_ONCE * len(self.geometry.arm.joint_kinds) // rows.shape[1]
        for first in range(0, len(rows), at_once):
            some = rows[first : first + at_once]
            call.work.q[: some.size] = some.ravel()
            self._run(call, task, len(some), margin=margin, slack=slack, meetings=meetings)
            yield call.work.value[: len(some)], call.work.named[: len(some)]

    @cached_property
    def keeping_less(self) -> str:
        """Which of the arm's own shapes keep less than the clearance, and how much, in words; "" for none."""
        arm = self.geometry.arm
        rows = np.flatnonzero(arm.less)
        if not rows.size:
            return ""
        kept = np.maximum(self._clearance - arm.less[rows], 0.0)  # rounding
        words = [
            " and ".join((self.names[a], self.names[b])) + (f" ({length:.2g} m)" if length > 0.0 else " (0 m)")
            for (a, b), length in zip(arm.pairs[rows].tolist(), kept.tolist(), strict=True)
        ]
        more = f" and {len(words) - NAMED} more" if len(words) > NAMED else ""
        named = ", ".join(words[:NAMED])
        return f"kept less than {self._clearance:.3g} m apart, as nearly always nearer: {named}{more}"

    @property
    def levers(self) -> Array:
        """(dof,) how far a point of the arm can be from the axis of each joint, at most [m]; 1 where a joint slides."""
        return self._found.levers

    @property
    def has_shapes(self) -> bool:
        """Whether the description has collision shapes."""
        return len(self.arm_shapes) > 0

    @property
    def arm_shapes(self) -> tuple[str, ...]:
        """Names of the shapes of the arm, its base included, and of what it holds."""
        return self.names[self._partly : self._arm_shapes]

    @property
    def base_shapes(self) -> tuple[str, ...]:
        """Names of the shapes of the arm that no joint moves."""
        links = self.geometry.shapes.integers[self._partly : self._arm_shapes, LINK]
        return tuple(name for name, link in zip(self.arm_shapes, links.tolist(), strict=True) if link == 0)

    def pair_numbers(self, *, self_collision: bool) -> NDArray[np.int64]:
        """(n, 2) numbers of the shapes that count when they touch: obstacle and shape of the arm, then the arm's own.

        Of the arm's own, the one nearer to the base comes first.

        Raises:
            ModelError: the description has no shapes.
        """
        self._check_shapes()
        links = self.geometry.shapes.integers[: self._arm_shapes, LINK]
        obstacles = np.arange(self._arm_shapes, len(self.names))
        moving = np.flatnonzero(links > 0)
        outside = np.column_stack([np.repeat(obstacles, len(moving)), np.tile(moving, len(obstacles))])
        arm = self.geometry.arm
        partly = int(arm.meetings[self._met_partly - 1, LAST_PAIR]) if self._met_partly else 0
        return np.vstack([outside, arm.pairs if self_collision else arm.pairs[:partly]])

    def distances_kept(self, pairs: NDArray[np.int64]) -> Array:
        """Distances (n,) up to which pairs of shapes, by their numbers (n, 2), count as touching [m]."""
        arm = self.geometry.arm
        less = dict(zip(map(tuple, arm.pairs.tolist()), arm.less.tolist(), strict=True)) if arm.less.any() else {}
        return np.array([self._clearance - less.get((a, b), 0.0) for a, b in pairs.tolist()])

    def _check_shapes(self) -> None:
        if not self.has_shapes:
            raise ModelError(
                f"{self._robot.name}: the description has no collision shapes, so no distance can be measured"
            )

    def _call(self) -> Call[ContactWork]:
        """The kernels with work arrays of this thread."""
        try:
            call: Call[ContactWork] = self._local.call
        except AttributeError:
            make = partial(make_contact_work, self.geometry, ROWS_AT_ONCE)
            call = _for_rows.call(self.geometry.arm, make, partial(among, geometry=self.geometry))
            self._local.call = call
        return call

    def _measuring(self) -> Call[ContactWork]:
        """The same to measure distances with: no pair keeps less than others of none."""
        arm = self.geometry.arm
        if not arm.less.any():
            return self._call()
        try:
            call: Call[ContactWork] = self._local.measuring
        except AttributeError:
            geometry = self.geometry._replace(arm=arm._replace(less=np.zeros(len(arm.less))))
            call = self._local.measuring = Call(run_contact, make_contact_work(geometry, ROWS_AT_ONCE))
        return call

    def _run(
        self,
        call: Call[ContactWork],
        task: int,
        rows: int = 1,
        *,
        margin: float = 0.0,
        slack: float = 0.0,
        meetings: int | None = None,
    ) -> int:
        integers, numbers = call.work.integers, call.work.numbers
        integers[run.ContactInteger.TASK], integers[run.ContactInteger.ROWS] = task, rows
        integers[run.ContactInteger.MEETINGS] = len(self.geometry.arm.meetings) if meetings is None else meetings
        numbers[run.ContactNumber.MARGIN_KEPT], numbers[run.ContactNumber.SLACK] = margin, slack
        return call()

    def ordered(self, a: int, b: int, *, by_kind: bool = False) -> Pair:
        """Names of two shapes by their numbers: obstacles first, then as described; or the simpler kind first."""
        names, rank = self.names, self._ranks[by_kind].item
        return (names[a], names[b]) if rank(a) <= rank(b) else (names[b], names[a])

    @cached_property
    def _ranks(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(n,) what pairs are ordered by, as described and by kind: no two obstacles make one."""
        found = self._found
        ranks = np.full(len(self.names), -1)
        ranks[: found.arm_shapes] = found.ranks
        return ranks, found.kinds * (ranks.max(initial=0) + 2) + ranks


class SelfContact(Contact):
    """Self-contact of one robot; may be shared between threads."""

    def __init__(self, robot: Robot) -> None:
        """Read the shapes of the robot.

        Raises:
            InvalidInputError: `robot` is not a Robot.
            ShapeError: the description's shapes cannot be loaded.
        """
        super().__init__(robot)

    @classmethod
    def of(cls, robot: Robot) -> SelfContact | None:
        """A checker, or None when the description has no shapes to check.

        Raises:
            ShapeError: the description's shapes cannot be loaded.
        """
        checker = self_contact(robot)
        return checker if checker.pairs else None


def self_contact(robot: Robot) -> SelfContact:
    """Contact of a robot with itself, prepared once.

    Raises:
        ShapeError: the description's shapes cannot be loaded.
    """
    return checked_robot("robot", robot).once(SelfContact)


def contact_of_nothing(robot: Robot) -> Contact:
    """Contact of a robot whose shapes are not known: nothing touches."""
    arrays = arm_arrays(joints_about_z(robot.pin_model), [], [], [])
    return Contact(robot, found=among_nothing([], arrays, 0))


class ContactInWorld:
    """Contact of an arm, its base included, whose base may stand anywhere in a scene; may be shared between threads."""

    def __init__(self, robot: Robot, around: Surroundings) -> None:
        """Read the shapes; arguments and errors as of `Contact`, the obstacles in the world."""
        # An obstacle with allowed contact would be kept in the frame of the base, which moves here.
        self._contact = Contact(robot, around._replace(allow=()))
        self._home = robot.home
        if not self._contact.has_shapes:
            raise ModelError(f"{robot.name}: the description has no collision shapes, so no contact can be found")
        self._base = frozenset(self._contact.base_shapes)
        self._obstacles = frozenset(around.obstacle_names)
        self._allowed = allowed_pairs(robot, around, self._contact.arm_shapes)

    def touching(self, q: Array, T_world_base: pin.SE3) -> list[Pair]:
        """Names of the shapes that touch at `q` (dof,) [rad]; a base that stands on an obstacle does not touch it."""
        found = self._contact.touching_from(T_world_base, q)
        return [pair for pair in found if frozenset(pair) not in self._allowed]

    def is_blocked(self, T_world_base: pin.SE3) -> bool:
        """Whether the base is inside an obstacle, whatever the joints do."""
        touching = self.touching(self._home, T_world_base)
        return any(not self._base.isdisjoint(pair) and not self._obstacles.isdisjoint(pair) for pair in touching)


class ContactBetween:
    """Contact of an arm, and what it holds, with another robot while both move; may be shared between threads.

    It depends on how the two stand to each other alone. So they are taken as one serial chain, from the tip of the arm
    back to its base, on to the base of the other robot and out to its tip, and what is known of motions of one arm
    (`Contact`) holds for it: where both move straight, each of its joints does.

    Attributes:
        levers: (dof,) how far a point of the arm can be from the axis of each joint, at most [m]; 1 where one slides.
        other_levers: (m,) the same of the other robot.
    """

    def __init__(self, robot: Robot, around: Surroundings, other: OtherRobot, *, clearance: float = 0.0) -> None:
        """Prepare it.

        Args:
            robot: the arm.
            around: its scene, with the other robot in it.
            other: that robot; where its joints stand does not matter.
            clearance: shapes this near to each other count as touching [m].

        Raises:
            InvalidInputError: the scene does not fit the arm.
            UnknownNameError: the scene speaks of a link that is not there.
            ShapeError: shapes cannot be loaded.
        """
        own = carried_shapes(robot, around)
        alone = Surroundings(finger_angle=other.finger_angle)
        theirs = carried_shapes(other.robot, alone)
        (placements, kinds), (more, other_kinds) = map(joints_about_z, (robot.pin_model, other.robot.pin_model))
        dof = len(kinds)
        back = [_pose(each).inverse() for each in placements]  # from link to link towards the base, joints at zero
        across = back[0] * poses.checked_pose(other.base)
        chain = [pin.SE3.Identity(), *back[:0:-1], across * _pose(more[0]), *map(_pose, more[1:])]

        here = pin.SE3.Identity()
        both = [
            (shape.name, _moved(row, here if shape.joint == dof else back[shape.joint], dof - shape.joint))
            for shape, row in own
        ] + [
            (part.name, _moved(row, here if shape.joint else across, dof + shape.joint))
            for (shape, row), part in zip(theirs, other.parts, strict=True)
        ]
        links = [int(row.integers[LINK]) for _, row in both]
        allowed = allowed_pairs(robot, around, own_shapes(robot, around.finger_angle).names)
        pairs = [
            (a, b)
            for a, b in product(range(len(own)), range(len(own), len(both)))
            if links[a] < links[b]  # bases stand where they stand
            and not (allowed and frozenset((both[a][0], both[b][0])) in allowed)
        ]
        joints = np.array([each.homogeneous[:3] for each in chain]), [*kinds[::-1], *other_kinds]
        arrays = arm_arrays(joints, links, [row for _, row in both], pairs)
        shapes = [
            shape._replace(name=name, joint=link)
            for (shape, _), (name, _), link in zip([*own, *theirs], both, links, strict=True)
        ]
        found = among_nothing(shapes, arrays, len(pairs))
        self._contact = Contact(robot, NOTHING_AROUND, clearance=clearance, found=found)
        self._theirs = frozenset(part.name for part in other.parts)
        self.levers = Contact(robot, around._replace(obstacles=(), allow=())).levers
        self.other_levers = Contact(other.robot, alone).levers

    def in_the_way(self, arm: tuple[Array, Array], other: tuple[Array, Array], extra: float = 0.0) -> Pair | None:
        """Shapes that touch while both go straight, each from one configuration to another [rad]; None if none do.

        Nothing is stepped over; shapes that come within 1e-4 m of the clearance may count too. With `extra` [m] the
        clearance is so much larger.
        """
        begin, end = (np.concatenate([-q[::-1], other_q]) for q, other_q in zip(arm, other, strict=True))
        pair = self._contact.in_the_way(begin, end, extra)
        return pair if pair is None or pair[0] in self._theirs else pair[::-1]

    def distances(self, rows: Array, others: Array) -> Array:
        """Smallest distances (n,) [m] at configurations (n, dof) of the arm and (n, m) of the other robot [rad]."""
        return self._contact.distances(np.hstack([-rows[:, ::-1], others]), self_collision=True)


def _pose(placement: Array) -> pin.SE3:
    return pin.SE3(placement[:, :3], placement[:, 3])


def _moved(row: ShapeRow, pose: pin.SE3, link: int) -> ShapeRow:
    """A shape as one of another link, on which the one that it had stands at a pose."""
    numbers, integers = row.numbers.copy(), row.integers.copy()
    numbers[:SIZE] = (pose * _pose(row.numbers[:SIZE].reshape(3, 4))).homogeneous[:3].ravel()
    numbers[CENTRE : CENTRE + 3] = pose.act(row.numbers[CENTRE : CENTRE + 3])
    integers[LINK] = link
    return row._replace(numbers=numbers, integers=integers)
