"""Mesh files that descriptions name: where they are, what they hold in metres, and the convex hull that collides.

Every mesh is read here, whether it is drawn or collides, so that the same body has the same size in every format.
"""

from __future__ import annotations

import io
import itertools
import json
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import unquote, urlsplit

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ShapeError, shown
from jacokin.files import open_bytes, read_bytes

if TYPE_CHECKING:
    from scipy.spatial import ConvexHull

PACKAGE_SCHEMES = ("package", "model")
SEARCH_PATH = "ROS_PACKAGE_PATH"
FORMATS = (".stl", ".obj", ".dae", ".ply", ".off", ".glb", ".gltf")
LARGEST = 100_000_000  # [byte] of a file
MOST_VERTICES = 3_000_000  # of a file that says how many it has, or lists them as text: 0.5 GB
STL_HEADER, STL_FACE = 84, 50  # [byte] of a binary file
STL_CORNERS = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)

Z_UP = "Z_UP"

FARTHEST = 1e9  # [m] of a vertex; squares of larger numbers leave no digits for a hull
THIN = 1e-5  # [m] half the thickness that a flat mesh gets: a hull needs a volume


class TriangleMesh(NamedTuple):
    """Triangles of a file."""

    vertices: Array
    """(v, 3) [m]."""
    faces: NDArray[np.int64]
    """(f, 3) counter-clockwise from outside."""
    up_axis: str = Z_UP
    """Which axis the file says points up; its coordinates are those of the file all the same."""


def find_mesh(file_name: str, path: Path, package_dirs: Sequence[Path]) -> Path:
    """The file that a URDF at `path` means by the name of a mesh.

    Args:
        file_name: as in the URDF: package://, model:// or file://, or relative to the folder of the URDF.
        path: the URDF.
        package_dirs: folders that hold packages, searched before those of ROS_PACKAGE_PATH.

    Raises:
        ShapeError: there is none; says what to give for a package.
    """
    try:
        scheme, package, inside = urlsplit(file_name)[:3]
        found = next((each for each in _candidates(scheme, package, inside, file_name, path, package_dirs)), None)
    except (OSError, ValueError) as error:  # a name that no file can have
        reason = error.strerror if isinstance(error, OSError) else error
        raise ShapeError(f"{path}: mesh {shown(file_name)} cannot be a file: {reason}") from error
    if found is not None:
        return found
    advice = ""
    if scheme in PACKAGE_SCHEMES:
        advice = f"; give the folder that holds the package {package!r} with package_dirs= or {SEARCH_PATH}"
    elif scheme == "file" or Path(file_name).is_absolute():
        advice = ", a path of the machine that wrote the file; write one of this machine, or package://, in its place"
    raise ShapeError(
        f"{path}: mesh {shown(file_name)} is not found{advice}. Contact needs the meshes, kinematics does not"
    )


def _candidates(
    scheme: str, package: str, inside: str, file_name: str, path: Path, package_dirs: Sequence[Path]
) -> Iterator[Path]:
    """The files that are there: in a package, or beside the URDF."""
    places: list[Path] = []
    if scheme == "file":
        places.append(Path(unquote(inside)))
    elif scheme in PACKAGE_SCHEMES:
        within = PurePosixPath(unquote(inside).lstrip("/"))
        roots = [*package_dirs, *(Path(entry) for entry in os.environ.get(SEARCH_PATH, "").split(os.pathsep) if entry)]
        for root in [*roots, *path.parents]:
            places.append(root / package / within)
            if root.name == package:  # the folder of the package itself
                places.append(root / within)
    else:
        places.append(path.parent / file_name)
    return (place for place in places if place.is_file())


