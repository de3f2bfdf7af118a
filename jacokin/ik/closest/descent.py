"""Descents to local minima of the measure, all at once: Newton's method within the limits.

A step solves a quadratic model inside the limits. It is taken when the measure shrinks; otherwise it is damped more, as
Levenberg and Marquardt do.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.closest.measure import Duals, Measure, Points, duals_after

DAMPING = 3e-3  # of the first step, in the unit of the Hessian [m / rad^2]
LEAST_DAMPING, MOST_DAMPING = 1e-7, 1e4
LESS_DAMPING, MORE_DAMPING = 0.2, 4.0  # factors after a step that the model foretold well, and badly
GOOD_MODEL, BAD_MODEL = 0.7, 0.25  # parts of the foretold progress that were made
LONGEST_STEP = 1.0  # [rad] a quadratic model says nothing beyond
BOUND_PASSES = 2  # times that joints which pass a limit are held there and the others solved again
SETTLED = 1e-8  # [m] less progress of the nearest descent in `PATIENCE` steps ends a stage
PATIENCE = 8


class Stage(NamedTuple):
    """How the descents go on for a while."""

    convex: bool
    """On the bound of the measure that is quadratic in the errors: robust, and slow near the end."""
    smoothing: float
    """Of the measure [m]."""
    steps: int
    """At most."""
    kept: int
    """How many descents go on to the next stage."""


class State(NamedTuple):
    """What k descents go on with."""

    q: Array
    """(k, dof)."""
    duals: Duals | None
    """None for those that belong to `q`."""
    damping: Array
    """(k,)."""

    def at(self, rows: NDArray[np.intp]) -> State:
        """Some of the descents."""
        duals = None if self.duals is None else Duals(*(column[rows] for column in self.duals))
        return State(self.q[rows], duals, self.damping[rows])


def begin(q: Array) -> State:
    """Descents from configurations (k, dof)."""
    return State(q, None, np.full(len(q), DAMPING))


def descend(measure: Measure, state: State, stage: Stage, lower: Array, upper: Array) -> tuple[int, State]:
    """The descents after the steps of a stage, and how many steps those were."""
    points = measure.points(state.q, stage.smoothing, state.duals, convex=stage.convex)
    duals = state.duals or Duals(points.position, points.rotation)
    curvature = _positive(points.hessian, stage)
    damping = state.damping
    best = [np.inf] * PATIENCE
    for taken in range(stage.steps):
        best.append(float(points.value.min()))
        if best[-1 - PATIENCE] - best[-1] < SETTLED:
            return taken, State(points.q, duals, damping)
        step = _bounded_step(points, curvature, damping, lower, upper)
        moved = np.clip(points.q + step, lower, upper)
        step = moved - points.q
        new_duals = duals_after(points, duals, step)
        new = measure.points(moved, stage.smoothing, new_duals, convex=stage.convex)
        foretold = -(points.gradient * step).sum(1) - 0.5 * ((step[:, None] @ curvature)[:, 0] * step).sum(1)
        ratio = (points.value - new.value) / np.maximum(foretold, 1e-300)
        better = new.value < points.value
        points = points.updated(better, new)
        duals = Duals(*(np.where(better[:, None], new, old) for old, new in zip(duals, new_duals, strict=True)))
        curvature = np.where(better[:, None, None], _positive(new.hessian, stage), curvature)
        damping = np.where(ratio > GOOD_MODEL, np.maximum(LESS_DAMPING * damping, LEAST_DAMPING), damping)
        damping = np.where(ratio < BAD_MODEL, np.minimum(MORE_DAMPING * damping, MOST_DAMPING), damping)
    if stage.convex:  # its damping and vectors mean little to the measure itself
        return stage.steps, begin(points.q)
    return stage.steps, State(points.q, duals, damping)


def _positive(hessian: Array, stage: Stage) -> Array:
    """Hessians with their eigenvalues made positive: saddle points repel."""
    if stage.convex:
        return hessian
    values, vectors = np.linalg.eigh(hessian)
    return np.asarray((vectors * np.abs(values)[:, None]) @ vectors.transpose(0, 2, 1))


def _bounded_step(points: Points, curvature: Array, damping: Array, lower: Array, upper: Array) -> Array:
    """Steps (k, dof) to the minimum of the damped model; joints that would pass a limit end on it."""
    q, gradient = points.q, points.gradient
    unit = np.eye(q.shape[1])
    matrix = curvature + damping[:, None, None] * unit
    held = ((q <= lower) & (gradient > 0.0)) | ((q >= upper) & (gradient < 0.0))
    step = np.zeros_like(q)
    for _ in range(BOUND_PASSES):
        given = np.where(held, step, 0.0)
        rest = gradient + (matrix @ given[:, :, None])[:, :, 0]
        free = ~held
        reduced = np.where(free[:, :, None] & free[:, None], matrix, unit)
        solved = np.linalg.solve(reduced, np.where(held, 0.0, -rest)[:, :, None])[:, :, 0]
        step = np.where(held, given, solved)
        past = ((q + step < lower) | (q + step > upper)) & free
        if not past.any():
            break
        step = np.where(past, np.clip(q + step, lower, upper) - q, step)
        held = held | past
    longest = np.abs(step).max(axis=1, keepdims=True)
    return np.asarray(step * np.minimum(1.0, LONGEST_STEP / np.maximum(longest, 1e-300)))
