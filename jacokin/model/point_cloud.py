"""`PointCloud`: an obstacle of points, as a camera sees them."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.kernels.contact.cloud_tree import build_cloud, make_cloud_tree
from jacokin.kernels.library import Call
from jacokin.model import checks, point_files, poses
from jacokin.model.descriptions.shapes import Shape

if TYPE_CHECKING:
    import mujoco

NAME = "the name of an obstacle"
RADIUS = 0.005  # [m] half of what lies between two points of a depth camera a metre and a half away, and its noise
SMALLEST = 1e-6  # [m] MuJoCo wants a radius
FARTHEST = 1e6  # [m] farther points are a mistake, and their squares lose what contact is computed with


@dataclass(frozen=True, slots=True, eq=False)
class PointCloud:
    """Points with a sphere around each; between the spheres is nothing, and nothing is behind them.

    A surface holds only where its points lie closer to each other than twice the radius.

    Attributes:
        name: name of the shape.
        points: (n, 3) in the frame of the cloud, that of the base without a pose [m]; read-only.
        radius: of the spheres [m].
        pose: T_base_cloud, or the position of its frame (3,) [m].
        solid: the same as contact takes it; not given.
    """

    name: str
    points: ArrayLike
    radius: float = RADIUS
    pose: pin.SE3 | ArrayLike = (0.0, 0.0, 0.0)
    solid: Shape = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check the numbers, and sort the points into a tree."""
        checks.word(NAME, self.name)
        points = checked_points(f"{self.name}: points", self.points)
        if not len(points):
            raise InvalidInputError(f"{self.name}: points is empty; leave a cloud without points out of the scene")
        radius = checks.non_negative(f"{self.name}: radius", self.radius, "m")
        pose = poses.checked_place(f"{self.name}: pose", self.pose)
        object.__setattr__(self, "points", checks.read_only(points))
        object.__setattr__(self, "radius", radius)
        object.__setattr__(self, "pose", pose)
        build = Call(build_cloud, make_cloud_tree(points))
        build()
        size = np.array([radius, 0.0, 0.0])
        object.__setattr__(self, "solid", Shape(self.name, "cloud", size, 0, pose, cloud=build.work))

    def __repr__(self) -> str:
        """Its name, and how many points it has."""
        return f"PointCloud({self.name!r}, {len(self)} points, radius={self.radius:g})"

    def __len__(self) -> int:
        """Number of points."""
        return len(np.asarray(self.points))

    def at(self, pose: pin.SE3 | ArrayLike) -> Self:
        """This cloud elsewhere; its points and their tree are shared.

        Raises:
            InvalidInputError: a malformed pose.
        """
        there, moved = poses.checked_place(f"{self.name}: pose", pose), copy.copy(self)
        object.__setattr__(moved, "pose", there)
        object.__setattr__(moved, "solid", self.solid._replace(placement=there))
        return moved

    def add_to(self, body: mujoco.MjsBody) -> None:
        """Add the spheres to the base body, one by one, the first with the name of the cloud: for few points."""
        assert isinstance(self.pose, pin.SE3)  # __post_init__ made it one
        import mujoco  # an arm alone is checked without it

        for k, point in enumerate(np.asarray(self.points)):
            body.add_geom(
                name=self.name if k == 0 else f"{self.name}_{k}",
                type=mujoco.mjtGeom.mjGEOM_SPHERE,
                size=[max(self.radius, SMALLEST), 0.0, 0.0],
                pos=self.pose.act(point),
                contype=0,
                conaffinity=0,
            )

    def some_points(self, most: int) -> Array:
        """So many of its points at most, spread evenly over the cloud: (n, 3) in the base [m]."""
        assert isinstance(self.pose, pin.SE3)  # __post_init__ made it one
        assert self.solid.cloud is not None
        points = self.solid.cloud.points
        some = points[:: -(-len(points) // most)]
        return np.asarray(some @ self.pose.rotation.T + self.pose.translation)

    @classmethod
    def load(
        cls, path: str | Path, *, name: str, radius: float = RADIUS, pose: pin.SE3 | ArrayLike = (0.0, 0.0, 0.0)
    ) -> Self:
        """Read the points of a .ply or .npz file, as `save` writes them.

        Of a .ply file, text or binary, x, y and z of its vertices are read [m], of an .npz file the array `points`.

        Args:
            path: the file.
            name: as in `PointCloud`, as are the others.
            radius: [m].
            pose: T_base_cloud.

        Raises:
            InvalidInputError: no such file, another ending, malformed, or points that are not finite.
        """
        return cls(name, point_files.read_points(checks.path("path", path, "a file name")), radius, pose)

    def save(self, path: str | Path) -> None:
        """Write the points, in the frame of the cloud, to a .ply file (binary, as doubles) or an .npz file.

        Raises:
            InvalidInputError: another ending, or the file cannot be written.
        """
        point_files.write_points(checks.path("path", path, "a file name"), np.asarray(self.points))


def checked_points(name: str, points: ArrayLike) -> Array:
    """Points (n, 3) [m]; n may be zero.

    Raises:
        InvalidInputError: another shape, not finite, or farther than 1,000 km.
    """
    rows = checks.array(name, points, "rows of 3 numbers", "m")
    if rows.size == 0 and rows.ndim < 3 and rows.shape[-1] in (0, 3):
        return np.zeros((0, 3))
    try:
        rows = checks.matrix(name, rows, 3, "m")
    except InvalidInputError as error:
        if rows.ndim == 2 and rows.shape[1] == 3:
            raise InvalidInputError(f"{error}; keep points[np.isfinite(points).all(axis=1)]") from None
        raise
    if np.abs(rows).max() > FARTHEST:
        raise InvalidInputError(f"{name} must be within {FARTHEST:g} m")
    return rows