def read_mesh_file(file: Path, description: Path) -> TriangleMesh:
    """The triangles of a mesh file.

    Lengths are metres: a COLLADA file says its unit, which is followed, and other formats are taken to be in metres.
    Axes are those of the file, also where a COLLADA file says that another one than z points up: robots are described
    for viewers and planners that take them so, and exporters write Y_UP whatever the axes are.

    Args:
        file: one of `FORMATS`.
        description: the file that names it, for messages.

    Raises:
        ShapeError: it cannot be read, is packed, too large or of another format, or holds no triangles.
    """
    where = f"{description}: mesh {file}"
    content, suffix = _content(file, description), file.suffix.lower()
    try:
        if suffix == ".stl":
            mesh = _read_stl(content)
        elif suffix == ".obj":
            mesh = _read_obj(content)
        else:
            mesh = _read_other(content, file)
    except Exception as error:  # whatever the reader of that format raises
        raise ShapeError(f"{where} cannot be read: {shown(error)}") from error
    if not len(mesh.faces):
        raise ShapeError(f"{where} holds no triangles")
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
        raise ShapeError(f"{where} holds triangles of vertices that it has not")
    if not np.isfinite(mesh.vertices).all():
        raise ShapeError(f"{where} holds vertices that are not finite")
    return mesh


def _content(file: Path, description: Path) -> bytes:
    """The bytes of a file that is not packed, not too large, and of a known format."""
    import zipfile  # an arm without meshes does without

    where = f"{description}: mesh {file}"
    if file.suffix.lower() not in FORMATS:
        raise ShapeError(f"{where} is of an unknown format; valid: {', '.join(FORMATS)}")
    try:
        content = _regular(file)
    except InvalidInputError as error:
        raise ShapeError(f"{description}: mesh {error}") from error
    packed = b"\x1f\x8b", b"BZh", b"\xfd7zXZ\x00", b"\x28\xb5\x2f\xfd"  # how gzip, bzip2, xz and zstandard begin
    if content.startswith(packed) or zipfile.is_zipfile(io.BytesIO(content)):
        raise ShapeError(f"{where} is packed (gzip, zip or the like): unpack it")
    return content


def _regular(file: Path) -> bytes:
    """The bytes of a file that is no pipe.

    Raises:
        InvalidInputError: it cannot be read, or is too large.
    """
    open_bytes(file).close()
    return read_bytes(file, LARGEST)


def _read_stl(content: bytes) -> TriangleMesh:
    """A binary file, whatever its header begins with, or one of text with any number of solids."""
    count = int.from_bytes(content[STL_HEADER - 4 : STL_HEADER], "little")
    size = STL_HEADER + STL_FACE * count
    corners = np.empty((0, 3))
    if len(content) != size and content.lstrip()[:5].lower() == b"solid":
        corners = np.array(_VERTEX.findall(content), dtype=np.float64).reshape(-1, 3)
        if not len(corners) and len(content) < size:
            count = 0
    if not len(corners) and count:
        rows = np.frombuffer(content, STL_CORNERS, count, STL_HEADER)
        corners = rows["corners"].reshape(-1, 3).astype(np.float64)
    return TriangleMesh(corners, np.arange(len(corners)).reshape(-1, 3))


def _read_obj(content: bytes) -> TriangleMesh:
    """All faces of all groups and objects; polygons are cut into triangles."""
    vertices: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for line in io.BytesIO(content.replace(b"\\\n", b" ").replace(b"\\\r\n", b" ")):
        words = line.split()
        if not words:
            continue
        if words[0] == b"v":
            vertices.append([float(word) for word in words[1:4]])
            if len(vertices) > MOST_VERTICES:
                raise ValueError(f"more than {MOST_VERTICES} vertices")
        elif words[0] == b"f":
            given = [int(word.split(b"/")[0]) for word in words[1:]]
            corners = [number - 1 if number > 0 else len(vertices) + number for number in given]  # -1 is the last one
            if min(corners) < 0:
                raise ValueError(f"a face of vertex {min(given)}")
            faces += [(corners[0], b, c) for b, c in itertools.pairwise(corners[1:])]
    numbers = np.array(faces, dtype=np.int64).reshape(-1, 3)
    if len(numbers) and numbers.max() >= len(vertices):
        raise ValueError(f"a face of vertex {numbers.max() + 1} of {len(vertices)}")
    return TriangleMesh(np.array(vertices, dtype=np.float64).reshape(-1, 3), numbers)


def _read_other(content: bytes, file: Path) -> TriangleMesh:
    """A file of a format that trimesh reads, as one mesh; of COLLADA in its unit."""
    import trimesh

    suffix = file.suffix.lower()
    unit, up = _collada_asset(content) if suffix == ".dae" else (1.0, Z_UP)
    beside = _gltf_buffers(content, file.parent) if suffix in (".glb", ".gltf") else {}
    whole = trimesh.load_mesh(io.BytesIO(content), file_type=suffix[1:], resolver=beside, process=False)
    vertices = unit * np.asarray(whole.vertices, dtype=np.float64)
    faces = np.asarray(whole.faces, dtype=np.int64)
    return TriangleMesh(vertices, faces, up)


