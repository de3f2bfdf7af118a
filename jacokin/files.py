"""Output files that replace what is there in one step, and only when they are complete; archives of arrays, read."""

from __future__ import annotations

import math
import os
import secrets
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    import zipfile

    import numpy as np
    from numpy.typing import NDArray

LARGEST = 4_000_000_000  # [byte] of an NPZ file's arrays: a trajectory of a day at 100 Hz takes 1.2e9
KEPT_NAME = 60  # characters of the file's name in the temporary one: the ending decides formats, names may be 255 bytes


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path to write to, beside the final one.

    It takes the final name when the block ends well and is removed when the block raises. Links are followed. A new
    file gets the permissions that the umask leaves, a replaced one keeps its own. What is not a regular file
    (/dev/stdout, a pipe) is handed out as it is.

    Raises:
        InvalidInputError: the file cannot be written; raised before the block runs where that can be known.
    """
    if is_device(path):
        yield path
        return
    final = writable(path)
    temporary = final.with_name(f".{secrets.token_hex(8)}-{final.name[-KEPT_NAME:]}")
    try:  # from here on an interrupt, too, leaves nothing behind
        try:
            temporary.touch(exist_ok=False)
        except OSError as error:
            raise InvalidInputError(f"{path}: cannot be written: {error.strerror}") from error
        yield temporary
        try:
            if final.exists():
                temporary.chmod(stat.S_IMODE(final.stat().st_mode))
            temporary.replace(final)
        except OSError as error:
            raise InvalidInputError(f"{path}: cannot be written: {error.strerror}") from error
    finally:
        temporary.unlink(missing_ok=True)


def is_device(path: Path) -> bool:
    """Whether something is there that is neither a file nor a folder, such as /dev/stdout or a pipe."""
    return path.exists() and not path.is_file() and not path.is_dir()


def check_end(path: Path) -> None:
    """Check that what is read has an end: a file, a pipe, a terminal.

    Raises:
        InvalidInputError: it is another device, such as /dev/zero, which has no end.
    """
    if path.exists() and stat.S_ISCHR(path.stat().st_mode):
        with path.open("rb") as device:
            if not device.isatty():
                raise InvalidInputError(f"{path}: is a device: give a file or a pipe")


def writable(path: Path) -> Path:
    """Where a file ends up when links are followed.

    Raises:
        InvalidInputError: a file there cannot be written, as far as that can be known.
    """
    try:
        final = path.resolve()
    except (OSError, RuntimeError, ValueError) as error:  # a loop of links, a null byte
        raise InvalidInputError(f"{path}: cannot be written: {error}") from error
    if final.is_symlink():  # as Python 3.13 leaves a loop
        raise InvalidInputError(f"{path}: cannot be written: its links lead in a circle")
    if final.is_dir():
        raise InvalidInputError(f"{path}: cannot be written: it is a folder")
    if final.exists() and not os.access(final, os.W_OK):
        raise InvalidInputError(f"{path}: cannot be written: permission denied")
    return final


def read_arrays(path: Path, otherwise: str) -> dict[str, NDArray[np.generic]]:
    """Read an NPZ file, its headers first: a small file may claim to hold more than the memory.

    Args:
        path: the file.
        otherwise: what the error says of a file that is damaged or something else, such as "is not a recording".

    Raises:
        InvalidInputError: unreadable, or not an archive of plain arrays.
    """
    import zipfile  # like NumPy, not for the command line's help

    import numpy as np

    try:
        with zipfile.ZipFile(path) as archive:
            _check_headers(archive)
        with np.load(path, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except (ValueError, EOFError, KeyError, NotImplementedError, RuntimeError, zipfile.BadZipFile, zlib.error) as error:
        raise InvalidInputError(f"{path}: {otherwise}: {error}") from error
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read: {error.strerror or error}") from error


def _check_headers(archive: zipfile.ZipFile) -> None:
    """ValueError when a member is not an array, or the arrays claim more than the archive holds or than is sensible."""
    import numpy as np

    total = 0
    for member in archive.infolist():
        with archive.open(member) as stream:
            version = np.lib.format.read_magic(stream)
            read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, _, dtype = read(stream)
        size = math.prod(shape) * dtype.itemsize
        total += size
        if dtype.hasobject or size > member.file_size or total > LARGEST:
            raise ValueError(f"{member.filename} claims {size} bytes")
