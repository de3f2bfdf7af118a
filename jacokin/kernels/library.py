"""The kernels as machine code: one library beside this file, and calls of its functions on work arrays.

``build_kernels`` makes the library when the package is built; here it is loaded, checked, and called through ctypes.
The plain Python of the kernels remains the source, and what tests compare with; no solver runs it.
"""

from __future__ import annotations

import ctypes
import hashlib
import re
import sys
import threading
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import repeat
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from jacokin import __version__
from jacokin.errors import JacokinError

#: The library; nothing else is ever loaded.
PATH = Path(__file__).with_name("libjacokin.dylib" if sys.platform == "darwin" else "libjacokin.so")
#: Begins the names of its functions.
PREFIX = "jacokin_"
#: Ends the name of the second form of a kernel, for wider vectors: see ``c/wide.c``.
WIDE = "_avx2"
#: What a function returns where Python would have raised.
FAILED = -(2**63)
#: Begins what the library says about itself, see `about`.
MARK = "jacokin kernels"
_CURE = "install jacokin again, or in a clone run `python -m build_kernels`"
_ABOUT = re.compile(MARK.encode() + rb" (\S+) (\S+) (\d+)\n([^\0]*)\0")

Work = TypeVar("Work", bound=tuple[object, ...])


class ArrayLayout(NamedTuple):
    """One work array as the machine code reads it."""

    dtype: np.dtype[Any]
    shape: tuple[int, ...]  # a first dimension of 0 is free: the length of the array follows its address

    def fits(self, array: NDArray[np.generic]) -> bool:
        """Whether an array can be handed over."""
        return (
            array.dtype == self.dtype
            and array.flags.c_contiguous
            and array.ndim == len(self.shape)
            and array.shape[self.is_free :] == self.shape[self.is_free :]
        )

    @property
    def is_free(self) -> bool:
        """Whether the array may have any length."""
        return self.shape[0] == 0


class About(NamedTuple):
    """What a library says about itself.

    Attributes:
        version: of jacokin.
        sources: the hash of the kernels' Python.
        size: of the file [bytes].
        layouts: by function, the arrays that it reads and writes.
    """

    version: str
    sources: str
    size: int
    layouts: dict[str, tuple[ArrayLayout, ...]]

    def text(self) -> str:
        """The text that the library carries, with the size in a fixed number of digits."""
        lines = [f"{MARK} {self.version} {self.sources} {self.size:012d}"]
        for name, layout in self.layouts.items():
            arrays = (f"{array.dtype}:{','.join(map(str, array.shape))}" for array in layout)
            lines.append(" ".join([name, *arrays]))
        return "\n".join(lines) + "\n"


def about(contents: bytes) -> About | None:
    """What a file says about itself; None when it is not such a library."""
    match = _ABOUT.search(contents)
    if match is None:
        return None
    layouts = {}
    try:
        for line in match[4].decode().splitlines():
            name, *arrays = line.split()
            layouts[name] = tuple(map(_array_layout, arrays))
        return About(match[1].decode(), match[2].decode(), int(match[3]), layouts)
    except (TypeError, ValueError):  # not the text that was written
        return None


@cache  # of more than a thousand arrays, few differ
def _array_layout(text: str) -> ArrayLayout:
    dtype, shape = text.split(":")
    return ArrayLayout(np.dtype(dtype), tuple(map(int, shape.split(","))))


class Library:
    """The loaded library.

    Attributes:
        about: what it says about itself.
    """

    def __init__(self, path: Path) -> None:
        """Check the file and load it.

        Raises:
            JacokinError: it is missing, incomplete, or of another version or platform.
        """
        try:
            contents = path.read_bytes()
        except OSError as error:
            raise JacokinError(f"the compiled kernels {path} cannot be read ({error.strerror}): {_CURE}") from None
        found = about(contents)
        if found is None or len(contents) < found.size:
            raise JacokinError(f"the compiled kernels {path} are damaged or incomplete: {_CURE}")
        if found.version != __version__:
            raise JacokinError(
                f"the compiled kernels {path} are those of jacokin {found.version}, not {__version__}: {_CURE}"
            )
        try:
            self._functions = ctypes.CDLL(str(path))
        except OSError as error:
            raise JacokinError(f"the compiled kernels {path} do not load here ({error}): {_CURE}") from None
        self.about = found
        self._known: dict[str, Callable[[ctypes.c_void_p], int]] = {}

    def function(self, name: str) -> Callable[[ctypes.c_void_p], int]:
        """A function that takes the address of a table of work arrays; the GIL is released while it runs.

        Of a kernel that is there a second time for wider vectors, that one where this processor has them.
        """
        if name not in self._known:
            wide = f"{PREFIX}{name}{WIDE}"
            use_wide = hasattr(self._functions, wide) and self._functions.jacokin_is_wide()
            found = self._functions[wide if use_wide else PREFIX + name]
            found.argtypes, found.restype = [ctypes.c_void_p], ctypes.c_int64
            self._known[name] = found
        return self._known[name]


@cache
def load() -> Library:
    """The library of this package, loaded once.

    Raises:
        JacokinError: it is missing, incomplete, or of another version or platform; or, in a clone, of other sources.
    """
    library = Library(PATH)
    if (PATH.parents[2] / "build_kernels").is_dir():  # a clone, whose sources change under the library
        made = PATH.stat().st_mtime_ns
        if any(file.stat().st_mtime_ns > made for file in sources()) and library.about.sources != sources_key():
            raise JacokinError(f"the compiled kernels {PATH} are those of other sources: run `python -m build_kernels`")
    return library


