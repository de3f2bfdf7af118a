"""Write the mesh of a mug: 90 mm high, 80 mm wide, walls of 4 mm, with a handle.

python examples/make_mug.py mug.obj
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import trimesh

HEIGHT, RADIUS, WALL = 0.09, 0.04, 0.004  # [m]
HANDLE, THICKNESS = 0.025, 0.005  # [m] radii of the ring that is the handle
SECTIONS = 48  # of a turn


def make_mug(*, handle: bool = True) -> trimesh.Trimesh:
    """The mug, its origin in the middle of its bottom, z upwards [m]; the handle is in the direction of x."""
    inside = _cylinder(RADIUS - WALL, WALL)
    outside = _cylinder(RADIUS, 0.0)
    if handle:
        ring = trimesh.creation.torus(HANDLE, THICKNESS, major_sections=32, minor_sections=12)
        quarter = np.diag((1.0, 0.0, 0.0, 1.0))  # about x
        quarter[1, 2], quarter[2, 1] = -1.0, 1.0
        ring.apply_transform(quarter)
        ring.apply_translation((RADIUS, 0.0, HEIGHT / 2.0))
        outside = trimesh.boolean.union([outside, ring])
    found: trimesh.Trimesh = trimesh.boolean.difference([outside, inside])
    return found


def write_mug(path: str | Path, *, handle: bool = True) -> Path:
    """Write the mesh; the ending of the file says in which format."""
    make_mug(handle=handle).export(str(path))
    return Path(path)


def _cylinder(radius: float, bottom: float) -> trimesh.Trimesh:
    cylinder: trimesh.Trimesh = trimesh.creation.cylinder(radius, HEIGHT, sections=SECTIONS)
    cylinder.apply_translation((0.0, 0.0, HEIGHT / 2.0 + bottom))
    return cylinder


if __name__ == "__main__":
    write_mug(sys.argv[1])
