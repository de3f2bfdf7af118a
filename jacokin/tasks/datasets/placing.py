"""`placing`: where a data set is written until it is complete, so that a kill or a full disk leaves no part of it."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from jacokin.chunks.folder import temporary
from jacokin.errors import InvalidInputError


def episodes_folder(path: Path) -> Path:
    """The folder of a recording that is not complete: finished episodes, and what a kill has left."""
    return path.with_name(f"{path.name}.episodes")


def check_free(path: Path) -> None:
    """Check that nothing is at a path yet.

    Raises:
        InvalidInputError: something is.
    """
    if path.exists() or path.is_symlink():
        left = f"; {episodes_folder(path)} is left of its recording" if episodes_folder(path).exists() else ""
        raise InvalidInputError(f"path: {path} is there already; data sets are never changed{left}")


@contextlib.contextmanager
def placing(path: Path) -> Iterator[Path]:
    """A temporary path in the folder of the recording, for a file or a folder; in the end it is moved to its place.

    Raises:
        InvalidInputError: something is there already, or the disk is full or fails.
    """
    folder = episodes_folder(path)
    try:
        folder.mkdir(exist_ok=True)
        with temporary(folder) as unfinished:
            yield unfinished
            check_free(path)
            unfinished.replace(path)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        kept = f"; {folder} keeps its episodes: when that is mended, record it again to continue"
        raise InvalidInputError(
            f"{path}: cannot be written: {reason}{kept if folder.is_dir() and any(folder.iterdir()) else ''}"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            folder.rmdir()  # if it is empty: whoever keeps episodes in it removes them
