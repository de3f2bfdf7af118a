"""From the kernels' Python to machine code, by numba. Run as a program, it writes the machine code to stdout.

There is one implementation, the functions of the modules in ``kernels``; here they are compiled for one signature. The
result is an object file that refers to the C library and nothing else, so that `kernel_library` loads it without numba.
"""

from __future__ import annotations

import ctypes
import gc
import importlib
import sys
import types
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from jacokin.ik.closed_form.curves.curve_family import make_curve_work
from jacokin.ik.closed_form.kernel_library import (
    HEADER,
    SOLVE_TARGETS,
    SYMBOL,
    Call,
    CurveCall,
    KernelLibrary,
    target_machine,
)
from jacokin.ik.closed_form.kernels.pose import COLUMNS, MAX_BRANCHES, make_work
from jacokin.ik.closed_form.one_module import linked, optimise, translating_only

if TYPE_CHECKING:
    from numba.core.dispatcher import Dispatcher

#: In order of use: each module needs only functions of the ones before it.
KERNEL_MODULES = (
    "kernels.vector",
    "kernels.tolerances",
    "kernels.arm",
    "kernels.resultant",
    "kernels.roots",
    "kernels.wrist",
    "kernels.spherical",
    "kernels.chain",
    "kernels.limits",
    "kernels.folds",
    "kernels.pose",
    "kernels.batch",
    "curves.chain7",
    "curves.follow",
    "curves.seven",
    "curves.slices",
    "curves.gaps.windows",
    "curves.gaps.loops",
    "curves.bridge",
    "curves.graph",
    "curves.arcs",
    "curves.between",
    "curves.limit_cuts",
    "curves.nearest.chord",
    "curves.nearest.sweep",
    "curves.curve_family",
)
_PACKAGE = "jacokin.ik.closed_form"
#: Shapes of the arguments of `kernels.batch.solve_targets`, apart from its work arrays; n targets, m rows to keep.
_SHAPES = {"chain": "(7, 3, 4)", "arm": "(39,)", "limits": "(3, 6)", "T": "(n, 4, 4)", "seed": "(n, 6)"}
# The compiled form does the plain form's operations in the same order, without fastmath: both give the same bits.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
# Arrays belong to the caller of the kernels: the code that counts references to them would be half of all code.
_KERNEL_OPTIONS: dict[str, Any] = {**_OPTIONS, "_nrt": False}
# Functions that most poses need not: these stay calls. The other kernels become part of their callers, because passing
# a tuple of arrays takes as long as most of them do. Curves are left to the compiler: they take longer anyway.
_CALLED = frozenset(
    (
        "add_fold",
        "branches_in_interval",
        "branches_of_spherical_wrist",
        "eliminate",
        "fourier_of_divided_F",
        "hold_on_limits",
        "least_squares",
        "linearise",
        "polish",
        "solve_fold",
        "sort_rows",
        "spherical_starts",
        "starts_of_g",
    )
)
# What frees an array that nobody needs any more. All arrays here belong to the caller: there is nothing to free.
_NOTHING_TO_FREE = "define void @NRT_MemInfo_call_dtor(ptr %memory) { ret void }"


def compile_kernels() -> bytes:
    """The object file with the one function `kernel_library.SYMBOL`."""
    import numba
    from numba import types as nb

    namespace = one_namespace([importlib.import_module(f"{_PACKAGE}.{name}") for name in KERNEL_MODULES])
    namespace.update(__name__=_PACKAGE, __builtins__=__builtins__)
    # Copies that see each other's compiled forms; the modules themselves stay plain.
    for name, value in list(namespace.items()):
        if isinstance(value, types.FunctionType):
            inlined = name not in _CALLED and value.__module__.startswith(f"{_PACKAGE}.kernels.")
            copy = types.FunctionType(value.__code__, namespace, name)
            namespace[name] = numba.njit(copy, forceinline=inlined, **_KERNEL_OPTIONS)
    namespace.update(carray=numba.carray, pointer=_pointer_intrinsic(), float64=np.float64, int64=np.int64)
    exec(_entry_source(namespace), namespace)
    entry = numba.njit(namespace["entry"], **_OPTIONS)
    with translating_only():
        entry.compile((nb.intp,))
        return _object_file(entry)


