"""`PointCloud`: an obstacle of points, as a camera sees them; of a depth image, and of .ply and .npz files."""

from __future__ import annotations

import copy
import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin import files
from jacokin.arrays import Array, Sealed
from jacokin.errors import InvalidInputError
from jacokin.kernels.contact.cloud_tree import build_cloud, make_cloud_tree
from jacokin.kernels.library import Call
from jacokin.model import checks, poses
from jacokin.model.descriptions.shapes import Shape

if TYPE_CHECKING:
    import mujoco

NAME = "the name of an obstacle"
RADIUS = 0.005  # [m] half of what lies between two points of a depth camera a metre and a half away, and its noise
FARTHEST = 1e6  # [m] farther points are a mistake, and their squares lose what contact is computed with

ENDINGS = (".ply", ".npz")
# PLY's types, by both of their names, as NumPy's (Turk: The PLY Polygon File Format, 1994).
TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
TYPES |= {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
TYPES |= {"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"}
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@poses.giving_copies("pose")
@dataclass(frozen=True, slots=True, eq=False)
class PointCloud(Sealed):
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
                size=[max(self.radius, 1e-6), 0.0, 0.0],  # MuJoCo wants a radius
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
        return cls(name, read_points(checks.path("path", path, "a file name")), radius, pose)

    def save(self, path: str | Path) -> None:
        """Write the points, in the frame of the cloud, to a .ply file (binary, as doubles) or an .npz file.

        Raises:
            InvalidInputError: another ending, or the file cannot be written.
        """
        write_points(checks.path("path", path, "a file name"), np.asarray(self.points))


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


def read_points(path: Path) -> Array:
    """Points (n, 3) of a file.

    Raises:
        InvalidInputError: no such file, another ending, or malformed.
    """
    if _ending(path) == ".ply":
        return _read_ply(path)
    arrays = files.read_arrays(path, "is not an .npz file")
    if "points" not in arrays:
        raise InvalidInputError(f"{path}: has no array 'points', only {', '.join(map(repr, arrays)) or 'none'}")
    found = arrays["points"]
    if found.ndim != 2 or found.shape[1] != 3 or found.dtype.kind not in "iuf":
        raise InvalidInputError(f"{path}: 'points' must hold numbers of shape (n, 3), not {found.dtype} {found.shape}")
    return found.astype(np.float64)


def write_points(path: Path, points: Array) -> None:
    """Write points (n, 3) to a file.

    Raises:
        InvalidInputError: another ending, or it cannot be written.
    """
    ending = _ending(path)
    with files.replacing(path) as temporary, temporary.open("wb") as file:
        if ending == ".npz":
            np.savez_compressed(file, points=points)
            return
        properties = "".join(f"property double {axis}\n" for axis in "xyz")
        file.write(f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{properties}".encode())
        file.write(b"end_header\n" + np.ascontiguousarray(points, "<f8").tobytes())


def _ending(path: Path) -> str:
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise InvalidInputError(f"the file of a point cloud must end in {' or '.join(ENDINGS)}, got {str(path)!r}")
    return ending


class _Header(NamedTuple):
    """The vertices of a .ply file."""

    order: str
    """Of bytes, for NumPy; "" for text."""
    rows: int
    names: list[str]
    types: list[str]
    """NumPy's, without the order of bytes."""


def _read_ply(path: Path) -> Array:
    """The vertices (n, 3) of a .ply file; errors as of `read_points`."""
    content = files.read_bytes(path, 500_000_000)  # [byte] of a .ply file: 20 million points with three doubles each
    end = content.find(b"end_header", 0, 10_000)
    start = content.find(b"\n", end) + 1
    if not content.startswith(b"ply") or end < 0 or not start:
        raise InvalidInputError(f"{path}: is not a .ply file")
    try:
        header = _read_header(content[:end].decode("ascii").splitlines())
        columns = [header.names.index(axis) for axis in "xyz"]
        if header.order:
            dtype = np.dtype(list(zip(header.names, (header.order + kind for kind in header.types), strict=True)))
            if header.rows * dtype.itemsize > len(content) - start:
                raise ValueError(f"it ends before its {header.rows} vertices do")
            rows = np.frombuffer(content, dtype, header.rows, start)
            return np.column_stack([rows[axis].astype(np.float64) for axis in "xyz"]).reshape(-1, 3)
        lines = io.BytesIO(content[start:])
        words = [line.split() for _, line in zip(range(header.rows), lines, strict=False)]
        if len(words) < header.rows:
            raise ValueError(f"it ends before its {header.rows} vertices do")
        short = next((k for k, row in enumerate(words) if len(row) <= max(columns)), None)
        if short is not None:
            raise ValueError(
                f"its vertex {short} has {len(words[short])} numbers, its header names {len(header.names)}"
            )
        return np.array([[float(row[k]) for k in columns] for row in words]).reshape(-1, 3)
    except (ValueError, UnicodeDecodeError, MemoryError) as error:
        raise InvalidInputError(f"{path}: cannot be read as a .ply file: {error}") from error


def _read_header(lines: Sequence[str]) -> _Header:
    """What a header says of vertices.

    Raises:
        ValueError: not a header, or vertices do not come first.
    """
    order: str | None = None
    count, elements, names, types = -1, 0, list[str](), list[str]()
    for line in lines[1:]:
        match line.split():
            case ["format", name, _] if name in FORMATS:
                order = FORMATS[name]
            case ["element", name, number]:
                elements += 1
                if elements == 1:
                    if name != "vertex":
                        raise ValueError(f"its first element is {name!r}; vertices must come first")
                    count = int(number)
            case ["property", kind, name] if elements == 1:
                if kind not in TYPES:
                    raise ValueError(f"the vertices' {name!r} is of an unknown type, {kind!r}")
                names.append(name)
                types.append(TYPES[kind])
            case ["property", "list", *_] if elements == 1:
                raise ValueError("its vertices have lists")
            case _:  # comments, and other elements
                continue
    if order is None or count < 0:
        raise ValueError("its header gives no known format, or no vertices")
    for axis in "xyz":
        if axis not in names:
            raise ValueError(f"its vertices have no {axis!r}")
    return _Header(order, count, names, types)
