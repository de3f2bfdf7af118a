"""Files of points: .ply, as scanners and libraries for point clouds write them, and .npz."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jacokin import files
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError

ENDINGS = (".ply", ".npz")
LARGEST = 500_000_000  # [byte] of a .ply file: 20 million points with three doubles each
HEADER = 10_000  # [byte] of the header of a .ply file
ARRAY = "points"  # of an .npz file
# PLY's types, by both of their names, as NumPy's (Turk: The PLY Polygon File Format, 1994).
TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
TYPES |= {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"}
TYPES |= {"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"}
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


def read_points(path: Path) -> Array:
    """Points (n, 3) of a file.

    Raises:
        InvalidInputError: no such file, another ending, or malformed.
    """
    if _ending(path) == ".ply":
        return _read_ply(path)
    arrays = files.read_arrays(path, "is not an .npz file")
    if ARRAY not in arrays:
        raise InvalidInputError(f"{path}: has no array {ARRAY!r}, only {', '.join(map(repr, arrays)) or 'none'}")
    found = arrays[ARRAY]
    if found.ndim != 2 or found.shape[1] != 3 or found.dtype.kind not in "iuf":
        raise InvalidInputError(f"{path}: {ARRAY!r} must hold numbers of shape (n, 3), not {found.dtype} {found.shape}")
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
    content = files.read_bytes(path, LARGEST)
    end = content.find(b"end_header", 0, HEADER)
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
        return np.array([[float(row[k]) for k in columns] for row in words]).reshape(-1, 3)
    except (ValueError, IndexError, UnicodeDecodeError, MemoryError) as error:
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
