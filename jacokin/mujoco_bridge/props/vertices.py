"""Sites at the corners of a box, by which its lowest point is found."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np

from jacokin.mujoco_bridge import workspaces
from jacokin.mujoco_bridge.props import table


def add_vertex_sites(body: mujoco.MjsBody, box: mujoco.MjsGeom | mujoco.MjsSite) -> list[mujoco.MjsSite]:
    """Add a site ``vertex_0`` .. ``vertex_7`` at each corner of a box whose axes are those of its body.

    Args:
        body: the body of the box.
        box: a geom or site of type box.
    """
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    radius = table.load()["vertices"]["site_radius"]
    return [
        body.add_site(
            name=f"vertex_{number}",
            pos=box.pos + corner * box.size,
            size=[radius] * 3,
            rgba=workspaces.RED,
            group=workspaces.SITE_GROUP,
        )
        for number, corner in enumerate(corners)
    ]
