"""Boxes from which poses are drawn, and sites that show them and the goals of tasks."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.model import checks
from jacokin.mujoco_bridge.distributions import check_corners

SITE_GROUP = 3  # of sites of tasks, which MuJoCo does not draw unless told to

RED = (1.0, 0.0, 0.0, 0.3)
GREEN = (0.0, 1.0, 0.0, 0.3)
BLUE = (0.0, 0.0, 1.0, 0.3)
CYAN = (0.0, 1.0, 1.0, 0.3)
MAGENTA = (1.0, 0.0, 1.0, 0.3)
YELLOW = (1.0, 1.0, 0.0, 0.3)


class BoundingBox(NamedTuple):
    """A box with axes of the world: two opposite corners [m]."""

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]


def add_bbox_site(
    body: mujoco.MjsBody,
    lower: ArrayLike,
    upper: ArrayLike,
    visible: bool = False,
    *,
    name: str = "",
    rgba: ArrayLike = BLUE,
) -> mujoco.MjsSite:
    """Add a site that shows a box.

    Args:
        body: the body it belongs to, such as ``arena.mjcf_model.worldbody``.
        lower: (3,) the lower corner in the body's frame [m].
        upper: (3,) the upper corner [m].
        visible: whether it is drawn by default.
        name: name of the site.
        rgba: colour, 0..1.

    Raises:
        InvalidInputError: not a body, malformed corners, lower above upper, or another argument is malformed.
    """
    low, high = check_corners(lower, upper)
    size = np.maximum((high - low) / 2.0, 1e-6)  # [m] MuJoCo refuses sites without extent
    return _add_site(body, mujoco.mjtGeom.mjGEOM_BOX, (low + high) / 2.0, size, visible, name, rgba)


def add_target_site(
    body: mujoco.MjsBody, radius: float, visible: bool = False, *, name: str = "", rgba: ArrayLike = RED
) -> mujoco.MjsSite:
    """Add a spherical site that shows a goal, at the origin of a body.

    Args:
        body: the body it belongs to.
        radius: of the sphere [m].
        visible: whether it is drawn by default.
        name: name of the site.
        rgba: colour, 0..1.

    Raises:
        InvalidInputError: not a body, the radius is not positive, or another argument is malformed.
    """
    size = np.full(3, checks.positive("radius", radius, "m"))
    return _add_site(body, mujoco.mjtGeom.mjGEOM_SPHERE, np.zeros(3), size, visible, name, rgba)


def _add_site(
    body: mujoco.MjsBody, kind: mujoco.mjtGeom, pos: Array, size: Array, visible: bool, name: str, rgba: ArrayLike
) -> mujoco.MjsSite:
    checks.instance("body", body, mujoco.MjsBody, "a body of an MjSpec, such as worldbody")
    return body.add_site(
        name=checks.text("name", name),
        type=kind,
        pos=pos,
        size=size,
        rgba=checks.vector("rgba", rgba, 4, "0..1"),
        group=0 if checks.flag("visible", visible) else SITE_GROUP,
    )
