"""What an interval runs along: a piece of a solution curve, or the circle that the last joint turns on.

A track is walked by a coordinate of its own, in which it is smooth also where the parameter turns back.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.families.curves import CurveProblem, Piece
from jacokin.kernels.self_motion.slices import SAME_PARAMETER
from jacokin.model.angles import TURN

#: [rad] distance in joint space between guesses along a track.
GUESS_SPACING = 0.05
#: Share of it that is left at the ends at least: nearer than they are exact, guesses would hide a minimum between them.
LEAST_SPACING = 0.1


class Track(Protocol):
    """A run of configurations; angles are in any 2 pi copy."""

    start: float
    stop: float

    def at(self, parameter: float) -> Array:
        """(dof,) the configuration where the parameter has a value in [start, stop]."""

    def point(self, coordinate: float) -> tuple[float, Array]:
        """Parameter and configuration (dof,) at a coordinate."""

    def joints(self, coordinate: float) -> Array:
        """The configuration (dof,) at a coordinate."""
        return self.point(coordinate)[1]

    def nearest(self, seed: Array) -> tuple[float, Array] | None:
        """Parameter and configuration (dof,) nearest to a seed (dof,); None where only `guesses` can tell."""

    def guesses(self) -> tuple[Array, Array]:
        """Coordinates (m,) in order, from start to stop, and the configurations there (m, dof) to about 1e-4 rad."""

    def polyline(self) -> tuple[Array, Array]:
        """As `guesses`, with values of the parameter (m,) instead of coordinates; both ends exactly."""


class CurveTrack(Track):
    """A piece of a solution curve; the coordinate counts chords between nodes."""

    __slots__ = ("_parameter", "_piece", "_problem", "_turns", "start", "stop")

    def __init__(self, problem: CurveProblem, piece: Piece) -> None:
        """Take a piece; on a closed circle of parameters the start is moved into [-pi, pi)."""
        self._problem, self._piece = problem, piece
        self._parameter = problem.arm.parameter
        start, stop = piece.ends.item(0, self._parameter), piece.ends.item(1, self._parameter)
        turns = -TURN * math.floor((start + math.pi) / TURN) if problem.closed else 0.0
        self._turns = turns
        self.start, self.stop = start + turns, max(start, stop) + turns

    def at(self, parameter: float) -> Array:
        """See `Track`."""
        if parameter <= self.start or parameter >= self.stop:
            return self._joints(self._piece.ends[0 if parameter <= self.start else 1])
        first, last = self._piece.ends[:, self._parameter].tolist()
        p = min(max(parameter - self._turns, first), last)
        nodes = self._piece.nodes
        chord = int(np.searchsorted(nodes[:, self._parameter], p)) - 1
        chord = min(max(chord, 0), len(nodes) - 2)
        ends = nodes[chord : chord + 2]
        x = self._problem.at_parameter(ends, p)
        if x is None:  # where curves meet, or the parameter stays the same along the curve: any point will do
            low, high = ends[:, self._parameter].tolist()
            x = _between(ends, (p - low) / (high - low) if high - low > SAME_PARAMETER else 0.0)
        return self._joints(x)

    def point(self, coordinate: float) -> tuple[float, Array]:
        """See `Track`."""
        piece = self._piece
        first, last = self._coordinates()
        if coordinate <= first or coordinate >= last:
            x = piece.ends[0 if coordinate <= first else 1]
        else:
            chord = min(int(coordinate), len(piece.nodes) - 2)
            nodes = piece.nodes[chord : chord + 2]
            exact = self._problem.at_share(nodes, coordinate - chord)
            x = _between(nodes, coordinate - chord) if exact is None else exact
        p = float(x[self._parameter]) + self._turns
        return min(max(p, self.start), self.stop), self._joints(x)

    def guesses(self) -> tuple[Array, Array]:
        """See `Track`."""
        coordinates, points = self._points()
        return coordinates, self._joints(points)

    def polyline(self) -> tuple[Array, Array]:
        """See `Track`."""
        points = self._points()[1]
        p = np.clip(np.maximum.accumulate(points[:, self._parameter]) + self._turns, self.start, self.stop)
        return p, self._joints(points)

    def _points(self) -> tuple[Array, Array]:
        """Coordinates (m,) and points (m, 7), roughly between both ends."""
        nodes = self._piece.nodes
        lengths = np.linalg.norm(np.diff(nodes[:, :7], axis=0), axis=1)
        counts = np.maximum(1, np.ceil(lengths / GUESS_SPACING).astype(int))
        chord = np.repeat(np.arange(len(counts)), counts)
        within = np.arange(len(chord)) - np.repeat(np.cumsum(counts) - counts, counts)
        coordinates = chord + within / counts[chord]
        first, last = self._coordinates()
        apart = LEAST_SPACING / counts[chord]
        inside = (coordinates > first + apart) & (coordinates < last - apart)
        coordinates, chord = coordinates[inside], chord[inside]
        u = (coordinates - chord)[:, np.newaxis]
        v, length = 1.0 - u, lengths[chord][:, np.newaxis]
        a, b = nodes[chord], nodes[chord + 1]
        x = (
            (1.0 + 2.0 * u) * v * v * a[:, :7]
            + u * v * v * length * a[:, 7:]
            + u * u * (3.0 - 2.0 * u) * b[:, :7]
            - u * u * v * length * b[:, 7:]
        )
        points = np.vstack([self._piece.ends[0], x, self._piece.ends[1]])
        return np.concatenate([[first], coordinates, [last]]), points

    def nearest(self, seed: Array) -> tuple[float, Array] | None:
        """See `Track`."""
        nodes = self._piece.nodes.copy()
        nodes[0, :7], nodes[-1, :7] = self._piece.ends
        x = self._problem.nearest_on(nodes, seed)
        if x is None:
            return None
        p = self.start + float(np.mod(x[self._parameter] - self.start, TURN))
        if p > self.stop:  # by rounding, at one of the ends
            p = self.stop if p - self.stop < self.start + TURN - p else self.start
        return p, self._joints(x)

    def _coordinates(self) -> tuple[float, float]:
        return self._piece.shares[0], len(self._piece.nodes) - 2 + self._piece.shares[1]

    def _joints(self, x: Array) -> Array:
        """(..., 6) of six joints and an axis, (..., 7) of seven joints."""
        return x[..., :6] if self._parameter == 6 else x


def _between(ends: Array, share: float) -> Array:
    """A point (7,) on the chord between two nodes (2, 14)."""
    x: Array = ends[0, :7] + share * (ends[1, :7] - ends[0, :7])
    return x


class CircleTrack(Track):
    """A branch of a six-joint arm whose free axis is the axis of its last joint; the coordinate is the parameter.

    Also a single configuration of any arm: the sign is 0, and the track ends where it starts.
    """

    __slots__ = ("_q", "_sign", "start", "stop")

    def __init__(self, q: Array, sign: float, start: float, stop: float) -> None:
        """Take the branch (dof,) at parameter 0, and the sign of joint 6's turn."""
        self._q, self._sign, self.start, self.stop = q, sign, start, stop

    def at(self, parameter: float) -> Array:
        """See `Track`."""
        q = self._q.copy()
        q[5] += self._sign * parameter
        return q

    def point(self, coordinate: float) -> tuple[float, Array]:
        """See `Track`."""
        return coordinate, self.at(coordinate)

    def nearest(self, seed: Array) -> tuple[float, Array] | None:
        """See `Track`."""
        return None

    def guesses(self) -> tuple[Array, Array]:
        """See `Track`."""
        p = np.linspace(self.start, self.stop, 2 + int((self.stop - self.start) / GUESS_SPACING))
        q = np.tile(self._q, (len(p), 1))
        q[:, 5] += self._sign * p
        return p, q

    def polyline(self) -> tuple[Array, Array]:
        """See `Track`."""
        return self.guesses()
