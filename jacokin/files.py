"""Files: read whole or as streams, within bounds; written in one step, and only when they are complete.

Every file that a user names is opened by `open_bytes` or read by one of `read_bytes`, `read_rows` and `read_arrays`, or
as a document by those of `documents.py`; larger ones come from `open_table` and `table_rows`, from `open_archive` and
`open_parquet`, piece by piece; readers of other packages run within `parsing`. Whatever a file holds, they return or
raise InvalidInputError: what is endless, too large, damaged or made to exhaust time and memory is refused.
"""

from __future__ import annotations

import errno
import io
import math
import os
import re
import secrets
import stat
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, TextIO

from jacokin.errors import InvalidInputError, JacokinError, needed

if TYPE_CHECKING:
    import zipfile

    import numpy as np
    import pyarrow.parquet as pq
    from numpy.typing import NDArray

KEPT_NAME = 60  # characters of the file's name in the temporary one: the ending decides formats, names may be 255 bytes

# Bounds of what is read, by kind; what is larger is refused by name.
DOCUMENT = 10_000_000  # [byte] of JSON or text that describes something: some 100,000 shapes of a scene
DESCRIPTION = 50_000_000  # [byte] of a robot as XML, whose meshes may stand in it as numbers
TABLE = 500_000_000  # [byte] of rows as CSV: three hours of a trajectory at 100 Hz
HELD = 10_000_000  # rows of a table that is held: a trajectory of a day at 100 Hz has 8,640,000
MESSAGE = 200_000_000  # [byte] of a trajectory as JSON, which takes twenty times as much: an hour at 100 Hz has 1.5e8
LINE = 65_536  # characters of a row of a table: some 3000 numbers
ARRAYS = 2_000_000_000  # [byte] of an archive's arrays: a trajectory of a day at 100 Hz takes 1.2e9
LOG = 5_000_000_000  # [byte] of a recording of ROS: a day of joint states at 100 Hz takes 4.6e9
PIPED = 10_000_000_000  # [byte] that are copied from a pipe: a hundred million targets