def _collada_asset(content: bytes) -> tuple[float, str]:
    """The unit of a COLLADA file [m], and which of its axes it says points up; `Z_UP` where it does not say.

    Raises:
        ValueError: not XML, or a unit that is not a positive number.
    """
    unit, up = 1.0, Z_UP
    for _, element in ET.iterparse(io.BytesIO(content)):
        tag = element.tag.rpartition("}")[2]
        if tag == "unit":
            unit = float(element.get("meter", "1"))
        elif tag == "up_axis":
            up = (element.text or "").strip().upper()
        elif tag == "asset":
            break
    if not 0.0 < unit < np.inf:
        raise ValueError(f"its unit is {unit} m")
    return unit, up


def _gltf_buffers(content: bytes, folder: Path) -> dict[str, bytes]:
    """The files beside a glTF file that hold its numbers, by name.

    Raises:
        ValueError: not glTF, or more vertices than are read.
    """
    text = content
    if content.startswith(b"glTF"):  # binary: the description begins after 20 bytes that say how long it is
        text = content[20 : 20 + int.from_bytes(content[12:16], "little")]
    described = json.loads(text)
    for accessor in described.get("accessors", []):
        if accessor["count"] > 3 * MOST_VERTICES:
            raise ValueError(f"more than {3 * MOST_VERTICES} numbers of a kind")
    names = [buffer.get("uri", "data:") for buffer in described.get("buffers", [])]
    return {name: _regular(folder / unquote(name)) for name in names if not name.startswith("data:")}


def convex_hull(points: Array) -> ConvexHull | None:
    """The convex hull of points (n, 3); None where they are flat."""
    from scipy.spatial import ConvexHull, QhullError  # only meshes and grippers need it

    try:
        return ConvexHull(points)
    except (QhullError, ValueError):
        return None


def hull_of(vertices: Array) -> TriangleMesh | None:
    """The convex hull of some points (n, 3) [m]; None where they are one point.

    Points in a plane or on a line get a thickness of 0.02 mm. That of many points leaves out what is outside by less
    than 0.05 mm.

    Raises:
        ValueError: the coordinates are too large or too different for a hull to be found.
    """
    from scipy.spatial import ConvexHull, QhullError  # only meshes need it

    if not np.abs(vertices).max() <= FARTHEST:  # or not a number
        raise ValueError(f"its vertices are not finite, or beyond {FARTHEST:g} m")
    points = np.unique(vertices, axis=0) if len(vertices) < 5000 else vertices
    centred = points - points.mean(axis=0)
    axes = np.linalg.eigh(centred.T @ centred)[1].T
    extents = np.ptp(centred @ axes.T, axis=0)
    if not extents.max() > THIN:
        return None
    for axis in axes[extents < THIN]:
        points = np.concatenate([points - THIN * axis, points + THIN * axis])
    try:
        hull = ConvexHull(points, qhull_options="Qt W5e-05" if len(points) > 5000 else "Qt")
    except QhullError as error:
        raise ValueError(f"it has no convex hull: {str(error).splitlines()[0]}") from error
    used, numbers = np.unique(hull.simplices, return_inverse=True)
    corners, faces = hull.points[used], numbers.reshape(-1, 3)
    # Qhull's triangles are turned either way.
    edges = corners[faces[:, 1:]] - corners[faces[:, :1]]
    inwards = np.einsum("ij,ij->i", np.cross(edges[:, 0], edges[:, 1]), hull.equations[:, :3]) < 0.0
    faces[inwards] = faces[inwards][:, ::-1]
    return TriangleMesh(corners, faces)


def stl_bytes(mesh: TriangleMesh) -> bytes:
    """A mesh as a binary STL file."""
    rows = np.zeros(len(mesh.faces), dtype=STL_CORNERS)
    rows["corners"] = mesh.vertices[mesh.faces]
    return bytes(STL_HEADER - 4) + len(rows).to_bytes(4, "little") + rows.tobytes()
