"""NPZ files: targets, read piece by piece whether they are compressed or not, and answers; NPY files of targets.

An array (n,) is a column; those that are no part of the target are carried through. An NPY file has the targets alone.
"""

from __future__ import annotations

import contextlib
import io
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from jacokin import files
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.files.targets import (
    KINDS,
    MATRIX,
    POSITION,
    QUATERNION,
    RPY,
    FilePart,
    TargetFile,
    as_array,
    choose_columns,
    equal_parts,
    is_answer,
    target_rows,
)
from jacokin.ik.results import BatchResult, Status
from jacokin.model.checks import NUMBER_KINDS

#: Arrays with several columns, by their names and shapes, and the columns that they stand for.
_GROUPS = {("position", (3,)): POSITION, ("quat_wxyz", (4,)): QUATERNION, ("rpy", (3,)): RPY}
#: Shapes of a row of targets in one array, and the columns that they stand for.
_ROWS = {(4, 4): POSITION + MATRIX, (7,): POSITION + QUATERNION, (3,): POSITION}
_SHAPES = "(n, 4, 4), (n, 7) for x, y, z, qw, qx, qy, qz, or (n, 3)"
NOT_NPZ, NOT_NPY = "is not an NPZ file", "is not an NPY file"
_NEEDED = (
    f"needed: targets {_SHAPES}; or position (n, 3) with quat_wxyz (n, 4), rpy (n, 3) or nothing; "
    "or an array (n,) for each column of a CSV file"
)
NUMBERS = {status: number for number, status in enumerate(Status)}
METHODS = ("closed_form", "qp", "")
#: Arrays of an archive of answers that are no columns of other formats, and of targets: no names for what is carried.
RESERVED = ("q", "status_names", "method_names", "targets")


def blocks(path: Path, size: int, consecutive: Sequence[FilePart] | None = None) -> Iterator[TargetFile]:
    """The targets, at most `size` at a time; of some consecutive parts, or all.

    Raises:
        InvalidInputError: no such file, not an NPZ, other arrays than are needed, of different lengths, or no rows.
    """
    with _reading(path) as (columns, members, carried):
        start, stop = 0, int(members[0].shape[0])
        if consecutive:
            start, stop = consecutive[0].first, consecutive[-1].first + consecutive[-1].rows
            for member in [*members, *carried.values()]:
                member.skip(start)
        for first in range(start, stop, size):
            count = min(size, stop - first)
            values = [_columns_of(member.rows(count).astype(np.float64)) for member in members]
            others = {name: member.rows(count) for name, member in carried.items()}
            yield target_rows(columns, np.hstack(values), np.arange(first + 1, first + count + 1), others)


def parts(path: Path, size: int) -> list[FilePart]:
    """Where the rows of each of `blocks` are. Errors as there."""
    with _reading(path) as (_, members, carried):
        # Compressed rows can only be reached through those before.
        stored = all(member.stored for member in [*members, *carried.values()])
        return equal_parts(int(members[0].shape[0]), size, alone=stored)


def read_names(path: Path) -> list[str]:
    """The names of a file's arrays, without those of answers. Errors as of `blocks`, of a file that cannot be read."""
    if _is_array(path):
        return []
    with files.open_archive(path, NOT_NPZ) as archive:
        names = [name.removesuffix(".npy") for name in archive.namelist()]
    is_solved = set(RESERVED[:3]) <= set(names)
    return [name for name in names if not (is_solved and is_answer(name))]


