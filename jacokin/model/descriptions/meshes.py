"""Mesh files that a URDF names: where they are, and their content in a format that MuJoCo reads."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath
from urllib.parse import unquote, urlparse

from jacokin.errors import ModelError

PACKAGE_SCHEMES = ("package", "model")
SEARCH_PATH = "ROS_PACKAGE_PATH"
STL_HEADER, STL_FACE = 84, 50  # bytes of a binary file


def embed(robot: ET.Element, path: Path, package_dirs: Sequence[Path]) -> dict[str, bytes]:
    """Replace the file names of all meshes by unique ones without folders, and return the contents by these names.

    Args:
        robot: the robot element of a checked URDF; changed.
        path: the URDF file: relative names start at its folder.
        package_dirs: folders that hold packages, searched before those of ROS_PACKAGE_PATH.

    Raises:
        ModelError: a mesh is not found or cannot be read; names it.
    """
    names: dict[Path, str] = {}
    contents: dict[str, bytes] = {}
    for mesh in robot.iter("mesh"):
        file_name = mesh.get("filename", "")
        found = find(file_name, path, package_dirs)
        if found not in names:
            content, suffix = _content(found, path)
            names[found] = f"{len(names)}_{found.stem}{suffix}"  # MuJoCo's messages name it
            contents[names[found]] = content
        mesh.set("filename", names[found])
    return contents


def find(file_name: str, path: Path, package_dirs: Sequence[Path]) -> Path:
    """The file that a URDF at `path` means by the name of a mesh.

    Raises:
        ModelError: there is none; says what to give for a package.
    """
    candidates = list(_candidates(file_name, path, package_dirs))
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    url = urlparse(file_name)
    advice = ""
    if url.scheme in PACKAGE_SCHEMES:
        advice = f"; give the folder that holds the package {url.netloc!r} with package_dirs= or {SEARCH_PATH}"
    raise ModelError(
        f"{path}: mesh {file_name!r} is not found{advice}. Self-contact needs the meshes, kinematics does not"
    )


def _candidates(file_name: str, path: Path, package_dirs: Sequence[Path]) -> Iterator[Path]:
    """Where a file may be: in a package, or beside the URDF."""
    url = urlparse(file_name)
    if url.scheme == "file":
        yield Path(unquote(url.path))
    elif url.scheme in PACKAGE_SCHEMES:
        inside = PurePosixPath(unquote(url.path).lstrip("/"))
        roots = [*package_dirs, *(Path(entry) for entry in os.environ.get(SEARCH_PATH, "").split(os.pathsep) if entry)]
        for root in [*roots, *path.parents]:
            yield root / url.netloc / inside
            if root.name == url.netloc:  # the folder of the package itself
                yield root / inside
    else:
        yield path.parent / file_name


def _content(mesh: Path, path: Path) -> tuple[bytes, str]:
    """The bytes of a mesh, and the suffix of their format: OBJ or binary STL, into which all others are converted."""
    try:
        content = mesh.read_bytes()
    except OSError as error:
        raise ModelError(f"{path}: mesh {mesh} cannot be read: {error}") from error
    suffix = mesh.suffix.lower()
    faces = int.from_bytes(content[STL_HEADER - 4 : STL_HEADER], "little")
    if suffix == ".obj" or (suffix == ".stl" and len(content) == STL_HEADER + STL_FACE * faces):
        return content, suffix
    import trimesh

    try:
        return trimesh.exchange.stl.export_stl(trimesh.load_mesh(mesh)), ".stl"
    except Exception as error:  # whatever the reader of that format raises
        raise ModelError(f"{path}: mesh {mesh} cannot be read: {error!r}") from error
