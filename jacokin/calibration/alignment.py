"""Where base, tool and touched places are, found with the described arm: what the estimate starts from.

A few rows may be far off: each is weighted by how well it fits the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.calibration.measurements import Measurements
from jacokin.errors import InvalidInputError

ROUNDS = 30
FEWEST = 3  # points that place a base, not on a line


class Seen(NamedTuple):
    """Finite rows of a set, and where the described arm has the frame."""

    rows: Measurements
    position: Array
    """(n, 3) of the frame in the base [m]."""
    rotation: Array
    """(n, 3, 3) of the frame in the base."""


@dataclass(frozen=True, slots=True, eq=False)
class FramePlace:
    """A touched plane or point."""

    point: Array
    """(3,) in the base [m]: on the plane, or the point itself."""
    normal: Array
    """(3,) of the plane."""
    axes: Array
    """(2, 3) along the plane."""


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """What was found; identities where nothing is unknown."""

    base: pin.SE3
    """T_sensor_base."""
    tools: dict[str | None, pin.SE3]
    """T_frame_target by frame, of unknown ones."""
    places: dict[int, FramePlace]
    """Of sets of contact, by their number."""


def find_reference(seen: Sequence[Seen]) -> Reference:
    """Place what is unknown.

    Raises:
        InvalidInputError: a base is unknown and no positions or poses place it.
    """
    base, tools = pin.SE3.Identity(), {each.rows.frame: pin.SE3.Identity() for each in seen if each.rows.tool is None}
    located = [each for each in seen if each.rows.kind in ("positions", "poses") and len(each.rows)]
    lost = [each for each in located if each.rows.base is None]
    if any(each.rows.base is None for each in seen):
        if sum(len(each.rows) for each in lost) < FEWEST:
            raise InvalidInputError(
                f"an unknown base needs at least {FEWEST} finite positions or poses that place it in the "
                "instrument's frame"
            )
        base = _place_base(lost, tools)
    for frame in tools:
        mine = [each for each in located if each.rows.tool is None and each.rows.frame == frame]
        if mine:
            tools[frame] = _place_tool(mine, base, tools[frame])
    places = {
        index: _place_contact(each, tools) for index, each in enumerate(seen) if each.rows.kind in ("plane", "point")
    }
    return Reference(base, tools, places)


def _measured(seen: Seen) -> Array:
    values = seen.rows.values
    return np.asarray(values if seen.rows.kind == "positions" else values[:, :3, 3])


def _place_base(lost: Sequence[Seen], tools: dict[str | None, pin.SE3]) -> pin.SE3:
    """T_sensor_base from positions and poses; unknown tools of theirs are placed along the way."""
    posed = [each for each in lost if each.rows.kind == "poses" and each.rows.tool is None]
    turned: pin.SE3 | None = None
    if posed:
        turned = _turn_both(posed, tools)
    base = pin.SE3.Identity()
    for _ in range(ROUNDS):
        ours = np.vstack([_points(each, tools) for each in lost])
        theirs = np.vstack([_measured(each) for each in lost])
        base = _fit_rigid(ours, theirs) if turned is None else turned
        if turned is not None:
            base = pin.SE3(turned.rotation, np.median(theirs - ours @ turned.rotation.T, axis=0))
        unknown = [each for each in lost if each.rows.tool is None]
        if not unknown:
            break
        for frame in {each.rows.frame for each in unknown}:
            mine = [each for each in unknown if each.rows.frame == frame]
            tools[frame] = _place_tool(mine, base, tools[frame])
    return base


def _points(seen: Seen, tools: dict[str | None, pin.SE3]) -> Array:
    """Where the described arm has the measured point (n, 3)."""
    tool = tools[seen.rows.frame] if seen.rows.tool is None else seen.rows.tool
    return np.asarray(seen.position + seen.rotation @ tool.translation)


def _place_tool(mine: Sequence[Seen], base: pin.SE3, known: pin.SE3) -> pin.SE3:
    """T_frame_target, its rotation only where poses show it."""
    shifts, turns = [], []
    for each in mine:
        T = base if each.rows.base is None else each.rows.base
        in_base = (_measured(each) - T.translation) @ T.rotation
        shifts.append(np.einsum("nji,nj->ni", each.rotation, in_base - each.position))
        if each.rows.kind == "poses":
            turns.append(np.swapaxes(each.rotation, 1, 2) @ T.rotation.T @ each.rows.values[:, :3, :3])
    rotation = _mean_rotation(np.concatenate(turns)) if turns else known.rotation
    return pin.SE3(rotation, np.median(np.vstack(shifts), axis=0))


def _turn_both(posed: Sequence[Seen], tools: dict[str | None, pin.SE3]) -> pin.SE3:
    """Rotations of base and tool from measured ones, R_sensor_base R_base_frame R_frame_target = R_measured.

    Linear in both (Shah, Solving the robot-world/hand-eye calibration problem using the Kronecker product, Journal of
    Mechanisms and Robotics 5(3), 2013).
    """
    frame = posed[0].rows.frame
    ours = np.concatenate([each.rotation for each in posed if each.rows.frame == frame])
    theirs = np.concatenate([each.rows.values[:, :3, :3] for each in posed if each.rows.frame == frame])
    # R_base_frame R_frame_target less R_sensor_base^T R_measured, both unknown, as vectors by columns.
    n, eye = len(ours), np.eye(3)
    first = np.einsum("ab,nij->naibj", eye, ours).reshape(n, 9, 9)
    second = np.einsum("nba,ij->naibj", theirs, eye).reshape(n, 9, 9)
    blocks = np.concatenate([first, -second], axis=2)
    weights = np.ones(n)
    base = tool = eye
    for _ in range(ROUNDS):
        vector = np.linalg.eigh(np.einsum("n,nij,nik->jk", weights**2, blocks, blocks))[1][:, 0]
        pair = vector[:9].reshape(3, 3, order="F"), vector[9:].reshape(3, 3, order="F")
        sign = np.sign(np.linalg.det(pair[0])) or 1.0
        tool, base = _nearest_rotation(sign * pair[0]), _nearest_rotation(sign * pair[1]).T
        missed = np.linalg.norm(base @ ours @ tool - theirs, axis=(1, 2))
        weights = _weights(missed)
    tools[frame] = pin.SE3(tool, tools[frame].translation)
    return pin.SE3(base, np.zeros(3))


def _place_contact(seen: Seen, tools: dict[str | None, pin.SE3]) -> FramePlace:
    """The place that touches say; what they leave open, as fewer than three do of a plane, is chosen."""
    points = _points(seen, tools)
    point = np.median(points, axis=0) if len(points) else np.zeros(3)
    axes = np.linalg.svd(points - point, full_matrices=len(points) < FEWEST)[2]
    return FramePlace(point, axes[2], axes[:2])


def _fit_rigid(ours: Array, theirs: Array) -> pin.SE3:
    """The pose that takes points (n, 3) to others (Kabsch), rows far off weighted down."""
    weights = np.ones(len(ours))
    found = pin.SE3.Identity()
    for _ in range(ROUNDS):
        share = (weights / weights.sum())[:, None]
        centre, other = (share * ours).sum(axis=0), (share * theirs).sum(axis=0)
        rotation = _nearest_rotation((share * (theirs - other)).T @ (ours - centre))
        found = pin.SE3(rotation, other - rotation @ centre)
        weights = _weights(np.linalg.norm(ours @ rotation.T + found.translation - theirs, axis=1))
    return found


def _weights(missed: Array) -> Array:
    """Small for rows much farther off than the others."""
    return np.asarray(1.0 / (1.0 + (missed / (np.median(missed) + 1e-12)) ** 2))


def _mean_rotation(rotations: Array) -> Array:
    mean = _nearest_rotation(rotations.mean(axis=0))
    for _ in range(ROUNDS):
        weights = _weights(np.linalg.norm(rotations - mean, axis=(1, 2)))
        mean = _nearest_rotation(np.einsum("n,nij->ij", weights, rotations))
    return mean


def _nearest_rotation(matrix: Array) -> Array:
    left, _, right = np.linalg.svd(matrix)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    return np.asarray((left * signs) @ right)


def rotation_of(vector: Array) -> Array:
    """Rotation (3, 3) of a rotation vector (3,) [rad]."""
    return np.asarray(pin.exp3(np.ascontiguousarray(vector)))


def left_jacobian(vector: Array) -> Array:
    """(3, 3) from the rate of a rotation vector (3,) to the angular velocity, in the axes it turns in."""
    return np.asarray(pin.Jexp3(np.ascontiguousarray(-vector)))