@contextlib.contextmanager
def _reading(path: Path) -> Iterator[tuple[tuple[str, ...], list[_Member], dict[str, _Member]]]:
    """The columns, the arrays that hold them, in their order, and those that are carried through."""
    if _is_array(path):
        with files.parsing(path, NOT_NPY), files.open_bytes(path) as file:
            targets = _Member(path, "", file, path.stat().st_size, stored=True)
            columns, members = _columns_of_targets(path, targets), [targets]
            targets.check_numbers()
            if not targets.shape[0]:
                raise InvalidInputError(f"{path}: has no rows of targets")
            yield columns, members, {}
        return
    with files.open_archive(path, NOT_NPZ) as archive, contextlib.ExitStack() as stack:
        names = [name.removesuffix(".npy") for name in archive.namelist()]
        found = {name: _opened(stack, archive, path, name) for name in names}
        columns, chosen_names = _chosen(path, found)
        members = [found[name] for name in chosen_names]
        for member in members:
            member.check_numbers()
        lengths = {member.shape[0] for member in members}
        if len(lengths) > 1:
            text = ", ".join(f"{name} {found[name].shape}" for name in chosen_names)
            raise InvalidInputError(f"{path}: the arrays have different lengths: {text}")
        if lengths == {0}:
            raise InvalidInputError(f"{path}: has no rows of targets")
        yield columns, members, _carried(found, {*columns, *chosen_names}, members[0].shape[0])


class _Member:
    """One array of the archive, read forward.

    Attributes:
        shape: of the array.
        stored: whether it is not compressed, so that rows can be skipped without reading them.
    """

    def __init__(self, path: Path, name: str, file: IO[bytes], size: int, stored: bool) -> None:
        self.shape, self._fortran, self._dtype = files.array_header(file, size)
        self._place, self._file, self.stored = f"{path}, array {name!r}" if name else str(path), file, stored
        self._size = int(np.prod(self.shape[1:])) * self._dtype.itemsize

    def check_numbers(self) -> None:
        """InvalidInputError unless it has rows of numbers, one after the other."""
        if self._dtype.kind not in NUMBER_KINDS or not self.shape:
            raise InvalidInputError(
                f"{self._place}: must be rows of real numbers, got {self._dtype} of shape {self.shape}"
            )
        if self._fortran and len(self.shape) > 1:
            raise InvalidInputError(f"{self._place}: is stored column by column: save numpy.ascontiguousarray of it")

    def check_carried(self) -> None:
        """InvalidInputError unless its values can be carried through."""
        if self._dtype.kind not in KINDS:
            raise InvalidInputError(
                f"{self._place}: cannot be carried through, since it holds {self._dtype}: save it as numbers or texts, "
                f"numpy.array(..., dtype=str)"
            )
        if self._size > files.LINE:
            raise InvalidInputError(f"{self._place}: cannot be carried through: {self._size} bytes a row")

    def skip(self, count: int) -> None:
        """Leave out the next rows of an array that is not compressed."""
        self._file.seek(count * self._size, io.SEEK_CUR)

    def rows(self, count: int) -> NDArray[np.generic]:
        """The next rows (count, ...)."""
        data = files.read_exactly(self._file, count * self._size)
        rows = np.frombuffer(data, self._dtype) if self._size else np.zeros(count, self._dtype)
        return rows.astype(self._dtype.newbyteorder("=")).reshape(count, *self.shape[1:])


def _opened(stack: contextlib.ExitStack, archive: zipfile.ZipFile, path: Path, name: str) -> _Member:
    """An array of the archive; one that is not compressed is read from the file itself, where it can be skipped in."""
    info = archive.getinfo(f"{name}.npy")
    member = stack.enter_context(archive.open(info))  # also checks that the archive has it where it says
    if info.compress_type != zipfile.ZIP_STORED:
        return _Member(path, name, member, info.file_size, stored=False)
    file = stack.enter_context(path.open("rb"))
    file.seek(info.header_offset)
    header = file.read(30)  # before the name of a file in a ZIP archive; the lengths of name and extra field end it
    file.seek(int.from_bytes(header[26:28], "little") + int.from_bytes(header[28:30], "little"), io.SEEK_CUR)
    return _Member(path, name, file, info.file_size, stored=True)


