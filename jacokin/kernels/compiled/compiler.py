"""From the kernels' Python to machine code, by numba. Run as a program, it writes the machine code to stdout.

No other process imports it: numba loads with it.

There is one implementation, the functions of the modules in ``kernels``; here they are compiled for one signature. The
result is an object file that refers to the C library and nothing else, so that `library` loads it without numba.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import importlib
import sys
import types
from collections.abc import Iterator, Sequence
from typing import Any

import llvmlite.binding as llvm
import numba
import numpy as np
from llvmlite.binding import ModuleRef, TargetMachine
from numba import types as nb
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.dispatcher import Dispatcher
from numba.core.registry import cpu_target
from numba.extending import intrinsic

from jacokin.kernels.closed_form.pose import COLUMNS, MAX_BRANCHES, make_work
from jacokin.kernels.compiled import cache
from jacokin.kernels.compiled.library import (
    HEADER,
    SOLVE_TARGETS,
    SYMBOL,
    CurveCall,
    KernelCall,
    KernelLibrary,
    target_machine,
)
from jacokin.kernels.self_motion.intervals import make_curve_work


@contextlib.contextmanager
def translating_only() -> Iterator[None]:
    """Meanwhile numba translates functions to LLVM's language, but neither optimises nor loads them.

    For a process that compiles nothing else: what it compiles later may lack parts that were compiled meanwhile.
    """

    class Library(JITCodeLibrary):  # type: ignore[misc]  # numba has no types
        """One function: not link with those it calls."""

        def finalize(self) -> None:
            self._raise_if_finalized()
            self._finalized = True

        def _optimize_functions(self, module: Any) -> None:
            module.data_layout = self._codegen._data_layout

        def get_pointer_to_function(self, name: str) -> int:
            return 0

    class Codegen(JITCPUCodegen):  # type: ignore[misc]  # numba has no types
        """Makes such libraries."""

        _library_class = Library

        def set_env(self, env_name: str, env: object) -> None:
            """Nothing is in memory."""

    context = cpu_target.target_context
    usual = context._internal_codegen
    context._internal_codegen = Codegen("jacokin")
    try:
        yield
    finally:
        context._internal_codegen = usual


def link(entry: Dispatcher) -> tuple[ModuleRef, str]:
    """The module of a function's one compiled form with all that it calls, and the function's name there."""
    (compiled,) = entry.overloads.values()
    libraries: list[Any] = []
    _append_after_callees(compiled.library, libraries)
    module = llvm.parse_bitcode(compiled.library._final_module.as_bitcode())
    # Linking takes over what is missing so far: callers come first.
    for library in reversed(libraries[:-1]):
        module.link_in(library._get_module_for_linking(), preserve=True)
    return module, compiled.fndesc.llvm_func_name


def _append_after_callees(library: Any, libraries: list[Any]) -> None:
    for callee in library._linking_libraries:
        if callee not in libraries:
            _append_after_callees(callee, libraries)
    libraries.append(library)


def optimise(module: ModuleRef, machine: TargetMachine) -> None:
    """Run LLVM's third level of optimisation: it keeps every rounding."""
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization = options.slp_vectorization = True
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)


#: In order of use: each module needs only functions of the ones before it.
KERNEL_MODULES = (
    "vector",
    "tolerances",
    "closed_form.arm",
    "closed_form.resultant",
    "closed_form.roots",
    "closed_form.wrist",
    "closed_form.spherical",
    "chain",
    "limits",
    "closed_form.folds",
    "closed_form.pose",
    "closed_form.batch",
    "self_motion.follow",
    "self_motion.seven_joints",
    "self_motion.slices",
    "self_motion.gaps",
    "self_motion.graph",
    "self_motion.arcs",
    "self_motion.limit_cuts",
    "self_motion.nearest",
    "self_motion.sweep",
    "self_motion.intervals",
)
_PACKAGE = "jacokin.kernels"
#: Shapes of the arguments of `closed_form.batch.solve_targets`, apart from its work arrays; n targets, m rows to keep.
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
        "bordered_newton",
        "branches_in_interval",
        "branches_of_spherical_wrist",
        "eliminate",
        "eliminate7",
        "fourier_of_divided_F",
        "hold_on_limits",
        "least_squares",
        "linearise",
        "linearise7",
        "null_tangent",
        "polish",
        "solve_fold",
        "sort_rows",
        "spherical_starts",
        "starts_of_g",
        "tangent7",
    )
)
# What frees an array that nobody needs any more. All arrays here belong to the caller: there is nothing to free.
_NOTHING_TO_FREE = "define void @NRT_MemInfo_call_dtor(ptr %memory) { ret void }"


def compile_kernels() -> bytes:
    """The object file with the one function `library.SYMBOL`."""
    namespace = one_namespace([importlib.import_module(f"{_PACKAGE}.{name}") for name in KERNEL_MODULES])
    namespace.update(__name__=_PACKAGE, __builtins__=__builtins__)
    # Copies that see each other's compiled forms; the modules themselves stay plain.
    for name, value in list(namespace.items()):
        if isinstance(value, types.FunctionType):
            inlined = name not in _CALLED and not value.__module__.startswith(f"{_PACKAGE}.self_motion.")
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
    """A function that finds the arrays of a `KernelCall` or `CurveCall` through its table of addresses."""
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
    process = ctypes.CDLL(None)  # what a process without numba finds; llvmlite would find numba's functions as well
    machine = target_machine()
    module, name = link(entry)
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
    name = cache.key()  # of what is imported, not of what may stand in the files when this ends
    gc.disable()  # most objects of a compiler live until it ends: looking for dead ones takes a third of the time
    code = compile_kernels()
    empty = np.zeros((7, 3, 4)), np.zeros(39), np.zeros((3, 6)), np.zeros((0, 4, 4)), np.zeros((0, 6))
    library = KernelLibrary(code)
    KernelCall(library, *empty)()
    CurveCall(library)()
    sys.stdout.buffer.write(cache.pack(code, name))
    sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
