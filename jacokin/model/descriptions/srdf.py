"""SRDF files, which MoveIt's assistant writes beside a URDF: which links need not be looked at for contact."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from jacokin import files
from jacokin.errors import InvalidInputError, ModelError
from jacokin.model.descriptions.urdf import parse_xml

SUFFIX = ".srdf"
FOLDER = "srdf"  # beside that of the URDF, as in many packages
XACRO = ("${", "$(", "xacro:")


class DisabledPairs(NamedTuple):
    """Links of a robot whose contact with each other does not count."""

    path: Path
    """The file that says so."""
    pairs: tuple[tuple[str, str], ...]
    """Names of links, each pair once."""


def find(urdf: Path) -> Path | None:
    """The SRDF of a URDF's name in the folder of that file, or in a folder called srdf beside it; None for none."""
    name = urdf.with_suffix(SUFFIX).name
    places = urdf.parent / name, urdf.parent.parent / FOLDER / name
    return next((place for place in places if place.is_file()), None)


def read(path: Path) -> DisabledPairs:
    """The pairs of links that a file disables.

    Raises:
        ModelError: the file cannot be read, or is no SRDF.
    """
    try:
        text = files.read_bytes(path, files.DESCRIPTION).decode("utf-8-sig")
    except (InvalidInputError, UnicodeDecodeError) as error:
        raise ModelError(f"{path}: is not an SRDF that can be read: {error}") from error
    root = parse_xml(text, str(path))
    if any(sign in text for sign in XACRO):
        raise ModelError(f"{path}: is a xacro file, not an SRDF: expand it: xacro {path.name} > out.srdf")
    if root.tag != "robot":
        raise ModelError(f"{path}: the root element is <{root.tag}>, an SRDF has <robot>")
    if root.find("link") is not None:
        raise ModelError(f"{path}: is a URDF, not an SRDF")
    found: dict[frozenset[str], tuple[str, str]] = {}
    for element in root.iter("disable_collisions"):
        first, second = element.get("link1", ""), element.get("link2", "")
        if not first or not second:
            raise ModelError(f"{path}: a <disable_collisions> has no {'link2' if first else 'link1'}")
        found.setdefault(frozenset((first, second)), (first, second))
    return DisabledPairs(path, tuple(pair for key, pair in found.items() if len(key) == 2))
