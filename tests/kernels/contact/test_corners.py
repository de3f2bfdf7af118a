"""Corners of flat shapes: whichever way one tilts, one that was told comes as near as any point does."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import place_links
from jacokin.kernels.contact.cloud_surface import AROUND_NUMBERS, MOST_AROUND
from jacokin.kernels.contact.pairs import CORNERS, FIRST_POINT, ONE_CORNER, SURFACE_NUMBERS, TILTS, measure_corners
from jacokin.kernels.contact.run import make_contact_work
from jacokin.kernels.contact.touching import Geometry
from jacokin.model.descriptions import mjcf
from jacokin.model.mujoco_twin import shapes_of_twin
from tests.compiled_twin import contact_arrays
from tests.kernels.contact.calls import measured_pairs

GEOM = mujoco.mjtGeom
HALF = np.array([0.04, 0.07, 0.02])  # [m]
BELOW = {
    "a table": (GEOM.mjGEOM_BOX, [0.3, 0.3, 0.02]),
    "a floor": (GEOM.mjGEOM_PLANE, [0.0, 0.0, 1.0]),
    "a smaller block": (GEOM.mjGEOM_BOX, [0.02, 0.03, 0.02]),
}
ABOVE = {
    "a box": (GEOM.mjGEOM_BOX, HALF),
    "a capsule on its side": (GEOM.mjGEOM_CAPSULE, [0.02, 0.06, 0.0]),
    "a dish": (GEOM.mjGEOM_MESH, HALF),
}
#: Radius and height [m] of the rings of a dish: its side rises by 0.03, then by 0.2.
RINGS = (0.015, -0.02), (0.035, -0.0194), (0.055, -0.0154)


def flight(below: str, above: str) -> Geometry:
    """A shape that flies freely above one that stands still."""
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body()
    body.add_geom(type=BELOW[below][0], size=BELOW[below][1])
    for number, axis in enumerate(np.eye(3)[[0, 1, 2, 2, 1, 0]]):
        body = body.add_body()
        body.mass, body.inertia, body.explicitinertial = 1.0, np.ones(3), True
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE if number < 3 else mujoco.mjtJoint.mjJNT_HINGE, axis=axis)
    quat = pin.Quaternion(pin.utils.rotate("x", 0.5 * np.pi if "capsule" in above else 0.0))
    geom = body.add_geom(type=ABOVE[above][0], size=ABOVE[above][1], quat=quat.coeffs()[[3, 0, 1, 2]])
    if ABOVE[above][0] == GEOM.mjGEOM_MESH:
        angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
        circle = np.column_stack([np.cos(angles), np.sin(angles)])
        points = np.vstack([np.column_stack([r * circle, np.full(24, z)]) for r, z in (*RINGS, (0.055, 0.02))])
        spec.add_mesh(name="dish", uservert=points.ravel())
        geom.meshname = "dish"
    compiled = spec.compile()
    return contact_arrays(mjcf.to_pinocchio(compiled, "flight"), shapes_of_twin(compiled), [], [0]).geometry


PAIR = np.array([[0, 1]])  # what flies, and what stands


def corners(geometry: Geometry, q: Array) -> Array:
    """Numbers of the pair, and of its corners, at a configuration (6,)."""
    work, rows = make_contact_work(geometry, 1), np.zeros((1 + CORNERS, SURFACE_NUMBERS))
    place_links(geometry.arm, 6, len(geometry.arm.groups), q, work.places)
    around = np.zeros((MOST_AROUND, AROUND_NUMBERS))
    return rows[: measure_corners(geometry.shapes, work.places, work.hits.pair, PAIR[0], around, rows)]


def turn(q: Array) -> Array:
    """(3, 3) of what flies."""
    yaw, pitch, roll = (pin.utils.rotate(axis, angle) for axis, angle in zip("zyx", q[3:], strict=True))
    return np.asarray(yaw @ pitch @ roll)


def nearest(geometry: Geometry, q: Array) -> Array:
    """The point (3,) [m] of what flies, in its frame, that is nearest to what stands."""
    point = measured_pairs(geometry, PAIR, q[np.newaxis])[0, 0, FIRST_POINT : FIRST_POINT + 3]
    return np.asarray(turn(q).T @ (point - q[:3]))


@pytest.mark.parametrize("above", ABOVE)
@pytest.mark.parametrize("below", BELOW)
def test_however_a_flat_shape_tilts_a_corner_that_was_told_comes_nearest(
    below: str, above: str, rng: np.random.Generator
) -> None:
    geometry = flight(below, above)
    for yaw in rng.uniform(-np.pi, np.pi, 5):
        flat = np.array([0.005, -0.003, 0.08, yaw, 0.0, 0.0])
        rows = corners(geometry, flat)
        told = (rows[:, FIRST_POINT : FIRST_POINT + 3] - flat[:3]) @ turn(flat)
        for size, angle in itertools.product(TILTS, rng.uniform(0.0, 2.0 * np.pi, 10)):
            tilted = turn(flat) @ pin.exp3(size * np.array([np.cos(angle), np.sin(angle), 0.0]))
            point = nearest(geometry, np.r_[flat[:3], pin.rpy.matrixToRpy(tilted)[::-1]])
            fallen = -(tilted @ point)[2] - HALF[2]
            assert (-(told @ tilted.T)[:, 2]).max() - HALF[2] > 0.9 * fallen - ONE_CORNER * size / max(TILTS)
            if above != "a dish":
                np.testing.assert_allclose(rows[:, 0], rows[0, 0], atol=1e-9)  # flat: all of them are as near


@pytest.mark.parametrize("below", ["a table", "a floor"])
def test_a_shape_that_is_no_side_down_has_one_corner(below: str, rng: np.random.Generator) -> None:
    """Whatever turns a little, its lowest vertex stays the nearest one."""
    geometry = flight(below, "a box")
    for yaw in rng.uniform(-np.pi, np.pi, 5):
        rows = corners(geometry, np.array([0.005, -0.003, 0.12, yaw, 0.5, 0.6]))
        assert len(rows) == 1
        assert rows[0, 0] == pytest.approx(
            measured_pairs(geometry, PAIR, np.array([[0.005, -0.003, 0.12, yaw, 0.5, 0.6]]))[0, 0, 0], abs=1e-12
        )
