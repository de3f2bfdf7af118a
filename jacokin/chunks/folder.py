"""`ChunkFolder`: a recipe and the chunks that are finished, each under a name that holds its number and its hash."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import re
import secrets
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import orjson

from jacokin.errors import InvalidInputError, JacokinError

RECIPE = "recipe.json"
HASH_DIGITS = 16  # of SHA-256, in names of chunks
TEMPORARY = ".unfinished"
BUSY = "another process is working on it"
REMOVALS = 5  # times that a folder is emptied while somebody still writes into it

Recipe = Mapping[str, object]


class ChunkFolder:
    """Chunks of one recipe on disk; several processes may add to them at the same time.

    Attributes:
        path: the folder.
        count: how many chunks there are when all are finished.
        keeper: writes chunks into it, in whatever process.
    """

    def __init__(self, path: Path, recipe: Recipe, count: int, suffix: str) -> None:
        """Open the folder, or make it.

        Args:
            path: the folder.
            recipe: everything that the chunks depend on, as JSON.
            count: how many chunks there are in all.
            suffix: ending of their names, with its dot.

        A folder with another recipe, but without any chunk, is taken over if nobody works on it: nothing would be lost.

        Raises:
            InvalidInputError: the folder holds something else, chunks of another recipe (says what differs), or cannot
                be written.
        """
        self.path = path
        self.count = count
        self._name = re.compile(rf"([0-9]{{6,}})-([0-9a-f]{{{HASH_DIGITS}}}){re.escape(suffix)}")
        text = orjson.dumps(recipe, option=orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY)
        try:
            path.mkdir(parents=True, exist_ok=True)
            if (path / RECIPE).exists():
                there = (path / RECIPE).read_bytes()
                if not _take_over(path, there, text):
                    _refuse_other(path, there, text)
                    text = there
            elif any(not other.name.endswith(TEMPORARY) for other in path.iterdir()):
                raise InvalidInputError(f"{path}: is a folder with other things in it, without {RECIPE}")
            else:
                write(path / RECIPE, text)
        except OSError as error:
            with contextlib.suppress(OSError):
                path.rmdir()  # which was made here, if it is empty
            raise InvalidInputError(f"{path}: cannot be used: {error.strerror}") from error
        self.keeper = Keeper(path.absolute(), digest(text), suffix)

    @contextlib.contextmanager
    def locked(self, *, shared: bool = False) -> Iterator[None]:
        """Keep other processes of this machine out; the folder goes if the block fails before a chunk is finished.

        Args:
            shared: others that share it may come in: several add to the same chunks.

        Raises:
            InvalidInputError: another one is inside, or has taken the folder over.
        """
        with (self.path / RECIPE).open("rb") as lock:
            kind = fcntl.LOCK_SH if shared else fcntl.LOCK_EX
            if not (_lock(lock, kind) and _sees(self.path, self.keeper.recipe)):
                raise InvalidInputError(f"{self.path}: {BUSY}")
            try:
                yield
            except BaseException:
                if self.path.exists() and self.is_empty() and _lock(lock, fcntl.LOCK_EX):
                    with contextlib.suppress(OSError):  # files of others are in it
                        self.remove()
                raise

    def finished(self) -> dict[int, Path]:
        """Number and file of every chunk that is complete; files that are truncated or changed are removed."""
        found = {}
        for path in sorted(self.path.iterdir()):
            match = self._name.fullmatch(path.name)
            if match is None:
                continue
            if digest(path.read_bytes())[:HASH_DIGITS] != match[2]:
                path.unlink(missing_ok=True)
            elif int(match[1]) < self.count:
                found[int(match[1])] = path
        return found

    def is_empty(self) -> bool:
        """Whether it holds no chunk, complete or not."""
        return not any(self._name.fullmatch(path.name) for path in self.path.iterdir())

    def put(self, index: int, kept: str | bytes) -> Path:
        """The file of a chunk, from what `keeper` returned for it in whatever process; written if it still has to be.

        Raises:
            JacokinError: the disk is full, or fails.
        """
        return self.path / (kept if isinstance(kept, str) else self.keeper.write(index, kept))

    def remove(self) -> None:
        """Remove the chunks, the recipe and the folder."""
        for attempt in range(REMOVALS):
            for path in self.path.iterdir():
                if self._name.fullmatch(path.name) or path.name.endswith(TEMPORARY):
                    discard(path)
            (self.path / RECIPE).unlink(missing_ok=True)  # last: chunks without a recipe could be anybody's
            try:
                self.path.rmdir()
                return
            except OSError:  # a worker that was given up still writes
                if attempt == REMOVALS - 1:
                    raise

    def remove_unfinished(self) -> None:
        """Remove what killed processes left, once nobody writes any more."""
        for path in self.path.glob(f"*{TEMPORARY}"):
            discard(path)


@dataclass(frozen=True, slots=True)
class Keeper:
    """Writes chunks into a folder; can be sent to other machines.

    Attributes:
        folder: the folder.
        recipe: SHA-256 of its recipe.
        suffix: ending of the names of chunks, with its dot.
    """

    folder: Path
    recipe: str
    suffix: str

    def keep(self, index: int, content: bytes) -> str | bytes:
        """Write a finished chunk, if this machine sees the folder and may write there.

        Returns:
            Its name, when it is on disk; otherwise the content, for `ChunkFolder.put`.

        Raises:
            JacokinError: the disk is full, or fails.
        """
        if not _sees(self.folder, self.recipe):
            return content
        try:
            return self.write(index, content)
        except JacokinError as error:
            if isinstance(error.__cause__, PermissionError):
                return content
            raise

    def write(self, index: int, content: bytes) -> str:
        """Write a finished chunk; returns its name.

        Raises:
            JacokinError: it cannot be written.
        """
        path = self.folder / f"{index:06d}-{digest(content)[:HASH_DIGITS]}{self.suffix}"
        try:
            write(path, content)
        except OSError as error:
            raise JacokinError(
                f"{path}: cannot be written: {error.strerror}; finished chunks are kept: "
                f"when that is fixed, run it again to continue"
            ) from error
        return path.name


def clear(folder: Path) -> None:
    """Remove a folder of chunks, finished or not; nothing where there is none.

    Raises:
        InvalidInputError: another process is working on it, or it cannot be removed.
    """
    import shutil  # which brings every compression

    try:
        with (folder / RECIPE).open("rb") as lock:
            if not _lock(lock, fcntl.LOCK_EX):
                raise InvalidInputError(f"{folder}: {BUSY}")
            shutil.rmtree(folder)
    except (FileNotFoundError, NotADirectoryError):
        return
    except OSError as error:
        raise InvalidInputError(f"{folder}: cannot be removed: {error.strerror}") from error


def _sees(folder: Path, recipe: str) -> bool:
    """Whether the folder of this recipe is on this machine."""
    try:
        return digest((folder / RECIPE).read_bytes()) == recipe
    except OSError:
        return False


def _lock(file: IO[bytes], kind: int) -> bool:
    """Lock an open file, without waiting; whether that was possible."""
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except OSError as error:
        return kind == fcntl.LOCK_SH and not isinstance(error, BlockingIOError)  # some file systems have no locks
    return True


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


def sync(path: Path) -> None:
    """Wait until a file that was written is on disk."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