def one_namespace(modules: Sequence[types.ModuleType]) -> dict[str, Any]:
    """Every function and constant of the kernel modules by its name.

    Raises:
        ValueError: a name stands for two things.
    """
    namespace: dict[str, Any] = {}
    for module in modules:
        for name, value in vars(module).items():
            if not name.startswith("__") and namespace.setdefault(name, value) is not value:
                raise ValueError(f"{name} in {module.__name__} has another meaning in an earlier kernel module")
    return namespace


def _entry_source(namespace: dict[str, Any]) -> str:
    """A function that finds the arrays of a `kernel_library.Call` or `CurveCall` through its table of addresses."""
    targets = _Arrays(namespace)
    arguments = [targets.array("float64", shape) for shape in _SHAPES.values()]
    arguments.append(targets.nested(make_work(np.empty((MAX_BRANCHES, COLUMNS)))))
    arguments.append(targets.array("float64", "(m, BATCH_COLUMNS)"))
    curves = _Arrays(namespace)
    work = curves.nested(make_curve_work())
    return (
        "def entry(address):\n"
        f"    header = carray(pointer(int64, address), {HEADER})\n    task, n, m = header[0], header[1], header[2]\n"
        f"    if task == {SOLVE_TARGETS}:\n"
        f"        table = carray(pointer(int64, address), {targets.addresses})\n"
        f"        return solve_targets({', '.join(arguments)})\n"
        f"    table = carray(pointer(int64, address), {curves.addresses})\n"
        f"    return run_curves({work})\n"
    )


class _Arrays:
    """Source text that builds arrays from the addresses of a table, one after another.

    Attributes:
        addresses: size of the table so far.
    """

    def __init__(self, namespace: dict[str, Any]) -> None:
        self.addresses = HEADER
        self._namespace = namespace

    def array(self, dtype: str, shape: str) -> str:
        """The next address as an array."""
        self.addresses += 1
        return f"carray(pointer({dtype}, table[{self.addresses - 1}]), {shape})"

    def nested(self, value: object) -> str:
        """The next addresses as the arrays of nested tuples."""
        if isinstance(value, np.ndarray):
            return self.array(value.dtype.name, repr(value.shape))
        assert isinstance(value, tuple)
        self._namespace[type(value).__name__] = type(value)
        return f"{type(value).__name__}({', '.join(map(self.nested, value))})"


def _pointer_intrinsic() -> Any:
    """A function of compiled code: pointer(dtype, address)."""
    from numba import types as nb
    from numba.extending import intrinsic

    def pointer(typing_context: Any, dtype: Any, address: Any) -> Any:
        signature = nb.CPointer(dtype.dtype)(dtype, nb.intp)

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[1], context.get_value_type(signature.return_type))

        return signature, generate

    return intrinsic(pointer)


def _object_file(entry: Dispatcher) -> bytes:
    """Machine code of a compiled function, under the name `SYMBOL`.

    Raises:
        RuntimeError: it calls what is not there without numba.
    """
    import llvmlite.binding as llvm

    process = ctypes.CDLL(None)  # what a process without numba finds; llvmlite would find numba's functions as well
    machine = target_machine()
    module, name = linked(entry)
    module.link_in(llvm.parse_assembly(_NOTHING_TO_FREE))
    for function in module.functions:
        if function.name == name:
            function.name = SYMBOL
        elif not function.is_declaration:
            function.linkage = "internal"
    optimise(module, machine)
    for function in module.functions:
        known = function.name.startswith("llvm.") or hasattr(process, function.name)
        if function.is_declaration and not known:
            raise RuntimeError(f"the compiled kernels call {function.name}, which exists within numba only")
    return bytes(machine.emit_object(module))


def main() -> None:
    """Compile, try the result, and write it to stdout as a cache file."""
    from jacokin.ik.closed_form import cache

    name = cache.key()  # of what is imported, not of what may stand in the files when this ends
    gc.disable()  # most objects of a compiler live until it ends: looking for dead ones takes a third of the time
    code = compile_kernels()
    empty = np.zeros((7, 3, 4)), np.zeros(39), np.zeros((3, 6)), np.zeros((0, 4, 4)), np.zeros((0, 6))
    library = KernelLibrary(code)
    Call(library, *empty)()
    CurveCall(library)()
    sys.stdout.buffer.write(cache.packed(code, name))
    sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
