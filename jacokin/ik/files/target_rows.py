"""Rows of numbers as targets: which columns mean what, and which rows cannot be solved."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.files.columns import MATRIX, QUATERNION, RPY
from jacokin.ik.files.orientations import rotations_from_quats, rotations_from_rpys
from jacokin.model.poses import RIGID_TOLERANCE


@dataclass(frozen=True, slots=True, eq=False)
class TargetFile:
    """Targets as a file gives them."""

    columns: tuple[str, ...]
    """x, y, z [m], followed by qw, qx, qy, qz, by roll, pitch, yaw [rad], by the rotation matrix r11, r12, ..., r33, or
    by nothing where orientations are free."""
    values: Array
    """(n, len(columns)) as written."""
    targets: Array
    """(n, 4, 4) poses, or (n, 3) positions where orientations are free."""
    lines: NDArray[np.int_]
    """(n,) line of each row in a text file, the first line is 1; in other files the row, the first is 1."""
    problems: Mapping[int, str] = field(default_factory=dict)
    """Rows that are not targets, and why; their targets stand for nothing."""

    def __len__(self) -> int:
        """Number of targets."""
        return len(self.values)


def target_rows(columns: tuple[str, ...], values: Array, lines: NDArray[np.int_]) -> TargetFile:
    """Targets of rows (n, len(columns)) of numbers, which need not be finite."""
    problems = {
        int(row): f"{columns[int(np.argmin(np.isfinite(values[row])))]} is not finite"
        for row in np.flatnonzero(~np.isfinite(values).all(axis=1))
    }
    usable = values
    if problems:
        usable = values.copy()
        usable[list(problems)] = _anywhere(columns)
    orientation = columns[3:]
    if not orientation:
        return TargetFile(columns, values, usable, lines, problems)
    matrices = np.zeros((len(values), 4, 4))
    matrices[:, 3, 3] = 1.0
    matrices[:, :3, 3] = usable[:, :3]
    wrong: NDArray[np.int_] = np.empty(0, dtype=np.int_)
    if orientation == RPY:
        rotations = rotations_from_rpys(usable[:, 3:])
    elif orientation == QUATERNION:
        rotations, wrong = rotations_from_quats(usable[:, 3:])
        for row in wrong:
            norm = math.hypot(*values[row, 3:])
            problems[int(row)] = f"quat_wxyz must have norm 1 (within 1 %), got norm {norm:.6g}"
    else:
        rotations = usable[:, 3:].reshape(-1, 3, 3).copy()
        wrong = _not_rigid(rotations)
        problems |= {int(row): f"{MATRIX[0]} ... {MATRIX[-1]} is not a rotation matrix" for row in wrong}
    rotations[wrong] = np.eye(3)
    matrices[:, :3, :3] = rotations
    return TargetFile(columns, values, matrices, lines, problems)


def _anywhere(columns: tuple[str, ...]) -> Array:
    """A row that is a target."""
    if columns[3:] == QUATERNION:
        return np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    if columns[3:] == MATRIX:
        return np.concatenate([np.zeros(3), np.eye(3).ravel()])
    return np.zeros(len(columns))


def _not_rigid(rotations: Array) -> NDArray[np.int_]:
    """Rows of (n, 3, 3) that are not rotations within the tolerance of single targets."""
    with np.errstate(over="ignore", invalid="ignore"):
        misfit = np.abs(np.swapaxes(rotations, 1, 2) @ rotations - np.eye(3)).max(axis=(1, 2))
        good = (misfit <= RIGID_TOLERANCE) & (np.linalg.det(rotations) > 0.0)
    return np.flatnonzero(~good)
