"""Triangle meshes: boxes, spheres, cylinders, what a compiled MuJoCo model holds, and several in one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.model import poses

if TYPE_CHECKING:
    import mujoco


SIDES = 24  # of what is round
RINGS = 6  # from the equator of a sphere to its pole


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A triangle mesh."""

    vertices: NDArray[np.float32]
    """(v, 3) [m]."""
    faces: NDArray[np.uint32]
    """(f, 3) counter-clockwise from outside."""


def box(half: Array) -> Mesh:
    """A box by its half edges (3,) [m]."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [triangle for a, b, c, d in sides for triangle in ((a, b, c), (a, c, d))]
    return Mesh(corners.astype(np.float32), np.array(faces, dtype=np.uint32))


def turned(profile: list[tuple[float, float]]) -> Mesh:
    """The surface that a profile of (radius, z) [m], from bottom to top, sweeps around z; its ends lie on the axis."""
    angles = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    circle = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    inner = profile[1:-1]
    rings = [np.column_stack((radius * circle, np.full(SIDES, z))) for radius, z in inner]
    vertices = np.vstack(([[0.0, 0.0, profile[0][1]]], *rings, [[0.0, 0.0, profile[-1][1]]]))
    last = len(vertices) - 1
    faces = []
    for side in range(SIDES):
        after = (side + 1) % SIDES
        faces.append((0, 1 + after, 1 + side))
        for ring in range(len(inner) - 1):
            low, high = 1 + ring * SIDES, 1 + (ring + 1) * SIDES
            faces += [(low + side, low + after, high + after), (low + side, high + after, high + side)]
        top = 1 + (len(inner) - 1) * SIDES
        faces.append((top + side, top + after, last))
    return Mesh(vertices.astype(np.float32), np.array(faces, dtype=np.uint32))


def sphere(radius: float) -> Mesh:
    """A sphere by its radius [m]."""
    return capsule(radius, 0.0)


def capsule(radius: float, half: float) -> Mesh:
    """A capsule along z by its radius and half the length of its cylinder [m]."""
    rise = np.linspace(0.0, 0.5 * np.pi, RINGS + 1)
    upper = [(radius * float(np.cos(a)), half + radius * float(np.sin(a))) for a in rise[:-1]]
    lower = [(r, -z) for r, z in reversed(upper)]
    return turned([(0.0, -half - radius), *lower, *upper, (0.0, half + radius)])


def cylinder(radius: float, half: float) -> Mesh:
    """A cylinder along z by its radius and half its length [m]."""
    return turned([(0.0, -half), (radius, -half), (radius, half), (0.0, half)])


def placed(mesh: Mesh, rotation: Array, position: Array) -> Mesh:
    """A mesh elsewhere: rotated by (3, 3), then moved by (3,) [m]."""
    moved = mesh.vertices @ np.asarray(rotation).T + position
    return Mesh(moved.astype(np.float32), mesh.faces)


def of_geom(model: mujoco.MjModel, geom: int) -> Mesh | None:
    """One shape in the frame of its body; None for a kind without an end, such as a plane."""
    import mujoco

    kind, size = int(model.geom_type[geom]), np.array(model.geom_size[geom])
    kinds = mujoco.mjtGeom
    if kind == kinds.mjGEOM_BOX:
        mesh = box(size)
    elif kind == kinds.mjGEOM_SPHERE:
        mesh = sphere(float(size[0]))
    elif kind == kinds.mjGEOM_CAPSULE:
        mesh = capsule(float(size[0]), float(size[1]))
    elif kind == kinds.mjGEOM_CYLINDER:
        mesh = cylinder(float(size[0]), float(size[1]))
    elif kind == kinds.mjGEOM_ELLIPSOID:
        unit = sphere(1.0)
        mesh = Mesh((unit.vertices * size).astype(np.float32), unit.faces)
    elif kind == kinds.mjGEOM_MESH:
        mesh = of_stored(model, int(model.geom_dataid[geom]))
    else:
        return None
    w, x, y, z = (float(value) for value in model.geom_quat[geom])
    return placed(mesh, poses.rotation_from_quat_wxyz([w, x, y, z]), np.array(model.geom_pos[geom]))


def of_stored(model: mujoco.MjModel, mesh: int) -> Mesh:
    """A mesh of a compiled model: the convex hull that collides, where the file has no faces."""
    vertices = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
    faces = model.mesh_face[model.mesh_faceadr[mesh] :][: model.mesh_facenum[mesh]]
    return Mesh(np.array(vertices, dtype=np.float32), np.array(faces, dtype=np.uint32))


def merged(meshes: list[Mesh]) -> Mesh | None:
    """Several meshes as one; None for none."""
    if not meshes:
        return None
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + np.uint32(start) for mesh, start in zip(meshes, starts, strict=True)]
    return Mesh(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(faces))