ENCRYPTED = 0x1  # flag of a member of an archive
MEMBERS = 1000  # arrays of an archive; each is an open file
DIRECTORY = 16_000_000  # [byte] read from an archive at once: its list of members, or a part of one
ARRAY_HEADER = 10_000  # [byte], NumPy's own bound
_READING_HEADER = threading.Lock()  # it is a literal, and CPython 3.11 may fail where two threads parse one
DEFLATION = 1100  # byte that one compressed byte can stand for: 1032 by the format, and a margin
ARRAY_KINDS, TEXT_KIND = "biufcSU", "U"  # of NumPy's types: those that are read, and texts among them
ROWS = 10_000_000_000  # of a Parquet file, which can say a number often in little space
PIECE = 1_000_000  # [byte] read at once
PATIENCE, WAIT = 10.0, 0.05  # [s] that a named pipe may be without a writer, and between two looks
# Numbers as C reads them: Python's float also takes 1_0 and digits of other scripts, which in a file are mistakes.
NUMBER_TEXT = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
NOT_FINITE_TEXT = re.compile(r"[-+]?(nan|inf|infinity)", re.IGNORECASE | re.ASCII)
SHOWN_ERROR = 300  # characters of what a parser says
OPEN_FILE = re.compile(r"/dev/(?:std(out|err)|fd/(\d{1,4}))|/proc/self/fd/(\d{1,4})", re.ASCII)
LINKS = 40  # of links to a file, as Linux follows them
NO_ROOM = errno.ENOSPC, errno.EDQUOT, errno.EFBIG


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary path to write to, beside the final one.

    It takes the final name when the block ends well and is removed when the block raises. Links are followed. A new
    file gets the permissions that the umask leaves, a replaced one keeps its own. What is not a regular file (a pipe)
    is handed out as it is; to an open file of the process (/dev/stdout) is added what the block has written.

    Raises:
        InvalidInputError: the file cannot be written; raised before the block runs where that can be known.
    """
    descriptor = open_file(path)
    if descriptor is not None:
        import shutil  # which brings every compression, as tempfile does
        import tempfile

        with tempfile.TemporaryDirectory() as folder:
            written = Path(folder) / path.name
            with _named(path, written):
                yield written
            try:
                with written.open("rb") as made, open(descriptor, "wb", closefd=False) as stream:
                    shutil.copyfileobj(made, stream)
            except OSError as error:
                raise InvalidInputError(f"{path}: cannot be written: {error.strerror}") from error
        return
    if is_device(path):
        with _named(path, path):
            yield path
        return
    final = writable(path)
    temporary = final.with_name(f".{secrets.token_hex(8)}-{final.name[-KEPT_NAME:]}")
    try:  # from here on an interrupt, too, leaves nothing behind
        try:
            temporary.touch(exist_ok=False)
        except OSError as error:
            raise InvalidInputError(f"{path}: cannot be written: {error.strerror}") from error
        with _named(path, temporary):
            yield temporary
        try:
            if final.exists():
                temporary.chmod(stat.S_IMODE(final.stat().st_mode))
            temporary.replace(final)
        except OSError as error:
            raise InvalidInputError(f"{path}: cannot be written: {error.strerror}") from error
    finally:
        with suppress(NotADirectoryError):  # where a folder of the path is a file, nothing was made
            temporary.unlink(missing_ok=True)


@contextmanager
def _named(path: Path, written: Path) -> Iterator[None]:
    """Errors of what is written for a path name that path, whatever it is written to.

    Raises:
        InvalidInputError: as it was; or it cannot be written, or not all of it.
    """
    try:
        yield
    except InvalidInputError as error:
        if str(written) not in str(error):
            raise
        raise InvalidInputError(str(error).replace(str(written), str(path))) from error
    except OSError as error:
        # A write that finds no room does not say to what.
        if error.errno not in NO_ROOM and str(written) not in map(str, (error.filename, error.filename2)):
            raise
        raise InvalidInputError(f"{path}: cannot be written: {reason(error)}") from error


def open_file(path: Path) -> int | None:
    """The descriptor of an open file of this process that a path names, as /dev/stdout does; None for other paths.

    Opened by its name, a file that stdout is redirected to would lose what it holds.
    """
    for _ in range(LINKS):
        match = OPEN_FILE.fullmatch(str(path))
        if match is not None:
            return {"out": 1, "err": 2}.get(match[1]) or int(match[2] or match[3])
        try:
            path = path.parent / path.readlink()
        except (OSError, ValueError):  # no link, or no file can have that name
            break
    return None


def is_device(path: Path) -> bool:
    """Whether something is there that is neither a file nor a folder, as a pipe, or an open file of the process."""
    if open_file(path) is not None:
        return True
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):  # nothing is there, or no file can have that name, of which `writable` says why
        return False
    return not stat.S_ISREG(mode) and not stat.S_ISDIR(mode)


def reason(error: Exception) -> str:
    """What the system says of a name; Python itself raises a ValueError on a null byte."""
    return str(getattr(error, "strerror", None) or error)


def writable(path: Path) -> Path:
    """Where a file ends up when links are followed.

    Raises:
        InvalidInputError: a file there cannot be written, as far as that can be known.
    """
    try:
        final = path.resolve()
        final.lstat()
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        pass  # whoever writes finds out
    except (OSError, RuntimeError, ValueError) as error:  # a loop of links, a null byte, a name that is too long
        raise InvalidInputError(f"{path}: cannot be written: {reason(error)}") from error
    if final.is_symlink():  # as Python 3.13 leaves a loop
        raise InvalidInputError(f"{path}: cannot be written: its links lead in a circle")
    if final.is_dir():
        raise InvalidInputError(f"{path}: cannot be written: it is a folder")
    if final.exists() and not os.access(final, os.W_OK):
        raise InvalidInputError(f"{path}: cannot be written: permission denied")
    return final


def open_bytes(path: Path) -> io.BufferedReader:
    """A regular file, opened.

    Raises:
        InvalidInputError: no such file, or it is something else.
    """
    try:
        mode = path.stat().st_mode
        if stat.S_ISREG(mode):
            return path.open("rb")
    except OSError as error:
        raise _unreadable(path, error) from error
    except ValueError as error:  # a null byte
        raise InvalidInputError(f"{str(path)!r}: cannot be read: {error}") from error
    kind = "is a folder" if stat.S_ISDIR(mode) else "is not a regular file (a pipe, socket or device)"
    raise InvalidInputError(f"{path}: cannot be read: it {kind}")


def is_pipe(path: Path) -> bool:
    """Whether something is there that is read once and has an end: a pipe, or a terminal.

    Raises:
        InvalidInputError: it is another device, such as /dev/zero, which has no end.
    """
    try:
        mode = path.stat().st_mode
        if stat.S_ISREG(mode) or stat.S_ISDIR(mode):
            return False
        if stat.S_ISFIFO(mode):
            return True
        if stat.S_ISCHR(mode):
            with path.open("rb") as device:
                if device.isatty():
                    return True
    except (OSError, ValueError):  # `open_bytes` says why
        return False
    raise InvalidInputError(f"{path}: is a device: give a file or a pipe")


def pieces(path: Path, largest: int) -> Iterator[bytes]:
    """What a file or a pipe holds, in pieces.

    Raises:
        InvalidInputError: it cannot be read, has no end, is larger than that many bytes, or is a named pipe that
            nobody writes to.
    """
    total = 0
    try:
        with _open_pipe(path) if is_pipe(path) else open_bytes(path) as file:
            if os.fstat(file.fileno()).st_size > largest:
                raise _too_large(path, largest)
            piece = _first_piece(path, file) if isinstance(file, io.FileIO) else file.read(PIECE)
            while piece:
                total += len(piece)
                if total > largest:
                    raise _too_large(path, largest)
                yield piece
                piece = file.read(PIECE)
    except OSError as error:
        raise _unreadable(path, error) from error


def _open_pipe(path: Path) -> io.FileIO:
    """A pipe or a terminal, without waiting for a writer."""
    return io.FileIO(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY))


def _first_piece(path: Path, pipe: io.FileIO) -> bytes:
    """What comes first from a pipe, however late it is written.

    Raises:
        InvalidInputError: it has a name, and nobody opens it for writing.
    """
    named, give_up = Path(os.path.realpath(path)).exists(), time.monotonic() + PATIENCE
    while (piece := pipe.read(PIECE)) == b"" and named:  # None is a writer that has not written yet
        if time.monotonic() > give_up:
            raise InvalidInputError(f"{path}: is a pipe that nothing has written to for {PATIENCE:g} s")
        time.sleep(WAIT)
    os.set_blocking(pipe.fileno(), True)
    return pipe.read(PIECE) or b"" if piece is None else piece


def read_bytes(path: Path, largest: int = DOCUMENT) -> bytes:
    """A file or what comes from a pipe; errors as `pieces`."""
    with parsing(path, "cannot be read"):
        return b"".join(pieces(path, largest))


def open_table(path: Path, largest: int | None = TABLE) -> TextIO:
    """A CSV file as a stream of text, line ends within its cells as they are; of a pipe, all that it holds.

    Args:
        path: the file.
        largest: bytes that it may have; None for a file of any length. A pipe may hold `TABLE` bytes.

    Raises:
        InvalidInputError: as `pieces`.
    """
    binary: IO[bytes] = io.BytesIO(read_bytes(path, TABLE)) if is_pipe(path) else open_bytes(path)
    if largest is not None and binary.seek(0, io.SEEK_END) > largest:
        binary.close()
        raise _too_large(path, largest)
    binary.seek(0)
    return io.TextIOWrapper(binary, encoding="utf-8-sig", newline="")


def table_lines(path: Path, file: TextIO) -> Iterator[str]:
    """The lines of a table.

    Raises:
        InvalidInputError: one is longer than `LINE` characters, or it is not text.
    """
    with parsing(path, "is not a text file in UTF-8"):
        for number, line in enumerate(iter(partial(file.readline, LINE), ""), start=1):
            if len(line) == LINE:
                raise InvalidInputError(f"{path}, line {number}: is longer than {LINE} characters: not a table")
            yield line


def table_rows(path: Path, lines: Iterable[str], first: int = 1) -> Iterator[tuple[int, list[str]]]:
    """The cells of each row of a CSV file, and the number of the line on which it ends.

    Args:
        path: the file.
        lines: its lines, or some of them.
        first: number of the first of them.

    Raises:
        InvalidInputError: not CSV, a cell is too long, or a row is longer than `LINE` characters.
    """
    import csv

    length = 0

    def counted() -> Iterator[str]:
        nonlocal length
        for line in lines:
            length += len(line)
            if length > LINE:  # quoted cells may hold line ends
                raise InvalidInputError(f"{path}, line {first + reader.line_num}: its row does not end: not a table")
            yield line

    reader = csv.reader(counted(), strict=True)
    with parsing(path, "is not a CSV file"):
        for row in reader:
            length = 0
            yield first + reader.line_num - 1, row


def read_rows(path: Path) -> list[tuple[int, list[str]]]:
    """The rows of a CSV file that are not blank, and the number of the line on which each ends.

    Raises:
        InvalidInputError: as `open_table` and `table_rows`, or more than `HELD` rows.
    """
    found = []
    with open_table(path) as file:
        for line, row in table_rows(path, table_lines(path, file)):
            if row:
                found.append((line, row))
            if len(found) > HELD:
                raise InvalidInputError(f"{path}: has more than {HELD} rows")
    return found


def plain_numbers(cells: Iterable[str]) -> list[float]:
    """The numbers of some cells, as C reads them, or NaN and infinities.

    Raises:
        ValueError: one is something else.
    """
    found = []
    for cell in cells:
        if "_" in cell or not cell.isascii():  # Python's float takes these too
            raise ValueError(f"{cell!r} is not a number")
        found.append(float(cell))
    return found


def read_arrays(path: Path, otherwise: str, names: Iterable[str] = ()) -> dict[str, NDArray[np.generic]]:
    """Read an NPZ file of numbers and texts.

    Args:
        path: the file.
        otherwise: what the error says of a file that is damaged or something else, such as "is not a recording".
        names: of arrays that must be there.

    Raises:
        InvalidInputError: unreadable, not an archive of plain arrays, of more than `ARRAYS` bytes, or without one of
            those names.
    """
    with open_archive(path, otherwise) as archive:
        if sum(member.file_size for member in archive.infolist()) > ARRAYS:
            raise ValueError(f"its arrays have more than {ARRAYS} bytes")
        found = {member.filename.removesuffix(".npy"): _array(archive, member) for member in archive.infolist()}
        for name in names:
            if name not in found:
                raise ValueError(f"it lacks {name!r}, and has {', '.join(map(repr, found)) or 'nothing'}")
        return found


@contextmanager
def open_archive(path: Path, otherwise: str) -> Iterator[zipfile.ZipFile]:
    """An NPZ file, its list of members checked; whatever goes wrong in the block is an error in the file.

    Raises:
        InvalidInputError: unreadable, not an archive, too many members, or one that is not an array, is stored in
            another way than NumPy does, or claims more than can be there.
    """
    import zipfile  # like NumPy, not for the command line's help

    with parsing(path, otherwise), _Bounded(open_bytes(path).detach()) as plain, zipfile.ZipFile(plain) as archive:
        members, there = archive.infolist(), os.fstat(plain.fileno()).st_size
        if len(members) > MEMBERS:
            raise ValueError(f"has {len(members)} members")
        for member in members:
            if not member.filename.endswith(".npy"):
                raise ValueError(f"{member.filename} is not an array")
            if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) or member.flag_bits & ENCRYPTED:
                raise ValueError(f"{member.filename} is compressed or encrypted in another way than NumPy does")
            most = member.compress_size * (DEFLATION if member.compress_type == zipfile.ZIP_DEFLATED else 1)
            if member.compress_size > there or member.file_size > most:
                raise ValueError(f"{member.filename} claims {member.file_size} bytes")
        yield archive


@contextmanager
def open_parquet(path: Path, otherwise: str) -> Iterator[pq.ParquetFile]:
    """A Parquet file; whatever goes wrong in the block is an error in the file.

    Raises:
        InvalidInputError: unreadable, not such a file, or of more than `ROWS` rows.
        MissingExtraError: pyarrow is not installed.
    """
    with needed("pyarrow", "parquet"):
        import pyarrow.parquet as pq
    open_bytes(path).close()
    # Without buffering ahead: that would hold a row group, which may be the whole file.
    with parsing(path, otherwise), pq.ParquetFile(path, pre_buffer=False, buffer_size=1 << 20) as file:
        if not 0 <= file.metadata.num_rows <= ROWS:
            raise ValueError(f"claims {file.metadata.num_rows} rows")
        yield file


class _Bounded(io.BufferedReader):
    """A file that is never read by more than `DIRECTORY` bytes at once, whatever it says itself."""

    def read(self, size: int | None = -1, /) -> bytes:
        """Read at most `size` bytes.

        Raises:
            ValueError: more than the bound.
        """
        if size is not None and size > DIRECTORY:
            raise ValueError(f"claims {size} bytes for a list of its members")
        return super().read(size)


def array_header(stream: IO[bytes], size: int) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, whether it is stored column by column, and type of an NPY file.

    Args:
        stream: of the file.
        size: bytes that it has.

    Raises:
        ValueError: not an NPY file, or it claims more than it has. Others, as NumPy's reader raises them.
    """
    import warnings

    import numpy as np

    version = np.lib.format.read_magic(stream)
    digits = stream.read(2 if version == (1, 0) else 4)
    length = int.from_bytes(digits, "little")
    if length > ARRAY_HEADER:
        raise ValueError(f"a header of {length} bytes")
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    with _READING_HEADER, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # NumPy's, of files of Python 2, and Python's, of what is to be a header
        shape, by_columns, dtype = read(io.BytesIO(digits + stream.read(length)))
    # A pickled array has any size, and is never read.
    most = 0 if dtype.hasobject else max(math.prod(shape), *shape, 0) * max(dtype.itemsize, 1)
    if min(shape, default=0) < 0 or most > size:
        raise ValueError(f"claims an array {shape} of {dtype} in {size} bytes")
    return shape, by_columns, dtype


