"""Answers to a file of targets, as a CSV file."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import TextIO

import numpy as np
import orjson

from jacokin.arrays import Array
from jacokin.ik.files.targets_csv import TargetFile
from jacokin.ik.results import BatchResult


def write_header(stream: TextIO, columns: Sequence[str], dof: int) -> None:
    """Write the names of the columns: those of the targets, then q1, q2, ... and what was measured."""
    joints = [f"q{index + 1}" for index in range(dof)]
    names = [*columns, *joints, "status", "position_error", "orientation_error", "method", "message"]
    stream.write(",".join(names) + "\n")


def write_answers(stream: TextIO, targets: TargetFile, batch: BatchResult) -> None:
    """Write one row for each target, numbers with the digits that read back to the same bits (17 at most)."""
    configurations = _rows(np.hstack([targets.values, batch.q]))
    errors = _rows(np.stack([batch.position_error, batch.orientation_error], axis=1))
    cells = {text: _cell(text) for text in {*batch.method, *batch.message}}
    stream.writelines(
        f"{numbers},{status.name},{measured},{cells[method]},{cells[message]}\n"
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
