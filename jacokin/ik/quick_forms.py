"""Which structure gives an arm's branches more directly than the determinant of its loop: `quick_form`.

Each labelling of the loop is looked at (see ``kernels.six_joints.loop``), so that the three axes that meet or are
parallel may be any that follow each other: of a wrist, of a shoulder, or between.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.kernels.six_joints.loop import (
    GENERAL,
    LABELLINGS,
    PARALLEL_AXES,
    SPHERICAL_WRIST,
    fill_links,
    joint_of,
)
from jacokin.kernels.tolerances import DISTINCT, EXACT_STRUCTURE

#: The link that carries the target, and no structure.
TARGET = 5


class QuickForm(NamedTuple):
    """A structure, where it is in the arm, and what the kernels must know about it."""

    kind: int
    """`GENERAL` for none, `SPHERICAL_WRIST` or `PARALLEL_AXES`."""
    labelling: int
    """In which the structure has its place."""
    first: float
    """Where axes 4 and 5 of a wrist meet on axis 4; or axes 5 and 6 on axis 5, lengths scaled."""
    second: float
    """Where that point is on axis 6."""
    joints: tuple[int, ...]
    """The three joints, from 1."""
    rank: int
    """The lower, the quicker."""

    @property
    def sentence(self) -> str:
        """How poses are solved."""
        names = "{}, {} and {}".format(*self.joints) if self.joints else ""
        if self.kind == SPHERICAL_WRIST:
            return f"every branch, in closed form: axes {names} meet in one point"
        if self.kind == PARALLEL_AXES:
            return f"every branch, in closed form: axes {names} are parallel"
        return "every branch, from a determinant of the closed loop"


NO_FORM = QuickForm(GENERAL, 0, 0.0, 0.0, (), 0)


def quick_form(chain: NDArray[np.float64], scale: float) -> QuickForm:
    """The quickest form that fits a chain (7, 3, 4) to rounding; `NO_FORM` for none.

    Args:
        chain: placements between joints that turn about z.
        scale: what lengths are multiplied by [1/m].
    """
    ways = np.zeros((2, 6, 3, 4))  # the links forwards, and backwards
    fill_links(chain, np.eye(4), scale, 0, ways[0])
    fill_links(chain, np.eye(4), scale, 6, ways[1])
    found = []
    for labelling in range(LABELLINGS):
        backwards, begin = divmod(labelling, 6)
        links = ways[backwards, (np.arange(6) + (-begin if backwards else begin)) % 6]
        carrier = next(i for i in range(6) if link_of(labelling, i) == TARGET)
        found += [
            form for form in (wrist_form(links, labelling, carrier), plane_form(links, labelling, carrier)) if form
        ]
    return min(found, key=lambda form: form.rank, default=NO_FORM)


def link_of(labelling: int, i: int) -> int:
    """Which link of the loop, from 0, L_(i + 1) is."""
    return (labelling + i) % 6 if labelling < 6 else (labelling - i - 1) % 6


def wrist_form(links: NDArray[np.float64], labelling: int, carrier: int) -> QuickForm | None:
    """Axes 4, 5 and 6 meet, and axes 1 and 2 clearly do or do not, nor are they parallel."""
    if carrier in (0, 3, 4):
        return None
    if min(sine_of(links[3]), sine_of(links[4])) < DISTINCT:
        return None
    if max(distance_of(links[3]), distance_of(links[4])) > 2.0 * EXACT_STRUCTURE:
        return None
    origins, axes = [np.zeros(3)], [np.array([0.0, 0.0, 1.0])]
    rotation, position = np.eye(3), np.zeros(3)
    for link in links[3:5]:
        position, rotation = position + rotation @ link[:, 3], rotation @ link[:, :3]
        origins.append(position)
        axes.append(rotation[:, 2].copy())
    projections = [np.eye(3) - np.outer(axis, axis) for axis in axes]
    right = np.concatenate([P @ p for P, p in zip(projections, origins, strict=True)])
    point = np.linalg.lstsq(np.concatenate(projections), right, rcond=None)[0]
    if max(np.linalg.norm(P @ (point - p)) for P, p in zip(projections, origins, strict=True)) > EXACT_STRUCTURE:
        return None
    # Axis 1 and the way to axis 2, in the axes of joint 2: their cross product along axis 2 vanishes where they meet.
    u, v = links[0, :, :3].T @ links[0, :, 3], links[0, 2, :3]
    apart = abs(u[0] * v[1] - u[1] * v[0])
    long = max(np.hypot(*u[:2]), np.hypot(*v[:2]))
    if long < DISTINCT or EXACT_STRUCTURE < apart < DISTINCT:
        return None
    first, second = float(point[2]), float(rotation[:, 2] @ (point - position))
    joints = tuple(sorted(joint_of(labelling, i) + 1 for i in (3, 4, 5)))
    return QuickForm(SPHERICAL_WRIST, labelling, first, second, joints, 0 if apart <= EXACT_STRUCTURE else 2)


def plane_form(links: NDArray[np.float64], labelling: int, carrier: int) -> QuickForm | None:
    """Axes 2, 3 and 4 are parallel, 5 and 6 meet, and axis 1 is none of the former."""
    if carrier in (1, 2, 3, 4) or max(sine_of(links[1]), sine_of(links[2])) > EXACT_STRUCTURE:
        return None
    if min(np.hypot(*links[i, :2, 3]) for i in (1, 2)) < DISTINCT or min(sine_of(links[i]) for i in (3, 4)) < DISTINCT:
        return None
    if carrier != 0 and sine_of(links[0]) < DISTINCT:
        return None
    t, z = links[4, :, 3], links[4, :, 2]
    across = np.array([-z[1], z[0], 0.0]) / np.hypot(z[0], z[1])
    if abs(across @ t) > EXACT_STRUCTURE:
        return None
    # The point t - s z on axis 6 that is on axis 5, too.
    s = float(t[:2] @ z[:2] / (z[:2] @ z[:2]))
    first, second = float(t[2] - s * z[2]), -s
    joints = tuple(sorted(joint_of(labelling, i) + 1 for i in (1, 2, 3)))
    return QuickForm(PARALLEL_AXES, labelling, first, second, joints, 1)


def sine_of(link: NDArray[np.float64]) -> float:
    """The sine of the angle between the axes at both ends of a link (3, 4)."""
    return float(np.hypot(link[0, 2], link[1, 2]))


def distance_of(link: NDArray[np.float64]) -> float:
    """The distance of the axes at both ends of a link (3, 4), which are not parallel."""
    return abs(float(link[1, 3] * link[0, 2] - link[0, 3] * link[1, 2])) / sine_of(link)
