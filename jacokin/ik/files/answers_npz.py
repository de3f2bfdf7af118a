"""Answers to a file of targets, as an NPZ file: one array for each column, texts as indices into a list of names."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from jacokin.ik.files.target_rows import TargetFile
from jacokin.ik.results import BatchResult, Status

STATUSES = tuple(status.name for status in Status)
NUMBERS = {status: number for number, status in enumerate(Status)}
METHODS = ("closed_form", "qp", "")


class _NPZ:
    """Answers as arrays; see `formats.AnswerFormat`."""

    def encoded(self, targets: TargetFile, batch: BatchResult) -> bytes:
        """The arrays of these rows."""
        stream = io.BytesIO()
        columns = dict(zip(targets.columns, targets.values.T, strict=True))
        np.savez(
            stream,
            allow_pickle=False,
            **columns,
            q=batch.q,
            status=np.array([NUMBERS[status] for status in batch.status], dtype=np.uint8),
            position_error=batch.position_error,
            orientation_error=batch.orientation_error,
            method=np.array([METHODS.index(method) for method in batch.method], dtype=np.uint8),
        )
        return stream.getvalue()

    def write_joined(self, path: Path, pieces: Iterable[tuple[Path, int]], columns: Sequence[str]) -> None:
        """Every array as a whole, one after the other, so that none has to fit into memory."""
        paths = [piece for piece, _ in pieces]
        with zipfile.ZipFile(paths[0]) as first:  # finds the archive after what is skipped
            names = first.namelist()
        with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED, allowZip64=True) as out:
            for name in names:
                rows = sum(len(_array(piece, name, header_only=True)) for piece in paths)
                example = _array(paths[0], name)
                with _member(out, name) as stream:
                    header = np.lib.format.header_data_from_array_1_0(example)
                    np.lib.format.write_array_header_1_0(stream, {**header, "shape": (rows, *example.shape[1:])})
                    for piece in paths:
                        stream.write(np.ascontiguousarray(_array(piece, name)).tobytes())
            for name, texts in (("status_names", STATUSES), ("method_names", METHODS)):
                with _member(out, f"{name}.npy") as stream:
                    np.lib.format.write_array(stream, np.array(texts), allow_pickle=False)


NPZ = _NPZ()


def _member(archive: zipfile.ZipFile, name: str) -> IO[bytes]:
    return archive.open(zipfile.ZipInfo(name), "w", force_zip64=True)  # with the date of all of them, 1980


def _array(piece: Path, name: str, *, header_only: bool = False) -> NDArray[np.generic]:
    with zipfile.ZipFile(piece) as archive, archive.open(name) as file:
        if not header_only:
            return np.asarray(np.lib.format.read_array(file, allow_pickle=False))
        np.lib.format.read_magic(file)
        shape, _, dtype = np.lib.format.read_array_header_1_0(file)
        return np.broadcast_to(np.zeros((), dtype=dtype), shape)
