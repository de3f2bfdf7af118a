"""`depth_points`: the points that a depth camera sees, in the base."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks, poses


def depth_points(
    depth: ArrayLike, intrinsics: ArrayLike, T_base_camera: pin.SE3 | ArrayLike, *, farthest: float | None = None
) -> Array:
    """The points of a depth image: a point for each pixel that has a depth.

    Args:
        depth: (rows, columns) along the optical axis, not along the ray [m]; zero, NaN and infinite where the camera
            sees nothing. Arrays of whole numbers are refused, as with most cameras these are millimetres.
        intrinsics: (4,) fx, fy, cx, cy, or the camera matrix (3, 3) without skew [pixel]. The centre of the first pixel
            is at (0, 0).
        T_base_camera: pose of the optical frame: z forwards, x to the right of the image, y downwards.
        farthest: [m] pixels that are deeper are left out; None for all.

    Returns:
        (n, 3) in the base [m], row by row.

    Raises:
        InvalidInputError: malformed.
    """
    if isinstance(depth, np.ndarray) and depth.dtype.kind in "iu":
        raise InvalidInputError(
            "depth must be in metres as floating-point numbers; of an image in millimetres give depth / 1000.0"
        )
    image = checks.array("depth", depth, "an image (rows, columns)", "m")
    if image.ndim != 2:
        raise checks.refusal("depth", "an image (rows, columns)", depth, "m")
    fx, fy, cx, cy = _intrinsics(intrinsics)
    pose = poses.checked_pose(T_base_camera, "T_base_camera")
    most = np.inf if farthest is None else checks.positive("farthest", farthest, "m")
    rows, columns = np.nonzero(np.isfinite(image) & (image > 0.0) & (image <= most))
    z = image[rows, columns]
    seen = np.column_stack([z * (columns - cx) / fx, z * (rows - cy) / fy, z])
    return np.asarray(seen @ pose.rotation.T + pose.translation)


def _intrinsics(value: ArrayLike) -> tuple[float, float, float, float]:
    """fx, fy, cx, cy [pixel].

    Raises:
        InvalidInputError: malformed, or a matrix of another camera model.
    """
    given = checks.array("intrinsics", value, "fx, fy, cx, cy or a camera matrix (3, 3)", "pixel")
    if given.shape == (3, 3):
        fixed = given[[0, 1, 2, 2, 2], [1, 0, 0, 1, 2]]
        if not np.array_equal(fixed, [0.0, 0.0, 0.0, 0.0, 1.0]):
            raise InvalidInputError("intrinsics must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] where they are a matrix")
        given = given[[0, 1, 0, 1], [0, 1, 2, 2]]
    fx, fy, cx, cy = checks.vector("intrinsics", given, 4, "pixel").tolist()
    return checks.positive("intrinsics: fx", fx, "pixel"), checks.positive("intrinsics: fy", fy, "pixel"), cx, cy
