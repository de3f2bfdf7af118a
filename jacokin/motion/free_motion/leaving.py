"""Leaving contact: the first part of a motion that starts where shapes touch, or are nearer than a planner keeps them.

Pairs of shapes that are near at the start may stay near until they have come apart; on the way none gets nearer than
it was, and no other pair gets near. A motion that ends near something is one that leaves it, backwards.

A line is looked at in steps in which no point of the arm moves farther than `STEP`: what is farther apart than that at
both ends of a step stays apart between them. The distances of the pairs that leave are measured at each step.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.run import (
    ContactInteger,
    ContactNumber,
    ContactTask,
    ContactWork,
    make_contact_work,
    run_contact,
)
from jacokin.kernels.contact.shapes import LINK
from jacokin.kernels.library import Call
from jacokin.model.contact import REFUSED_WITHIN, Contact, Pair
from jacokin.model.robot import Robot

STEP = 1e-4  # [m] no point of the arm moves farther between two places that are looked at
DEEPEST = 0.01  # [m] deeper than this, shapes are not pulled apart: the scene is wrong, or the arm is
SAME_DISTANCE = 1e-7  # [m] distances are known this well; pairs that overlap less well than those that do not
PROBE = 1e-6  # [rad] over which rates of distances are measured
DAMPING = 1e-3  # of least squares, in part of the largest singular value


class Nearness(NamedTuple):
    """What is near at a configuration."""

    pairs: NDArray[np.int64]
    """(n, 2) numbers of shapes, the one that moves less first unless it is an obstacle."""
    distances: Array
    """(n,) [m], negative where they overlap."""
    kept: Array
    """(n,) what certified motions keep [m]."""

    def __bool__(self) -> bool:
        """Whether anything is."""
        return len(self.pairs) > 0


class Leaving:
    """Finds ways out of contact for one robot among obstacles; not to be shared between threads."""

    def __init__(self, robot: Robot, contact: Contact, clearance: float) -> None:
        """Take what may be in contact, and the distance that counts as contact [m]."""
        self._robot, self._contact = robot, contact
        self._kept = clearance + REFUSED_WITHIN
        self._levers = contact.levers
        self._work = make_contact_work(contact.geometry, 1)
        self._list = Call(run_contact, self._work)
        self._links = contact.geometry.shapes.integers[:, LINK]
        self._measure: Call[ContactWork] | None = None

    def near(self, q: Array) -> Nearness:
        """What is near at a configuration (dof,); nothing where a motion from there can be certified at once."""
        pairs = self._nearer(q, self._kept)
        if len(pairs):  # and what a step could bring near
            pairs = self._nearer(q, self._kept + STEP)
        kept = self._contact.distances_kept(pairs) + REFUSED_WITHIN
        return Nearness(pairs, self._measured(pairs, q)[:, 0] if len(pairs) else np.zeros(0), kept)

    def nearest(self, near: Nearness) -> tuple[float, Pair, float]:
        """The pair that is nearest of some: its distance [m], its names, and what certified motions keep of it [m]."""
        k = int(np.argmin(near.distances))
        a, b = near.pairs[k].tolist()
        return float(near.distances[k]), self._contact.ordered(a, b, by_kind=True), float(near.kept[k])

    def way_out(self, q: Array, near: Nearness, towards: Array, deadline: float = math.inf) -> Array | None:
        """Straight motions (n, dof) to where nothing is near [rad]; None where none are found.

        Args:
            q: (dof,) where the arm is [rad].
            near: what is near there.
            towards: (k, dof) where it is to go; a straight motion there is the first choice [rad].
            deadline: on the clock of `time.monotonic` [s], after which no other motion is tried.
        """
        for end in towards:
            out, _, _ = self._walk(q, end, near, room=0.0)
            if out is not None:
                return np.array([q, out])
            if time.monotonic() >= deadline:
                return None
        rows, there = [q], near
        for _ in range(12):  # lines
            best: tuple[float, Array, Array] | None = None
            for end in self._ends(rows[-1], there):
                out, last, distances = self._walk(rows[-1], end, there, room=0.005)  # [m] where nothing hinders it
                if out is not None:
                    return np.array([*rows, out])
                if time.monotonic() >= deadline:
                    return None
                gain = float((distances - there.distances).min())
                if gain > 1e-3 and (best is None or gain > best[0]):  # [m] less is no way out
                    best = gain, last, distances
            if best is None:
                return None
            rows.append(best[1])
            there = near._replace(distances=best[2])
        return None

    def follow(self, q: Array, end: Array, near: Nearness) -> tuple[Nearness, Pair | None]:
        """Follow a straight motion to its end, near what is near.

        Returns:
            What has not come apart there, and the pair that hinders it; None where none does.
        """
        _, last, distances = self._walk(q, end, near, room=np.inf)
        still = distances < near.kept + STEP
        if (last != end).any():
            return near, self.nearest(self.near(last) or near)[1]
        return Nearness(near.pairs[still], distances[still], near.kept[still]), None

    def hindrance(self, rows: Array) -> Pair | None:
        """What hinders a motion through configurations (n, dof) in leaving what is near at the first one; or None.

        A pair that gets nearer than it was, or one that was not near there and gets near.
        """
        near = self.near(rows[0])
        for q, end in itertools.pairwise(rows):
            pair = None
            if near:
                near, pair = self.follow(q, end, near)
            else:
                pair = self._contact.in_the_way(q, end)
            if pair is not None:
                return pair
        return None

    def _walk(self, q: Array, end: Array, near: Nearness, *, room: float) -> tuple[Array | None, Array, Array]:
        """Follow a straight motion until nothing is near.

        Returns:
            Where that is (dof,), or None; and how far it leads while nothing gets nearer (dof,), with the distances
            there (n,).
        """
        step = end - q
        count = int(np.clip(np.ceil(float(np.abs(step) @ self._levers) / STEP), 1, None))
        pairs, most, last = {(a, b) for a, b in near.pairs.tolist()}, near.distances, q
        out: Array | None = None
        for k in range(1, min(count, 3_000) + 1):
            there = end if k == count else q + (k / count) * step
            met = self._nearer(there, self._kept + STEP)
            if any((a, b) not in pairs for a, b in met.tolist()):
                break
            distances = self._measured(near.pairs, there)[:, 0]
            if (distances < most - SAME_DISTANCE).any():
                break
            most, last = np.maximum(most, distances), there
            if not len(met):
                out = there
                if (distances >= near.kept + room).all():
                    break
        return out, last, most

    def _ends(self, q: Array, near: Nearness) -> Iterator[Array]:
        """Ends of straight motions that may part pairs, the most promising first."""
        robot = self._robot
        normals = self._measured(near.pairs, q)[:, 7:]
        moved = np.where(self._links[near.pairs] > robot.dof, 0, self._links[near.pairs])  # obstacles stand still
        outward = np.where((moved[:, 1] >= moved[:, 0])[:, None], normals, -normals)
        free = np.ones(robot.dof)
        for _ in range(2):  # again without joints that a limit holds
            for step in self._steps(q, near, outward, int(moved.max()), free):
                if (end := self._within(q, step)) is not None:
                    yield end
            free = np.where((q <= robot.lower) | (q >= robot.upper), 0.0, 1.0)
            if free.all():
                break
        for joint in range(robot.dof):
            for sign in (1.0, -1.0):
                if (end := self._within(q, sign * np.eye(robot.dof)[joint])) is not None:
                    yield end

    def _steps(self, q: Array, near: Nearness, outward: Array, link: int, free: Array) -> Iterator[Array]:
        """Directions (dof,): the outermost link straight away, turned as it is; all pairs apart equally fast."""
        model = self._robot.pin_model
        data = model.createData()
        pin.computeJointJacobians(model, data, q)
        jacobian = pin.getJointJacobian(model, data, link, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED) * free
        for away in (outward.sum(axis=0), *outward):
            if np.linalg.norm(away) > DAMPING:
                yield _least_squares(jacobian, np.append(away, np.zeros(3)))
        rates = np.empty((len(near.pairs), len(q)))
        for joint in range(len(q)):
            shift = PROBE * np.eye(len(q))[joint]
            ahead, behind = (self._measured(near.pairs, q + sign * shift)[:, 0] for sign in (1.0, -1.0))
            rates[:, joint] = (ahead - behind) / (2.0 * PROBE)
        yield _least_squares(rates * free, np.ones(len(near.pairs)))

    def _within(self, q: Array, step: Array) -> Array | None:
        """The end of a motion along a step as far as the limits allow; None where that is nowhere."""
        robot, size = self._robot, float(np.abs(step).max())
        if not 0.0 < size < np.inf:
            return None
        step = step * (0.5 / size)  # [rad] of any joint along one line
        step[np.abs(step) < 1e-9] = 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(step > 0.0, robot.upper - q, q - robot.lower) / np.abs(step)
        share = min(1.0, float(np.where(step == 0.0, np.inf, room).min()))
        return np.clip(q + share * step, robot.lower, robot.upper) if share > 1e-6 else None

    def _nearer(self, q: Array, margin: float) -> NDArray[np.int64]:
        """Pairs (n, 2) that are nearer than a margin [m]."""
        work = self._work
        work.integers[[ContactInteger.TASK, ContactInteger.ROWS]] = ContactTask.LIST_TOUCHING, 1
        work.q[:], work.numbers[ContactNumber.MARGIN_KEPT] = q, margin
        found = self._list()
        return work.hits.pairs[:found].copy()

    def _measured(self, pairs: NDArray[np.int64], q: Array) -> Array:
        """Rows (n, 10) of distance, nearest points and normal from the first shape to the second of pairs."""
        if self._measure is None or len(self._measure.work.given) != len(pairs):
            fresh = make_contact_work(self._contact.geometry, 1, len(pairs))
            fresh.reach[:] = np.inf
            fresh.integers[[ContactInteger.TASK, ContactInteger.ROWS]] = ContactTask.MEASURE_PAIRS, len(pairs)
            self._measure = Call(run_contact, fresh)
        work = self._measure.work
        work.q[:], work.given[:] = q, pairs
        self._measure()
        return work.measured.copy()


def _least_squares(matrix: Array, wanted: Array) -> Array:
    """The step (n,) that gives what is wanted as well as it can, damped near singular places."""
    scale = float(np.linalg.norm(matrix, 2))
    if scale == 0.0:
        return np.zeros(matrix.shape[1])
    square = matrix @ matrix.T + (DAMPING * scale) ** 2 * np.eye(len(matrix))
    return np.asarray(matrix.T @ np.linalg.solve(square, wanted))
