"""Where finished chunks go: written by the worker that made them, where it sees the folder."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import secrets
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from jacokin.errors import JacokinError

RECIPE = "recipe.json"
HASH_DIGITS = 16  # of SHA-256, in names of chunks
TEMPORARY = ".unfinished"


@dataclass(frozen=True, slots=True)
class Keeper:
    """Keeps chunks in a folder; can be sent to other machines.

    Attributes:
        folder: the folder.
        recipe: SHA-256 of its recipe.
        suffix: ending of the names of chunks, with its dot.
    """

    folder: Path
    recipe: str
    suffix: str

    def keep(self, index: int, content: bytes) -> str | bytes:
        """Write a finished chunk.

        Returns:
            Its name, when it is on disk; the content, where this machine does not see the folder or may not write.

        Raises:
            JacokinError: the disk is full, or fails.
        """
        if not _sees(self.folder, self.recipe):
            return content
        path = self.folder / f"{index:06d}-{digest(content)[:HASH_DIGITS]}{self.suffix}"
        try:
            write(path, content)
        except PermissionError:
            return content
        except OSError as error:
            raise unwritten(path, error) from error
        return path.name


def unwritten(path: Path, error: OSError) -> JacokinError:
    """What to raise when a chunk cannot be written."""
    return JacokinError(
        f"{path}: cannot be written: {error.strerror}; the chunks that are finished are kept, "
        f"do the same again when this is mended"
    )


def write(path: Path, content: bytes) -> None:
    """Write a file that appears as a whole, and is on disk when this returns.

    Raises:
        OSError: it cannot be written.
    """
    with temporary(path.parent) as unfinished:
        with unfinished.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        unfinished.replace(path)


def settle(path: Path) -> None:
    """Wait until a file that was written is on disk."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


@contextlib.contextmanager
def temporary(folder: Path) -> Iterator[Path]:
    """A path to write to and to move to its place; removed if it is still there in the end."""
    path = folder / f".{secrets.token_hex(8)}{TEMPORARY}"
    try:
        yield path
    finally:
        path.unlink(missing_ok=True)


def digest(content: bytes) -> str:
    """SHA-256 in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


@functools.lru_cache(maxsize=4)
def _sees(folder: Path, recipe: str) -> bool:
    """Whether the folder of this recipe is on this machine."""
    try:
        return digest((folder / RECIPE).read_bytes()) == recipe
    except OSError:
        return False
