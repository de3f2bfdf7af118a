"""Output files that are checked before the work and replaced only after it succeeded."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from jacokin.errors import InvalidInputError


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A path to write to; what is there becomes `path` when the block ends well, and is removed otherwise.

    Raises:
        InvalidInputError: the file cannot be written; raised before the block runs.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        yield path  # /dev/stdout, a pipe: nothing to keep intact
        return
    final = path.resolve()
    if final.is_dir():
        raise InvalidInputError(f"{path}: cannot be written: it is a folder")
    if final.exists() and not os.access(final, os.W_OK):
        raise InvalidInputError(f"{path}: cannot be written: permission denied")
    beside = final.with_name(f".{os.getpid()}-{final.name}")  # keeps the suffix, which decides the format
    try:
        beside.touch(exist_ok=False)
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be written: {error.strerror}") from error
    try:
        yield beside
        if final.exists():
            shutil.copymode(final, beside)
        beside.replace(final)
    finally:
        beside.unlink(missing_ok=True)
