"""An arm whose fourth and sixth link are less than 2 cm apart wherever they do not touch, and distances by MuJoCo."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from jacokin import Robot, load_robot
from jacokin.arrays import Array
from jacokin.model import to_mujoco
from tests.robot_files import ur5_text

CLEARANCE = 0.02  # [m]
NEIGHBOURS = frozenset(("l4#2", "l6#3"))
FAR = 0.1  # [m] larger distances are this one


def near_neighbours(folder: Path) -> Robot:
    """A UR5 with balls on some links: those on l4 and l6 are 20 mm apart to 4 mm deep, as the fifth joint turns.

    The one on the base is met by the other two where the arm reaches back.
    """
    text = ur5_text()
    for link, place, radius in (
        ("l0", "0 0 0", 0.1),
        ("l3", "0 0 0.05", 0.05),
        ("l4", "0.012 0.093 0.09465", 0.037),
        ("l6", "0 0.0823 0", 0.037),
    ):
        ball = f'<collision><origin xyz="{place}"/><geometry><sphere radius="{radius}"/></geometry></collision>'
        text = text.replace(f'<link name="{link}"></link>', f'<link name="{link}">{ball}</link>')
    path = folder / "near_neighbours.urdf"
    path.write_text(text)
    return load_robot(path)


def own_distances(robot: Robot, rows: Array) -> dict[frozenset[str], Array]:
    """Distances (n,) of the arm's own shapes at configurations (n, dof) by MuJoCo, up to `FAR` [m]."""
    model = to_mujoco(robot, geometry=True)
    data, found = mujoco.MjData(model), np.empty((len(rows), model.npair))
    for row, q in zip(found, rows, strict=True):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        row[:] = [
            mujoco.mj_geomDistance(model, data, a, b, FAR, None)
            for a, b in zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True)
        ]
    names = [model.geom(k).name for k in range(model.ngeom)]
    pairs = zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True)
    return {frozenset((names[a], names[b])): column for (a, b), column in zip(pairs, found.T, strict=True)}


def of_neighbours_and_others(robot: Robot, rows: Array) -> tuple[Array, Array]:
    """Distances (n,) of the two neighbours, and the least of all other pairs, by MuJoCo [m]."""
    found = own_distances(robot, rows)
    return found[NEIGHBOURS], np.min([each for pair, each in found.items() if pair != NEIGHBOURS], axis=0)
