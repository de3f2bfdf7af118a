"""`MotionChecker`: contact of an arm at configurations, and all along straight joint motions.

A motion is certified, not sampled: from the middle of each part, distances say how far no pair of shapes can come
together, for no point moves faster than the turning joints times its distance from their axes (conservative
advancement). What is not covered so is looked at in smaller parts.
"""

from __future__ import annotations

import threading
from typing import NamedTuple

import mujoco
import numpy as np

from jacokin.arrays import Array
from jacokin.model.contact import Contact, ShapeDistances, compiled_pairs
from jacokin.model.descriptions import mjcf
from jacokin.model.obstacles import Surroundings
from jacokin.model.robot import Robot

SLACK = 2e-4  # [m] a motion that leaves less room is refused: certainty takes ever smaller steps there
ROUNDING = 1e-6  # [m] of measured distances
MOST_PLACES = 2000  # that are looked at on one motion before it is refused


class Block(NamedTuple):
    """Where a motion is not clear."""

    q: Array
    """(dof,) [rad]."""
    pair: tuple[str, str]
    """The two shapes."""


class MotionChecker:
    """Contact of one robot in one scene; may be shared between threads.

    Attributes:
        margin: shapes this near to each other touch [m].
        levers: (dof,) no point of the arm is farther from the axis of a joint [m].
    """

    def __init__(self, robot: Robot, around: Surroundings, margin: float) -> None:
        """Build the shapes.

        Raises:
            InvalidInputError: the scene does not fit the robot.
            UnknownNameError: the scene speaks of a link that is not there.
            ModelError: the description has no shapes, or they cannot be loaded.
        """
        self.margin = margin
        self._contact = Contact(robot, around, clearance=margin)
        self._distances = ShapeDistances(robot, around, self_collision=True)
        model, pairs = compiled_pairs(robot, around, self_collision=True)
        self._model, self._local = model, threading.local()
        link = np.array([len(mjcf.joints_above(model, int(body))) for body in model.geom_bodyid], dtype=np.intp)
        ordered = [(a, b) if link[a] <= link[b] else (b, a) for a, b in pairs]
        self._inner, self._outer = np.array(ordered, dtype=np.intp).reshape(-1, 2).T
        self._link, self._radius = link, np.array(model.geom_rbound)
        self._is_plane = model.geom_type[self._inner] == mujoco.mjtGeom.mjGEOM_PLANE
        self._hinge = model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
        lengths = np.linalg.norm(model.body_pos[model.jnt_bodyid], axis=1)
        tips = np.zeros(robot.dof)
        for joint in range(robot.dof):
            carried = [g for g in range(model.ngeom) if link[g] > joint]
            tips[joint] = max(
                (lengths[joint + 1 : link[g]].sum() + self._radius[g] + self._offset(g) for g in carried), default=0.0
            )
        self.levers = np.where(self._hinge, tips, 1.0)

    def _offset(self, geom: int) -> float:
        """How far a shape's centre is from the joint that carries it [m]."""
        found, body = float(np.linalg.norm(self._model.geom_pos[geom])), int(self._model.geom_bodyid[geom])
        while body and not self._model.body_jntnum[body]:
            found += float(np.linalg.norm(self._model.body_pos[body]))
            body = int(self._model.body_parentid[body])
        return found

    def touching(self, q: Array) -> tuple[str, str] | None:
        """Two shapes that touch at `q` (dof,) [rad]; None where none do."""
        found = self._contact.touching(q)
        return found[0] if found else None

    def clearance(self, rows: Array) -> Array:
        """Smallest distances (n,) [m] of shapes whose contact counts, at configurations (n, dof)."""
        return np.array([self._distances.least(q)[0] for q in rows])

    def block(self, start: Array, end: Array, extra: float = 0.0) -> Block | None:
        """Where the straight motion from `start` to `end` (dof,) [rad] is not clear; None where all of it is.

        With `extra` [m] shapes must stay farther apart by so much.
        """
        step, margin = end - start, self.margin + extra + ROUNDING
        waiting = [(0.0, 1.0)]
        for _ in range(MOST_PLACES):
            if not waiting:
                return None
            low, high = waiting.pop()
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            q = start + middle * step
            covered, pair, distance = self._cover(q, np.abs(step), half, margin)
            if covered < half:
                if distance < margin + SLACK:
                    return Block(q, self._names(pair))
                waiting += [(middle + covered, high), (low, middle - covered)]
        return Block(q, self._names(pair)) if waiting else None

    def _cover(self, q: Array, turn: Array, half: float, margin: float) -> tuple[float, int, float]:
        """How far the motion is clear both ways, at most `half`; and what ends that: a pair, and its distance [m]."""
        model, data = self._model, self._working_data()
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        centres = np.asarray(data.geom_xpos)
        rates = self._rates(data, centres, turn, half)
        inner, outer = self._inner, self._outer
        between = centres[outer] - centres[inner]
        bound = np.linalg.norm(between, axis=1) - self._radius[inner]
        if self._is_plane.any():
            normals = data.geom_xmat[inner[self._is_plane]].reshape(-1, 3, 3)[:, :, 2]
            bound[self._is_plane] = (normals * between[self._is_plane]).sum(axis=1)
        bound -= self._radius[outer] + margin
        rate = np.maximum(rates[outer, self._link[inner]], 1e-12)
        reach = bound / rate
        best, found, least = half, -1, np.inf
        near = np.flatnonzero(reach < half)
        for k in near[np.argsort(reach[near])].tolist():
            if reach[k] >= best:
                break
            a, b = int(inner[k]), int(outer[k])
            horizon = best * rate[k] + margin
            distance = mujoco.mj_geomDistance(model, data, a, b, horizon, None)
            if distance < horizon:
                best, found, least = (distance - margin) / rate[k], k, distance
        return max(best, 0.0), found, least

    def _rates(self, data: mujoco.MjData, centres: Array, turn: Array, half: float) -> Array:
        """How far shapes move, seen from earlier links (n, dof + 1), for each unit of the motion [m].

        Joints turn one after another, the outermost first: each moves a point by its angle times the point's distance
        from its axis, which those before it have changed by no more than they have moved it.
        """
        count = len(turn)
        rates = np.zeros((len(centres), count + 1))
        away = centres[:, None] - data.xanchor
        axes = np.asarray(data.xaxis)
        along = (away * axes).sum(axis=2)
        lever = np.sqrt(np.maximum((away * away).sum(axis=2) - along**2, 0.0)) + self._radius[:, None]
        moved = np.zeros(len(centres))
        for joint in range(count - 1, -1, -1):
            length = lever[:, joint] + half * moved if self._hinge[joint] else 1.0
            moved = moved + np.where(self._link > joint, turn[joint] * length, 0.0)
            rates[:, joint] = moved
        return rates

    def _working_data(self) -> mujoco.MjData:
        """Each thread's own."""
        try:
            data = self._local.data
        except AttributeError:
            data = self._local.data = mujoco.MjData(self._model)
        return data

    def _names(self, pair: int) -> tuple[str, str]:
        model = self._model
        a, b = sorted((mjcf.geom_name(model, int(self._inner[pair])), mjcf.geom_name(model, int(self._outer[pair]))))
        return a, b
