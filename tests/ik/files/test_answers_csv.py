"""CSV files of answers: every number reads back to the same bits."""

from __future__ import annotations

import csv
import tempfile
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from jacokin.ik import BatchResult, Status, TargetFile
from jacokin.ik.files import csv_files


@given(
    values=arrays(np.float64, (3, 3), elements=st.floats(allow_nan=False)),
    q=arrays(np.float64, (3, 2), elements=st.floats(allow_nan=False)),
    message=st.text(st.characters(codec="utf-8", exclude_characters="\0\r\n")),
)
def test_answers_read_back_to_the_same_bits(values: np.ndarray, q: np.ndarray, message: str) -> None:
    targets = TargetFile(("x", "y", "z"), values, values, np.arange(2, 5))
    errors = np.array([0.0, 1e-300, 0.1])
    batch = BatchResult(
        q=q,
        status=(Status.OK, Status.UNREACHABLE, Status.OK),
        success=np.array([True, False, True]),
        position_error=errors,
        orientation_error=errors[::-1],
        method=("closed_form", "qp", "closed_form"),
        message=(message, "out, far out", ""),
    )
    with tempfile.TemporaryDirectory() as folder:
        piece, whole = Path(folder) / "piece", Path(folder) / "whole"
        piece.write_bytes(b"before" + csv_files.encoded(targets, batch))
        csv_files.write_joined(whole, [(piece, len("before"))], [*targets.columns, "q1", "q2"])
        with whole.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    assert [row["message"] for row in rows] == list(batch.message)
    assert [row["status"] for row in rows] == ["OK", "UNREACHABLE", "OK"]
    names = ("x", "y", "z", "q1", "q2", "position_error", "orientation_error")
    read = np.array([[float(row[name]) for name in names] for row in rows])
    assert read.tobytes() == np.column_stack([values, q, errors, errors[::-1]]).tobytes()
