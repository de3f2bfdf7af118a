"""Output files that replace what is there in one step, and only when they are complete."""

from __future__ import annotations

import os
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from jacokin.errors import InvalidInputError

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
                shutil.copymode(final, temporary)
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
    if final.is_dir():
        raise InvalidInputError(f"{path}: cannot be written: it is a folder")
    if final.exists() and not os.access(final, os.W_OK):
        raise InvalidInputError(f"{path}: cannot be written: permission denied")
    return final