def read_exactly(stream: IO[bytes], size: int) -> bytearray:
    """So many bytes.

    Raises:
        EOFError: the stream ends before.
    """
    content = bytearray()
    while len(content) < size:
        piece = stream.read(min(PIECE, size - len(content)))
        if not piece:
            raise EOFError(f"{size - len(content)} bytes are missing")
        content += piece
    return content


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[np.generic]:
    """An array of numbers or texts.

    Raises:
        ValueError: it is another one. Others, as zipfile's and NumPy's readers raise them.
    """
    import numpy as np

    with archive.open(member) as stream:
        shape, by_columns, dtype = array_header(stream, member.file_size)
        if dtype.kind not in ARRAY_KINDS:
            raise ValueError(f"{member.filename} holds {dtype}")
        content = read_exactly(stream, math.prod(shape) * dtype.itemsize)
        if stream.read(1):  # at the end, zipfile checks the sum
            raise ValueError(f"{member.filename} holds more than its array")
    if not content:
        return np.zeros(shape, dtype)
    if dtype.kind == TEXT_KIND:
        codes = np.frombuffer(content, np.dtype("u4").newbyteorder(dtype.byteorder))
        if ((codes > 0x10FFFF) | ((codes >= 0xD800) & (codes < 0xE000))).any():
            raise ValueError(f"{member.filename} holds texts that are not Unicode")
    return np.frombuffer(content, dtype).reshape(shape, order="F" if by_columns else "C")


