"""`cut_again`, `cut_whole`: pieces of curves that leave the limits where curves meet: no crossing for the kernels.

A chord from one side of a singular configuration to the other has no points that its condition tells apart, and so no
place where a joint passes its limit. Points on such chords are found by least squares, and halving does the rest.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.families.curves import CurveProblem, FoundCurves, Piece, join_parts, whole_piece
from jacokin.ik.families.edge import Edge
from jacokin.kernels.self_motion.limit_cuts import SINGLE
from jacokin.model import angles
from jacokin.model.angles import TURN

#: [rad] a joint past its limit by no more is on it.
SLACK = 1e-9
#: Points on each chord that is looked at, and how near to a limit a joint may come there: a share of its length.
POINTS, NEAR = 8, 0.3
HALVINGS = 50
#: [rad] an end is known this well.
SAME_END = 1e-4
#: Smallest singular value of the nodes of chords that the kernels may not have seen a crossing on.
SINGULAR = 2e-2


def cut_whole(found: FoundCurves, branch: int, problem: CurveProblem, edge: Edge) -> list[Piece]:
    """The pieces of an arc within the limits, whatever the kernels made of them."""
    piece = whole_piece(found.arcs[branch], branch, found.ends[branch])
    return join_parts(list(cut_again(piece, problem, edge, everywhere=True)), problem.arm.parameter)


def cut_again(piece: Piece, problem: CurveProblem, edge: Edge, *, everywhere: bool = False) -> Iterator[Piece]:
    """What is left of a piece within the limits; chords that are regular are looked at too if `everywhere` says so."""
    limits = problem.arm.limits
    if np.abs(piece.ends[1] - piece.ends[0]).max() <= SINGLE:
        yield piece
        return
    piece = _with_exact_ends(piece, problem)
    coordinates, excess = _samples(piece, problem, edge, everywhere=everywhere)
    outside = excess.max(axis=1) > SLACK
    if not outside.any():
        yield piece
        return
    edges = np.flatnonzero(np.diff(np.concatenate([[True], outside, [True]])))
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        part = piece
        if end < len(outside):
            part = _ended(part, problem, float(coordinates[end - 1]), float(coordinates[end]), limits, side=1)
        if first > 0:
            part = _ended(part, problem, float(coordinates[first]), float(coordinates[first - 1]), limits, side=0)
        yield part


def _with_exact_ends(piece: Piece, problem: CurveProblem) -> Piece:
    """The same piece; where it ends on a limit just where curves meet, its end may be 1e-7 off."""
    ends = piece.ends.copy()
    for side, code in enumerate(piece.codes):
        if code >= 0:
            ends[side] = _settled(ends[side], code // 2, problem)
    return piece._replace(ends=ends)


def _settled(x: Array, joint: int, problem: CurveProblem) -> Array:
    """The point (7,) that closes next to one where a joint is on its limit; that itself where there is none."""
    exact = problem.settled(x, joint)
    return x if exact is None or np.abs(exact - x).max() >= SAME_END else exact


def _samples(piece: Piece, problem: CurveProblem, edge: Edge, *, everywhere: bool) -> tuple[Array, Array]:
    """Coordinates (m,) in order, of both ends and of points on chords near a limit and near a singular configuration.

    Also how far past their limits joints are there (m, 7).
    """
    nodes = piece.nodes
    excess = excess_of(nodes[:, :7], problem.arm.limits)
    lengths = np.linalg.norm(np.diff(nodes[:, :7], axis=0), axis=1)
    near = np.maximum(excess[:-1], excess[1:]).max(axis=1) > -NEAR * lengths
    if everywhere:
        near &= np.minimum(excess[:-1], excess[1:]).max(axis=1) < NEAR * lengths
    elif near.any():
        mobility = edge.mobility(nodes[:, :7], problem)
        near &= np.minimum(mobility[:-1], mobility[1:]) < SINGULAR
    low, high = piece.shares[0], len(nodes) - 2 + piece.shares[1]
    coordinates, rows = [low], [piece.ends[0]]
    for chord in np.flatnonzero(near).tolist():
        for share in (np.arange(POINTS) + 0.5) / POINTS:
            x = problem.at_share(nodes[chord : chord + 2], float(share)) if low < chord + share < high else None
            if x is not None:
                coordinates.append(chord + float(share))
                rows.append(x)
    return np.array([*coordinates, high]), excess_of(np.array([*rows, piece.ends[1]]), problem.arm.limits)


def excess_of(rows: Array, limits: Array) -> Array:
    """How far joints are past their limits (m, 7) [rad], < 0 within them; -inf where there are none."""
    limited = np.isfinite(limits).all(axis=0)
    middle, half = np.zeros(7), np.full(7, np.inf)
    middle[limited] = 0.5 * (limits[0, limited] + limits[1, limited])
    half[limited] = 0.5 * (limits[1, limited] - limits[0, limited])
    return np.asarray(np.abs(angles.wrap_to_pi(rows - middle)) - half)


def _ended(piece: Piece, problem: CurveProblem, inside: float, outside: float, limits: Array, *, side: int) -> Piece:
    """A piece that ends between two coordinates, where a joint comes to its limit: at its start or at its stop."""
    x = _point(piece, problem, inside)
    for _ in range(HALVINGS):
        middle = 0.5 * (inside + outside)
        y = _point(piece, problem, middle)
        if y is None or excess_of(y[np.newaxis], limits).max() > 0.0:
            outside = middle
        else:
            inside, x = middle, y
    assert x is not None  # both are points that were found
    joint = int(excess_of(x[np.newaxis], limits)[0].argmax())
    upper = int(angles.wrap_to_pi(x[joint] - 0.5 * limits[:, joint].sum()) > 0.0)
    level = float(limits[upper, joint])
    x = x.copy()
    x[joint] = level + TURN * round((float(x[joint]) - level) / TURN)
    x = _settled(x, joint, problem)  # the last halves may be of other curves
    chord = min(int(inside), len(piece.nodes) - 2)
    code, share = 2 * joint + upper, inside - chord
    if side:
        ends = np.array([piece.ends[0], x])
        return piece._replace(
            nodes=piece.nodes[: chord + 2], ends=ends, codes=(piece.codes[0], code), shares=(piece.shares[0], share)
        )
    ends = np.array([x, piece.ends[1]])
    return piece._replace(
        nodes=piece.nodes[chord:], ends=ends, codes=(code, piece.codes[1]), shares=(share, piece.shares[1])
    )


def _point(piece: Piece, problem: CurveProblem, coordinate: float) -> Array | None:
    low, high = piece.shares[0], len(piece.nodes) - 2 + piece.shares[1]
    if coordinate <= low or coordinate >= high:
        return np.asarray(piece.ends[0 if coordinate <= low else 1])
    chord = min(math.floor(coordinate), len(piece.nodes) - 2)
    return problem.at_share(piece.nodes[chord : chord + 2], coordinate - chord)