@contextlib.contextmanager
def temporary(folder: Path) -> Iterator[Path]:
    """A path to write to and to move to its place; the file or folder is removed if it is still there in the end."""
    path = folder / f".{secrets.token_hex(8)}{TEMPORARY}"
    try:
        yield path
    finally:
        discard(path)


def discard(path: Path) -> None:
    """Remove a file, or a folder with all that is in it; nothing if there is none."""
    if path.is_dir() and not path.is_symlink():
        import shutil  # which brings every compression

        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def digest(content: bytes) -> str:
    """SHA-256 in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of a file of any size."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _take_over(path: Path, before: bytes, wanted: bytes) -> bool:
    """Give a folder another recipe of this kind if it holds nothing else and nobody works on it; whether it did."""
    with (path / RECIPE).open("rb") as lock:
        is_alone = all(other.name == RECIPE or other.name.endswith(TEMPORARY) for other in path.iterdir())
        other = before != wanted and is_alone and _parsed(path, before).keys() == orjson.loads(wanted).keys()
        if not (other and _lock(lock, fcntl.LOCK_EX)):
            return False
        write(path / RECIPE, wanted)
    return True


def _refuse_other(path: Path, before: bytes, wanted: bytes) -> None:
    """Refuse a folder whose recipe is not the wanted one.

    Raises:
        InvalidInputError: names what differs.
    """
    different = list(_differences(_parsed(path, before), orjson.loads(wanted)))
    if different:
        raise InvalidInputError(
            f"{path}: holds chunks of another recipe, which differs in {'; '.join(different)}. "
            f"Use the same again, another folder, or remove this one"
        )


def _parsed(path: Path, recipe: bytes) -> dict[str, object]:
    """The recipe of a folder.

    Raises:
        InvalidInputError: it is not one.
    """
    try:
        document = orjson.loads(recipe)
    except orjson.JSONDecodeError as error:
        raise InvalidInputError(f"{path / RECIPE}: is not JSON: {error}") from error
    if not isinstance(document, dict):
        raise InvalidInputError(f"{path / RECIPE}: is not a recipe")
    return document


def _differences(old: Mapping[str, object], new: Mapping[str, object], place: str = "") -> Iterable[str]:
    for key in sorted({*old, *new}):
        name = f"{place}{key}"
        before, now = old.get(key), new.get(key)
        if isinstance(before, dict) and isinstance(now, dict):
            yield from _differences(before, now, f"{name}.")
        elif before != now:
            yield f"{name} ({_short(before)} there, {_short(now)} here)"


def _short(value: object) -> str:
    text = orjson.dumps(value).decode()
    return text if len(text) <= 60 else f"{text[:57]}..."
