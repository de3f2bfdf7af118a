"""Configurations that reach a position with some orientation, for the QP to start from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik import seeds
from jacokin.ik.targets import TargetPose

#: Orientations that are tried, one after another until there are enough members.
ORIENTATIONS = 200
#: Members that are enough.
ENOUGH = 5

#: The configuration (dof,) within the limits nearest to a seed (dof,) that reaches a pose; None for none.
Nearest = Callable[[TargetPose, Array], Array | None]


def members(nearest: Nearest, position: Array, rotation: Array, seed: Array) -> list[Array]:
    """Configurations (dof,) that reach a position, nearest to the seed first; the same ones every time.

    Args:
        nearest: solves for one orientation.
        position: (3,) [m].
        rotation: (3, 3) of the tool at the seed, tried first, then turned by larger and larger angles.
        seed: (dof,) [rad].
    """
    rng = np.random.default_rng(seeds.DEFAULT_RANDOM_SEED)
    found: list[Array] = []
    for number in range(ORIENTATIONS):
        axis = rng.normal(size=3)
        turn = np.pi * number / ORIENTATIONS * axis / np.linalg.norm(axis)
        T = pin.SE3(rotation @ pin.exp3(turn), position)
        q = nearest(TargetPose(T.homogeneous, position_only=False), seed)
        if q is not None:
            found.append(q)
            if len(found) == ENOUGH:
                break
    return sorted(found, key=lambda q: float(np.linalg.norm(q - seed)))