def _chosen(path: Path, found: dict[str, _Member]) -> tuple[tuple[str, ...], list[str]]:
    """The columns of a target, and the arrays that hold them."""
    if "targets" in found:
        return _columns_of_targets(path, found["targets"]), ["targets"]
    flat = {name: place for place, name in enumerate(found) if len(found[name].shape) == 1}
    if set(POSITION) <= set(flat):
        columns = choose_columns(path, list(flat), "")
        return columns.names, list(columns.names)
    names = [name for name, shape in _GROUPS if name in found and found[name].shape[1:] == shape]
    if names[:1] != ["position"] or len(names) > 2:
        have = ", ".join(f"{name} {member.shape}" for name, member in found.items()) or "nothing"
        raise InvalidInputError(f"{path}: {_NEEDED}; found: {have}")
    columns_of = {name: columns for (name, _), columns in _GROUPS.items()}
    return tuple(column for name in names for column in columns_of[name]), names


def _columns_of_targets(path: Path, targets: _Member) -> tuple[str, ...]:
    """The columns that one array of targets has."""
    if targets.shape[1:] not in _ROWS:
        raise InvalidInputError(f"{path}: targets must have shape {_SHAPES}, got {targets.shape}")
    return _ROWS[targets.shape[1:]]


def _is_array(path: Path) -> bool:
    """Whether a file is one array, told by the ending of its name."""
    return path.suffix == ".npy"


def _carried(found: dict[str, _Member], used: set[str], rows: int) -> dict[str, _Member]:
    """The arrays (n,) that are no part of a target or of answers.

    Raises:
        InvalidInputError: one holds Python objects, or several values in a row.
    """
    used |= {*POSITION, *QUATERNION, *RPY, *MATRIX, *RESERVED}
    carried = {
        name: member
        for name, member in found.items()
        if member.shape == (rows,) and name not in used and not is_answer(name)
    }
    for member in carried.values():
        member.check_carried()
    return carried


def _columns_of(rows: Array) -> Array:
    """Rows of an array as columns: of matrices, the position and the rotation."""
    if rows.ndim == 1:
        return rows[:, None]
    if rows.ndim == 2:
        return rows
    return np.hstack([rows[:, :3, 3], rows[:, :3, :3].reshape(-1, 9)])


def encode(targets: TargetFile, batch: BatchResult) -> bytes:
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
        **{name: as_array(column) for name, column in targets.carried.items()},
    )
    return stream.getvalue()


def write_joined(
    path: Path, pieces: Iterable[tuple[Path, int]], columns: Sequence[str], carried: Sequence[str] = ()
) -> None:
    """Every array as a whole, one after the other, so that none has to fit into memory."""
    paths = [piece for piece, _ in pieces]
    with zipfile.ZipFile(paths[0]) as first:  # finds the archive after what is skipped
        names = first.namelist()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED, allowZip64=True) as out:
        for name in names:
            heads = [_array(piece, name, header_only=True) for piece in paths]
            dtype = np.result_type(*{head.dtype for head in heads})  # texts are as wide as the longest
            head = np.broadcast_to(np.zeros((), dtype), (sum(map(len, heads)), *heads[0].shape[1:]))
            with _entry(out, name) as stream:
                header = np.lib.format.header_data_from_array_1_0(head)
                np.lib.format.write_array_header_1_0(stream, {**header, "fortran_order": False})
                for piece in paths:
                    stream.write(np.ascontiguousarray(_array(piece, name), dtype=dtype).tobytes())
        for name, texts in (("status_names", tuple(status.name for status in Status)), ("method_names", METHODS)):
            with _entry(out, f"{name}.npy") as stream:
                np.lib.format.write_array(stream, np.array(texts), allow_pickle=False)


def _entry(archive: zipfile.ZipFile, name: str) -> IO[bytes]:
    return archive.open(zipfile.ZipInfo(name), "w", force_zip64=True)  # with the date of all of them, 1980


def _array(piece: Path, name: str, *, header_only: bool = False) -> NDArray[np.generic]:
    with zipfile.ZipFile(piece) as archive, archive.open(name) as file:
        if not header_only:
            return np.asarray(np.lib.format.read_array(file, allow_pickle=False))
        np.lib.format.read_magic(file)
        shape, _, dtype = np.lib.format.read_array_header_1_0(file)
        return np.broadcast_to(np.zeros((), dtype=dtype), shape)
