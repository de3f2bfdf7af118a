"""Finished chunks put together in their order, while others are still being solved."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import Self

from jacokin import files
from jacokin.chunks.folder import ChunkFolder
from jacokin.chunks.keeping import settle
from jacokin.errors import JacokinError
from jacokin.ik.batches.chunk import read_tally
from jacokin.ik.batches.summary import EMPTY, Tally
from jacokin.ik.files.formats import AnswerFormat, Piece

SETTLED = 32  # chunks


class Joining:
    """A thread of its own that writes the file of answers; used in a `with`, which ends it in any case."""

    def __init__(self, write: Callable[[Iterable[Piece]], None], count: int, *, at_once: bool = False) -> None:
        """Begin.

        Args:
            write: writes the file from pieces.
            count: how many chunks there are.
            at_once: write nothing before all chunks are there.
        """
        self._count, self._at_once = count, at_once
        self._tally, self._next = EMPTY, 0
        self._waiting: dict[int, Path] = {}
        self._ready: SimpleQueue[Path | None] = SimpleQueue()
        self._thread = ThreadPoolExecutor(1)
        self._end = self._thread.submit(write, self._pieces())

    def __enter__(self) -> Self:
        """Itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, at: TracebackType | None) -> None:
        """End the thread, finished or not."""
        self._ready.put(None)
        self._thread.shutdown()

    def add(self, index: int, chunk: Path) -> None:
        """Take a finished chunk; they may come in any order."""
        self._waiting[index] = chunk
        if self._at_once and len(self._waiting) < self._count:
            return
        while (path := self._waiting.pop(self._next, None)) is not None:
            self._ready.put(path)
            self._next += 1

    def finish(self) -> Tally:
        """Wait until the file is there; all chunks must have been added.

        Raises:
            JacokinError: it cannot be written.
        """
        self._end.result()
        return self._tally

    def _pieces(self) -> Iterator[Piece]:
        for _ in range(self._count):
            path = self._ready.get()
            if path is None:
                raise JacokinError("the batch was stopped")
            counts, offset = read_tally(path)
            self._tally += counts
            yield path, offset


def _settling(pieces: Iterable[Piece], whole: Path) -> Iterator[Piece]:
    """The same, with what is written brought to disk from time to time: in the end that would take long."""
    for number, piece in enumerate(pieces):
        if number % SETTLED == SETTLED - 1 and whole.exists():
            settle(whole)
        yield piece


def write(
    layout: AnswerFormat, folder: ChunkFolder, final: Path, names: Sequence[str], pieces: Iterable[Piece]
) -> None:
    """Put the pieces together, beside them, and give the whole the name of the output in one step.

    Raises:
        JacokinError: it cannot be written.
    """
    try:
        if files.is_device(final):
            layout.write_joined(final, pieces, names)
            return
        with folder.temporary() as whole:
            layout.write_joined(whole, _settling(pieces, whole), names)
            settle(whole)
            if final.exists():
                shutil.copymode(final, whole)
            whole.replace(final)
    except OSError as error:
        raise JacokinError(
            f"{final}: cannot be written: {error.strerror or error}; every target is solved, do the same again"
        ) from error
