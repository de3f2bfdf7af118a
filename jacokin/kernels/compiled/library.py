"""The kernels as machine code: loaded by llvmlite, called through ctypes. numba is not needed for it."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import JacokinError
from jacokin.kernels.closed_form.batch import BATCH_COLUMNS
from jacokin.kernels.closed_form.pose import COLUMNS, MAX_BRANCHES, make_work
from jacokin.kernels.self_motion.intervals import make_curve_work, run_curves

if TYPE_CHECKING:
    from llvmlite.binding import TargetMachine

#: Name of the one function of the machine code.
SYMBOL = "jacokin_solve_targets"

#: First entry of a table of addresses: what to run. Two sizes follow, then the addresses.
SOLVE_TARGETS, RUN_CURVES = 0, 1
HEADER = 3

NO_BATCH = np.empty((0, BATCH_COLUMNS))

# numba's convention: status = function(address of the result, address of what an exception leaves, arguments...).
_FUNCTION_TYPE = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)


class KernelLibrary:
    """Machine code in memory, ready to be called; the GIL is released during calls."""

    def __init__(self, code: bytes) -> None:
        """Load an object file.

        Args:
            code: what `compiler.compile_kernels` returned on a machine of this kind.

        Raises:
            RuntimeError: it does not contain the kernels.
        """
        import llvmlite.binding as llvm  # not needed before there is something to load

        machine = target_machine()
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        address = self._engine.get_function_address(SYMBOL)
        if not address:
            raise RuntimeError("the object file does not contain the kernels")
        self.function = _FUNCTION_TYPE(address)


def target_machine() -> TargetMachine:
    """What numba compiles for: this CPU, with code placed anywhere in memory."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    name, features = cpu()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=name, features=features, opt=3, codemodel="jitdefault", jit=True
    )


def cpu() -> tuple[str, str]:
    """Name and features of the CPU that is compiled for.

    ``NUMBA_CPU_NAME`` and ``NUMBA_CPU_FEATURES`` are respected, as numba does: with "generic" the machine code runs on
    every CPU of the architecture.
    """
    import llvmlite.binding as llvm

    name = os.environ.get("NUMBA_CPU_NAME") or llvm.get_host_cpu_name()
    features = os.environ.get("NUMBA_CPU_FEATURES")
    if features is None:
        try:
            features = "" if name == "generic" else llvm.get_host_cpu_features().flatten()
        except RuntimeError:  # not known to LLVM on every system
            features = ""
    return name, features


class KernelCall:
    """Everything one call at a time needs: its arrays, and a table of their addresses for the machine code.

    Attributes:
        T: (n, 4, 4) targets T_base_tool, to be filled in.
        seed: (n, 6) seeds [rad], to be filled in.
        rows: (24, 17) branches of the last target.
    """

    __slots__ = ("T", "_addresses", "_alive", "_function", "_returned", "rows", "seed")

    def __init__(
        self,
        library: KernelLibrary,
        chain: Array,
        arm: Array,
        limits: Array,
        T: Array,
        seed: Array,
        best: Array = NO_BATCH,
    ) -> None:
        """Take arrays as `closed_form.batch.solve_targets` needs them.

        Raises:
            ValueError: a shape, type or memory layout that the machine code would misread.
        """
        self.T, self.seed, self.rows = T, seed, np.empty((MAX_BRANCHES, COLUMNS))
        arrays = list(flatten((chain, arm, limits, T, seed, make_work(self.rows), best)))
        if T.shape != (len(T), 4, 4) or seed.shape != (len(T), 6) or not all(map(_is_readable, arrays)):
            raise ValueError("the kernels need C-contiguous arrays of 64-bit numbers, a seed for each target")
        table = np.array([SOLVE_TARGETS, len(T), len(best), *(array.ctypes.data for array in arrays)], dtype=np.int64)
        returned = np.zeros(2, np.int64)  # the count; where an exception would be described
        self._returned = memoryview(returned)  # type: ignore[arg-type]  # arrays are buffers
        self._alive = (library, arrays, table)
        self._function = library.function
        addresses = returned.ctypes.data, returned.ctypes.data + 8, table.ctypes.data
        self._addresses = tuple(map(ctypes.c_void_p, addresses))  # converted once

    def __call__(self) -> int:
        """Run the kernels; returns how many rows were filled."""
        if self._function(*self._addresses) != 0:
            raise JacokinError("internal error in the compiled closed form, please report it")
        return self._returned[0]


class CurveCall:
    """Everything one call of `self_motion.intervals.run_curves` at a time needs.

    Attributes:
        work: the arrays, to be filled in and read.
        library: the machine code that runs; None for the plain form.
    """

    __slots__ = ("_addresses", "_alive", "_function", "_returned", "library", "work")

    def __init__(self, library: KernelLibrary | None) -> None:
        """Make the arrays; without machine code the plain form runs."""
        self.work, self.library = make_curve_work(), library
        self._function = None if library is None else library.function
        arrays = list(flatten(self.work))
        table = np.array([RUN_CURVES, 0, 0, *(array.ctypes.data for array in arrays)], dtype=np.int64)
        self._returned = np.zeros(2, np.int64)
        self._alive = (library, arrays, table)
        self._addresses = (self._returned.ctypes.data, self._returned.ctypes.data + 8, table.ctypes.data)

    def __call__(self) -> int:
        """Run the kernels; returns what `run_curves` returns."""
        if self._function is None:
            with np.errstate(all="ignore"):  # as machine code does
                return run_curves(self.work)
        if self._function(*self._addresses) != 0:
            raise JacokinError("internal error in the compiled closed form, please report it")
        return int(self._returned[0])


def flatten(value: object) -> Iterator[NDArray[np.generic]]:
    """The arrays in nested tuples, in order."""
    if isinstance(value, tuple):
        for member in value:
            yield from flatten(member)
    elif isinstance(value, np.ndarray):
        yield value


def _is_readable(array: NDArray[np.generic]) -> bool:
    return array.flags.c_contiguous and array.dtype in (np.float64, np.int64)
