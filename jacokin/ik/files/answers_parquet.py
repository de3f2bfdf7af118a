"""Answers to a file of targets, as a Parquet file with the columns of the CSV file."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jacokin.errors import MissingExtraError
from jacokin.ik.files.target_rows import TargetFile
from jacokin.ik.results import STATUS_NAMES, BatchResult

if TYPE_CHECKING:
    import pyarrow as pa

TEXTS = ("status", "method", "message")
WRITTEN_AT_ONCE = 1 << 14  # rows


class _Parquet:
    """Answers as columns; see `formats.AnswerFormat`."""

    def encoded(self, targets: TargetFile, batch: BatchResult) -> bytes:
        """The columns of these rows, as an Arrow stream."""
        import pyarrow as pa

        columns = dict(zip(targets.columns, targets.values.T, strict=True))
        columns |= {f"q{joint + 1}": angles for joint, angles in enumerate(batch.q.T)}
        table = pa.table(
            {
                **columns,
                "status": pa.array([STATUS_NAMES[status] for status in batch.status], pa.string()),
                "position_error": batch.position_error,
                "orientation_error": batch.orientation_error,
                "method": pa.array(batch.method, pa.string()),
                "message": pa.array(batch.message, pa.string()),
            }
        )
        sink = pa.BufferOutputStream()
        with pa.ipc.new_stream(sink, table.schema) as writer:
            writer.write_table(table)
        return bytes(sink.getvalue())

    def write_joined(self, path: Path, pieces: Iterable[tuple[Path, int]], columns: Sequence[str]) -> None:
        """One row group for each piece."""
        import pyarrow.parquet as pq

        writer = None
        try:
            for piece, offset in pieces:
                table = _table(piece, offset)
                if writer is None:
                    # Joint angles do not get smaller, and writing is all that a batch on many machines waits for.
                    texts = list(TEXTS)
                    writer = pq.ParquetWriter(
                        path,
                        table.schema,
                        use_dictionary=texts,
                        compression=dict.fromkeys(texts, "snappy"),
                        write_statistics=texts,
                        write_batch_size=WRITTEN_AT_ONCE,
                    )
                writer.write_table(table, row_group_size=max(1, table.num_rows))
        finally:
            if writer is not None:
                writer.close()


def prepared() -> _Parquet:
    """The format.

    Raises:
        MissingExtraError: pyarrow is not installed.
    """
    try:
        import pyarrow.parquet  # noqa: F401 - only whether it is there
    except ImportError as error:
        raise MissingExtraError("pyarrow", "parquet") from error
    return _Parquet()


def _table(piece: Path, offset: int) -> pa.Table:
    import pyarrow as pa

    with piece.open("rb") as file:
        file.seek(offset)
        return pa.ipc.open_stream(file.read()).read_all()
