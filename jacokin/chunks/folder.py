"""A folder with a recipe and the chunks that are finished, each under a name that holds its number and its hash."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path

import orjson

from jacokin.chunks.keeping import HASH_DIGITS, RECIPE, TEMPORARY, Keeper, digest, temporary, unwritten, write
from jacokin.errors import InvalidInputError

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

        Raises:
            InvalidInputError: the folder holds something else, chunks of another recipe (says what differs), or cannot
                be written.
        """
        self.path = path
        self.count = count
        self._suffix = suffix
        self._name = re.compile(rf"([0-9]{{6,}})-([0-9a-f]{{{HASH_DIGITS}}}){re.escape(suffix)}")
        text = orjson.dumps(recipe, option=orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY)
        try:
            path.mkdir(parents=True, exist_ok=True)
            if (path / RECIPE).exists():
                there = (path / RECIPE).read_bytes()
                _refuse_other(path, there, text)
                text = there
            elif any(not other.name.endswith(TEMPORARY) for other in path.iterdir()):
                raise InvalidInputError(f"{path}: is a folder with other things in it, without {RECIPE}")
            else:
                write(path / RECIPE, text)
        except OSError as error:
            raise InvalidInputError(f"{path}: cannot be used: {error.strerror}") from error
        self.keeper = Keeper(path.absolute(), digest(text), suffix)

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

    def put(self, index: int, made: str | bytes) -> Path:
        """Keep what `keeper` returned for a chunk, in whatever process: its name, or what is still to be written.

        Raises:
            JacokinError: the disk is full, or fails.
        """
        if isinstance(made, str):
            return self.path / made
        path = self.path / f"{index:06d}-{digest(made)[:HASH_DIGITS]}{self._suffix}"
        try:
            write(path, made)
        except OSError as error:
            raise unwritten(path, error) from error
        return path

    def remove(self) -> None:
        """Remove the chunks, the recipe and the folder."""
        for attempt in range(REMOVALS):
            for path in self.path.iterdir():
                if self._name.fullmatch(path.name) or path.name.endswith(TEMPORARY):
                    path.unlink(missing_ok=True)
            (self.path / RECIPE).unlink(missing_ok=True)  # last: without it, chunks would be somebody else's
            try:
                self.path.rmdir()
                return
            except OSError:  # a worker that was given up still writes
                if attempt == REMOVALS - 1:
                    raise

    def remove_unfinished(self) -> None:
        """Remove what killed processes left, once nobody writes any more."""
        for path in self.path.glob(f"*{TEMPORARY}"):
            path.unlink(missing_ok=True)

    def temporary(self) -> AbstractContextManager[Path]:
        """A path to write to and to move to its place; removed if it is still there in the end."""
        return temporary(self.path)


def file_digest(path: Path) -> str:
    """SHA-256 of a file of any size."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _refuse_other(path: Path, before: bytes, wanted: bytes) -> None:
    """Refuse a folder whose recipe is not the wanted one.

    Raises:
        InvalidInputError: names what differs.
    """
    try:
        old, new = orjson.loads(before), orjson.loads(wanted)
    except orjson.JSONDecodeError as error:
        raise InvalidInputError(f"{path / RECIPE}: is not JSON: {error}") from error
    if not isinstance(old, dict):
        raise InvalidInputError(f"{path / RECIPE}: is not a recipe")
    different = list(_differences(old, new))
    if different:
        raise InvalidInputError(
            f"{path}: holds chunks of another recipe, which differs in {'; '.join(different)}. "
            f"Use the same again, another folder, or remove this one"
        )


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
