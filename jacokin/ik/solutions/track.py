"""`CurveTrack`: what an interval runs along, a piece of a curve within the limits."""

from __future__ import annotations

import math

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.solutions.curve_arm import DIMENSIONS, CurveProblem
from jacokin.model.angles import TURN

#: [rad] distance in joint space between guesses along a track.
GUESS_SPACING = 0.05
#: [rad] a parameter that changes by less stands still.
STANDING = 1e-7


class CurveTrack:
    """A run of configurations; angles are in any 2 pi equivalent, and the coordinate counts chords between nodes.

    Attributes:
        start: least value of the parameter [rad].
        stop: largest value [rad].
        nodes: (m, 14) points and unit tangents.
    """

    __slots__ = ("_problem", "_turns", "nodes", "start", "stop")

    def __init__(self, problem: CurveProblem, nodes: Array, least: float) -> None:
        """Take the nodes of a piece, and the least value of the parameter: by whole turns it starts from there on."""
        self._problem, self.nodes = problem, nodes
        first, last = nodes.item(0, problem.arm.parameter), nodes.item(-1, problem.arm.parameter)
        if last - first < STANDING:
            last = first
        self._turns = -TURN * math.floor((first - least + STANDING) / TURN) if math.isfinite(least) else 0.0
        self.start, self.stop = first + self._turns, last + self._turns

    def at(self, parameter: float) -> Array:
        """(dof,) the configuration where the parameter has a value in [start, stop]."""
        nodes, index = self.nodes, self._problem.arm.parameter
        if parameter <= self.start or parameter >= self.stop:
            return self._joints(nodes[0 if parameter <= self.start else -1, :DIMENSIONS])
        p = parameter - self._turns
        chord = int(np.searchsorted(nodes[:, index], p)) - 1
        chord = min(max(chord, 0), len(nodes) - 2)
        return self._joints(self._problem.at(nodes[chord : chord + 2], p))

    def nearest(self, seed: Array, lower: Array, upper: Array) -> tuple[float, Array] | None:
        """Parameter and configuration (dof,) nearest to a seed (dof,), in the equivalents within the limits (dof,).

        Where the parameter nearly stands still, as along the circle of a nearly straight wrist, it may pass an end.
        """
        x = self._problem.nearest_on(self.nodes, seed)
        if x is None:
            return None
        p, parameters = x.item(self._problem.arm.parameter), self.nodes[:, self._problem.arm.parameter] + self._turns
        p += TURN * round((0.5 * (self.start + self.stop) - p) / TURN)
        low, high = min(self.start, parameters.min()), max(self.stop, parameters.max())
        return float(np.clip(p, low, high)), np.clip(self._joints(x), lower, upper)

    def guesses(self) -> tuple[Array, Array]:
        """Coordinates (m,) in order, and configurations there (m, dof) to about 1e-4 rad; ends and nodes exactly."""
        nodes = self.nodes
        lengths = np.linalg.norm(np.diff(nodes[:, :DIMENSIONS], axis=0), axis=1)
        counts = np.maximum(1, np.ceil(lengths / GUESS_SPACING).astype(int))
        chord = np.repeat(np.arange(len(counts)), counts)
        within = np.arange(len(chord)) - np.repeat(np.cumsum(counts) - counts, counts)
        coordinates = np.append(chord + within / counts[chord], float(len(counts)))
        return coordinates, self._joints(self._between(coordinates))

    def polyline(self) -> tuple[Array, Array]:
        """Values of the parameter (m,) in order, and configurations there (m, dof), as exact as those of `guesses`."""
        coordinates, _ = self.guesses()
        points = self._between(coordinates)
        p = np.maximum.accumulate(points[:, self._problem.arm.parameter]) + self._turns
        return np.clip(p, self.start, self.stop), self._joints(points)

    def point(self, coordinate: float) -> tuple[float, Array]:
        """Parameter and configuration (dof,) at a coordinate, exactly."""
        x = self._between(np.array([coordinate]))[0]
        p = min(max(x.item(self._problem.arm.parameter) + self._turns, self.start), self.stop)
        return p, self.at(p) if self.stop > self.start else self._joints(x)

    def _between(self, coordinates: Array) -> Array:
        """Points (m, 7) at coordinates (m,), by the cubics between the nodes."""
        nodes = self.nodes
        if len(nodes) == 1:
            return np.repeat(nodes[:, :DIMENSIONS], len(coordinates), axis=0)
        chord = np.clip(np.floor(coordinates).astype(np.intp), 0, len(nodes) - 2)
        u = (coordinates - chord)[:, np.newaxis]
        v, a, b = 1.0 - u, nodes[chord], nodes[chord + 1]
        length = np.linalg.norm(b[:, :DIMENSIONS] - a[:, :DIMENSIONS], axis=1)[:, np.newaxis]
        return np.asarray(
            (1.0 + 2.0 * u) * v * v * a[:, :DIMENSIONS]
            + u * v * v * length * a[:, DIMENSIONS:]
            + u * u * (3.0 - 2.0 * u) * b[:, :DIMENSIONS]
            - u * u * v * length * b[:, DIMENSIONS:]
        )

    def _joints(self, x: Array) -> Array:
        """(..., dof) of points (..., 7)."""
        return x[..., : self._problem.arm.dof]