@contextmanager
def parsing(path: Path, otherwise: str) -> Iterator[None]:
    """Say of whatever goes wrong that the file is at fault."""
    try:
        yield
    except InvalidInputError as error:
        if str(path) in str(error):
            raise
        raise InvalidInputError(f"{path}: {error}") from error
    except JacokinError:
        raise
    except MemoryError as error:
        raise InvalidInputError(f"{path}: {otherwise}: it does not fit into memory") from error
    except RecursionError as error:
        raise InvalidInputError(f"{path}: {otherwise}: it is nested too deeply") from error
    except Exception as error:  # parsers of damaged content raise whatever they stumble over
        if isinstance(error, OSError) and error.errno is not None:  # the system's; others are of what the file holds
            raise _unreadable(path, error) from error
        # A KeyError's text is the repr of what it says.
        text = str(error.args[0] if isinstance(error, KeyError) and error.args else error) or type(error).__name__
        cut = text if len(text) <= SHOWN_ERROR else f"{text[:SHOWN_ERROR]}..."
        raise InvalidInputError(f"{path}: {otherwise}: {cut}") from error


def _unreadable(path: Path, error: OSError) -> InvalidInputError:
    return InvalidInputError(f"{path}: cannot be read: {error.strerror or error}")


def _too_large(path: Path, largest: int) -> InvalidInputError:
    return InvalidInputError(f"{path}: is larger than the {largest} bytes that are read of such a file")
