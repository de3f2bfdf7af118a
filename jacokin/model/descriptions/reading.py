"""From a bundled name or the path of a file to the whole robot it describes."""

from __future__ import annotations

import errno
import stat
import xml.etree.ElementTree as ET
from pathlib import Path

from jacokin.errors import InvalidInputError, ModelError, UnknownNameError, shown
from jacokin.model.descriptions import bundled, urdf
from jacokin.model.descriptions.whole import Whole

SUFFIXES = (".urdf", ".xml", ".mjcf")
NO_FILE = "no such file"


def resolve(robot: str | Path) -> tuple[Path, str | None]:
    """Path of the description, and the bundled name if it is one.

    Raises:
        UnknownNameError: neither a bundled name nor a file of a known type.
        InvalidInputError: neither a string nor a path.
        ModelError: there is no such file, or it is not a regular file.
    """
    if not isinstance(robot, str | Path):
        raise InvalidInputError(f"robot must be a bundled name or a path, got {shown(robot)}")
    text = str(robot)
    if text in bundled.NAMES:
        return bundled.urdf_folder() / f"{text}.urdf", text
    path = Path(robot).absolute()
    problem = _problem(path)
    if path.suffix in SUFFIXES:
        if problem:
            raise ModelError(f"{path}: {problem}")
        return path, None
    if problem == NO_FILE:
        raise UnknownNameError("robot", text, [*bundled.NAMES, "or a path to a .urdf or .xml file"])
    raise ModelError(f"{path}: {problem or f'unknown file type {path.suffix!r}; valid: .urdf, .xml (MJCF)'}")


def _problem(path: Path) -> str | None:
    """Why a path cannot be read as a file; None when it can. Reading a FIFO would wait without end."""
    try:
        mode = path.stat().st_mode
    except (OSError, RuntimeError, ValueError) as error:
        if isinstance(error, RuntimeError) or getattr(error, "errno", None) == errno.ELOOP:
            return "is a loop of symbolic links"
        if getattr(error, "errno", None) in (errno.EACCES, errno.EPERM):
            return "cannot be read: permission denied"
        return NO_FILE  # or a name that no file can have
    if stat.S_ISDIR(mode):
        return "is a folder, not a file"
    return None if stat.S_ISREG(mode) else "is not a regular file (a pipe, socket or device)"


def read(path: Path, name: str | None) -> Whole:
    """The whole robot; `name` says that the file is a bundled one, which is not checked again.

    Raises:
        ModelError: the file is malformed.
    """
    if name is not None:
        return urdf.read_bundled(path)
    if path.suffix == ".urdf" or _is_urdf(path):
        return urdf.read(path)
    from jacokin.model.descriptions import mjcf

    compiled = mjcf.compile_mjcf(path)
    model = mjcf.to_pinocchio(compiled, path.stem)
    return Whole(
        model=model,
        reference=mjcf.reference_configuration(compiled, model),
        kind="mjcf",
        base=mjcf.WORLD,
        couplings=mjcf.couplings(compiled),
        content=compiled,
    )


def _is_urdf(path: Path) -> bool:
    """Whether an XML file holds a URDF, whatever it is called."""
    try:
        return ET.parse(path).getroot().tag == "robot"
    except (OSError, ET.ParseError, ValueError):
        return False
