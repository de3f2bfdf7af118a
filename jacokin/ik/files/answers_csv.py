"""Answers to a file of targets, as a CSV file."""

from __future__ import annotations

import csv
import io
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np
import orjson

from jacokin.arrays import Array
from jacokin.ik.files.target_rows import TargetFile
from jacokin.ik.results import STATUS_NAMES, BatchResult

#: Columns after those of the targets and q1, q2, ...
MEASURED = ("status", "position_error", "orientation_error", "method", "message")


class _CSV:
    """Answers as text; see `formats.AnswerFormat`."""

    def encoded(self, targets: TargetFile, batch: BatchResult) -> bytes:
        """The rows."""
        stream = io.StringIO(newline="")
        write_answers(stream, targets, batch)
        return stream.getvalue().encode()

    def write_joined(self, path: Path, pieces: Iterable[tuple[Path, int]], columns: Sequence[str]) -> None:
        """The header, and all rows."""
        with path.open("wb") as out:
            out.write((",".join([*columns, *MEASURED]) + "\n").encode())
            for piece, offset in pieces:
                with piece.open("rb") as file:
                    file.seek(offset)
                    shutil.copyfileobj(file, out)


CSV = _CSV()


def write_answers(stream: TextIO, targets: TargetFile, batch: BatchResult) -> None:
    """Write one row for each target, numbers with the digits that read back to the same bits (17 at most)."""
    configurations = _rows(np.hstack([targets.values, batch.q]))
    errors = _rows(np.stack([batch.position_error, batch.orientation_error], axis=1))
    cells = {text: _cell(text) for text in {*batch.method, *batch.message}}
    stream.writelines(
        f"{numbers},{STATUS_NAMES[status]},{measured},{cells[method]},{cells[message]}\n"
        for numbers, status, measured, method, message in zip(
            configurations, batch.status, errors, batch.method, batch.message, strict=True
        )
    )


def _rows(values: Array) -> list[str]:
    """Each row of (n, k) numbers as text, with commas between them."""
    if not np.isfinite(values).all():  # JSON has no infinity
        return [",".join(map(repr, row)) for row in values.tolist()]
    text = orjson.dumps(np.ascontiguousarray(values), option=orjson.OPT_SERIALIZE_NUMPY)
    return text[2:-2].decode("ascii").split("],[")


def _cell(text: str) -> str:
    """A text as a cell, quoted where it holds a comma."""
    if not text:
        return ""
    stream = io.StringIO()
    csv.writer(stream, lineterminator="").writerow([text])
    return stream.getvalue()