def sources() -> list[Path]:
    """The kernels' Python but this file, and the C files beside them, in order."""
    kernels, headers = PATH.parent, PATH.parents[1] / "include"
    found = (*kernels.rglob("*.py"), *(kernels / "c").glob("*.[ch]"), *headers.glob("*.h*"))
    return sorted(file for file in found if file.name != Path(__file__).name)


def sources_key() -> str:
    """The hash of those files: a library made of others is out of date."""
    digest = hashlib.sha256()
    for file in sources():
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def warmup() -> float:
    """Load the compiled kernels, which building a solver does too.

    Returns:
        Seconds it took.

    Raises:
        JacokinError: the library is missing, incomplete, or of another version or platform.
    """
    start = time.perf_counter()
    load()
    return time.perf_counter() - start


class Call(Generic[Work]):
    """One kernel with work arrays of its own, for one call at a time.

    Attributes:
        work: the arrays, to be filled in and read.
    """

    __slots__ = ("_addresses", "_entries", "_function", "_table", "work")

    work: Work
    _entries: list[_Entry]

    def __init__(self, kernel: Callable[[Work], int], work: Work, before: Call[Work] | None = None) -> None:
        """Take the work arrays of a kernel.

        Args:
            kernel: a function of `entries.ENTRIES`.
            work: its arrays in nested tuples, as the entry makes them; those of length 0 there are of any length.
            before: another call of this kernel; only arrays that differ from its arrays are looked at.

        Raises:
            ValueError: an array that the machine code would misread.
            JacokinError: as `load`.
        """
        library, name = load(), kernel.__name__
        arrays = flatten(work)
        layout = library.about.layouts.get(name, ())
        if len(arrays) != len(layout):
            raise ValueError(f"{PATH} does not know {name} with {len(arrays)} arrays: {_CURE}")
        known: Iterable[_Entry | None] = repeat(None) if before is None else before._entries
        entries: list[_Entry] = []
        for array, expected, entry in zip(arrays, layout, known, strict=False):
            entries.append(entry if entry is not None and entry[0] is array else _entry(name, array, expected))
        self.work = work
        self._entries = entries
        self._addresses = np.array([word for _, words in entries for word in words], dtype=np.int64)
        self._function = library.function(name)
        self._table = ctypes.c_void_p(self._addresses.ctypes.data)  # converted once

    def __call__(self) -> int:
        """Run the kernel; returns what its Python returns."""
        result = self._function(self._table)
        if result == FAILED:
            raise JacokinError("internal error in the compiled kernels, please report it")
        return result


class Calls(Generic[Work]):
    """Calls of one kernel, a thread its own, whose work arrays have room for what was asked for last, and for more."""

    def __init__(self, kernel: Callable[[Work], int], make_work: Callable[..., Work], kept: int) -> None:
        """Take a kernel, what makes its work arrays by their sizes, and up to which size a thread keeps them."""
        self._kernel, self._make_work, self._kept = kernel, make_work, kept
        self._local = threading.local()

    def with_room(self, *sizes: int) -> Call[Work]:
        """The call of this thread, with room for at least so many of each."""
        known: tuple[tuple[int, ...], Call[Work]] | None = getattr(self._local, "known", None)
        if known is not None and all(map(int.__le__, sizes, known[0])):
            return known[1]
        if max(sizes) > self._kept:
            return Call(self._kernel, self._make_work(*sizes))
        room = tuple(2 * size for size in sizes)
        if known is not None:
            room = tuple(map(max, room, known[0]))
        call = Call(self._kernel, self._make_work(*room))
        self._local.known = room, call
        return call


class SharedCalls(Generic[Work]):
    """Calls of one kernel; each shares with the one before it in its thread those work arrays that may stay.

    What a kernel leaves in them is read before the kernel is called in another way.
    """

    def __init__(self, kernel: Callable[[Work], int]) -> None:
        """Take the kernel."""
        self._kernel, self._local = kernel, threading.local()

    def call(self, owner: object, make: Callable[[], Work], change: Callable[[Work], Work]) -> Call[Work]:
        """One more.

        Args:
            owner: what those arrays belong to. For another one, all are made anew.
            make: makes all arrays.
            change: takes arrays of the same owner, and exchanges those that may not stay.
        """
        known: tuple[object, Call[Work]] | None = getattr(self._local, "known", None)
        if known is None or known[0] is not owner:
            call = Call(self._kernel, make())
        else:
            call = Call(self._kernel, change(known[1].work), known[1])
        self._local.known = owner, call
        return call


_Entry: TypeAlias = tuple[NDArray[np.generic], tuple[int, ...]]  # an array, and what stands for it in a table


def _entry(name: str, array: NDArray[np.generic], expected: ArrayLayout) -> _Entry:
    """The entry of one array of a kernel.

    Raises:
        ValueError: the machine code would misread it.
    """
    if not expected.fits(array):
        raise ValueError(
            f"{name} needs a C-contiguous array of {expected.dtype} with shape {expected.shape}, "
            f"not of {array.dtype} with shape {array.shape}"
        )
    address = array.ctypes.data
    return array, (address, len(array)) if expected.is_free else (address,)


def flatten(value: tuple[object, ...]) -> list[NDArray[np.generic]]:
    """The arrays in nested tuples, in order."""
    found: list[NDArray[np.generic]] = []
    for member in value:
        if isinstance(member, np.ndarray):
            found.append(member)
        elif isinstance(member, tuple):
            found += flatten(member)
    return found


def share(run: Callable[[int, int], None], count: int, threads: int) -> None:
    """Call `run` with the beginning and end of shares of so many rows, one for each thread: kernels release the GIL."""
    shares = min(threads, count)
    if shares <= 1:
        if count:
            run(0, count)
        return
    edges = [round(count * part / shares) for part in range(shares + 1)]
    with ThreadPoolExecutor(shares) as pool:
        list(pool.map(run, edges[:-1], edges[1:]))
