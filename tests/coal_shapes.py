"""The shapes of a compiled MuJoCo model for coal, an engine of its own."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import coal
import mujoco
import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from jacokin.arrays import Array
from jacokin.model.obstacles import Obstacle

GEOM = mujoco.mjtGeom
Pair = tuple[int, int]


def coal_shape(model: mujoco.MjModel, geom: int) -> Any:
    """One geom."""
    kind, size = int(model.geom_type[geom]), np.array(model.geom_size[geom])
    if kind == GEOM.mjGEOM_PLANE:
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    if kind == GEOM.mjGEOM_SPHERE:
        return coal.Sphere(size[0])
    if kind == GEOM.mjGEOM_CAPSULE:
        return coal.Capsule(size[0], 2.0 * size[1])
    if kind == GEOM.mjGEOM_CYLINDER:
        return coal.Cylinder(size[0], 2.0 * size[1])
    if kind == GEOM.mjGEOM_BOX:
        return coal.Box(*(2.0 * size))
    if kind == GEOM.mjGEOM_ELLIPSOID:
        return coal.Ellipsoid(*size)
    assert kind == GEOM.mjGEOM_MESH
    mesh = int(model.geom_dataid[geom])
    first = int(model.mesh_vertadr[mesh])
    return convex(model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])].astype(np.float64))


def convex(points: Array) -> Any:
    """The hull of points (n, 3)."""
    hull = ConvexHull(points)
    triangles = np.searchsorted(np.sort(hull.vertices), hull.simplices)
    corners = points[np.sort(hull.vertices)]
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(triangles), len(corners))
    mesh.addVertices(corners)
    for triangle in triangles.tolist():
        mesh.addTriangle(*(corners[vertex] for vertex in triangle))
    mesh.endModel()
    mesh.buildConvexHull(True, "Qt")
    return mesh.convex


def coal_distance(shapes: tuple[Any, Any], poses: tuple[pin.SE3, pin.SE3]) -> float:
    """Distance of two shapes [m]; negative where they overlap."""
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.gjk_tolerance, request.gjk_max_iterations, request.epa_tolerance = 1e-9, 500, 1e-8
    places = [coal.Transform3s(pose.rotation, pose.translation) for pose in poses]
    return float(coal.distance(shapes[0], places[0], shapes[1], places[1], request, result))


def collision_pairs(model: mujoco.MjModel, obstacles: Iterable[Obstacle], *, self_collision: bool = True) -> list[Pair]:
    """Pairs of geoms that may collide: each obstacle with each moving shape, and the arm's own pairs."""
    fixed = [int(model.geom(obstacle.name).id) for obstacle in obstacles]
    moving = [index for index in range(model.ngeom) if model.body_weldid[model.geom_bodyid[index]] > 0]
    found = [(a, b) for a in sorted(fixed) for b in moving]
    if self_collision:
        found.extend(zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True))
    return found
