"""From the Python of kernels to modules of LLVM's language, by numba. Run as a program, it writes them.

There is one implementation, the functions of the modules in ``jacokin.kernels``; here they are translated for the work
arrays of each entry. A module exports a C function for each of its entries and refers to the C library and nothing
else. Python is translated once: addresses and integers have 64 bits in it, and `emitting` makes machine code of the
same module for every target.
"""

from __future__ import annotations

import contextlib
import gc
import sys
import types
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba
import numpy as np
from llvmlite.binding import ModuleRef
from numba import types as nb
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.dispatcher import Dispatcher
from numba.core.registry import CPUDispatcher, cpu_target
from numba.extending import intrinsic

from build_kernels.emitting import target_machine
from build_kernels.passes import Passes, remembering
from jacokin.kernels import entries
from jacokin.kernels.entries import Entry
from jacokin.kernels.library import FAILED, PREFIX


@contextlib.contextmanager
def translating_only() -> Iterator[None]:
    """Meanwhile numba translates functions to LLVM's language and tidies them, but neither optimises nor loads them.

    For a process that compiles nothing else: what it compiles later may lack parts that were compiled meanwhile.
    """
    tidy, builder = _tidying()

    class Library(JITCodeLibrary):  # type: ignore[misc]  # numba has no types
        """One function: not link with those it calls."""

        def finalize(self) -> None:
            self._raise_if_finalized()
            self._finalized = True

        def _optimize_functions(self, module: Any) -> None:
            module.data_layout = self._codegen._data_layout
            tidy.run(module, builder)

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


def _tidying() -> tuple[llvm.ModulePassManager, llvm.PassBuilder]:
    """What tidies a function: most of what numba writes takes tuples of arrays apart and together.

    Done before it becomes part of its callers, each of which would have to be tidied of it again.
    """
    passes = llvm.create_new_module_pass_manager()
    passes.add_sroa_pass()
    passes.add_instruction_combine_pass()
    passes.add_simplify_cfg_pass()
    return passes, llvm.create_pass_builder(target_machine(), llvm.create_pipeline_tuning_options())


def link(functions: Mapping[str, Dispatcher]) -> ModuleRef:
    """The module of functions of one address, by their names in C, each in its one compiled form with all it calls."""
    libraries: list[Any] = []
    written = [_NOTHING_TO_FREE]
    for name, function in functions.items():
        (compiled,) = function.overloads.values()
        _append_after_callees(compiled.library, libraries)
        written.append(_C_FUNCTION.format(inner=compiled.fndesc.llvm_func_name, name=name, failed=FAILED))
    module = llvm.parse_assembly("".join(written))
    module.triple, module.data_layout = libraries[0]._final_module.triple, libraries[0]._final_module.data_layout
    # Linking takes over what is missing so far: callers come first.
    for library in reversed(libraries):
        module.link_in(library._get_module_for_linking(), preserve=True)
    return module


def _append_after_callees(library: Any, libraries: list[Any]) -> None:
    if library in libraries:
        return
    for callee in library._linking_libraries:
        _append_after_callees(callee, libraries)
    libraries.append(library)


# The compiled form does the plain form's operations in the same order, without fastmath: both give the same bits.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
# Arrays belong to the caller of the kernels: the code that counts references to them would be half of all code.
_KERNEL_OPTIONS: dict[str, Any] = {**_OPTIONS, "_nrt": False, "nopython": True}
_PACKAGE = "jacokin.kernels."
# The closed form, contact and what they stand on become part of their callers, because passing a tuple of arrays takes
# as long as most of these functions do; other kernels take longer anyway and are left to the compiler.
_INLINED = tuple(
    _PACKAGE + name
    for name in (
        "clear_targets",
        "closed_form.",
        "contact.",
        "branches",
        "chain",
        "limits",
        "vector",
        "trigonometry",
        "tolerances",
    )
)
# Functions among them that most poses need not: these stay calls.
_CALLED = frozenset(
    (
        "add_branch",
        "add_fold",
        "bordered_newton",
        "branch_at_root",
        "branches_in_interval",
        "branches_of_spherical_wrist",
        "eliminate",
        "eliminate7",
        "farthest_vertex",
        "find_branches",
        "find_nearest",
        "find_touching",
        "first_tetrahedron",
        "fourier_of_divided_F",
        "hold_on_limits",
        "is_clear",
        "least_on_motion",
        "least_squares",
        "linearise",
        "linearise7",
        "measure_pair",
        "nearest_in_simplex",
        "null_tangent",
        "penetration",
        "polish",
        "separation",
        "settle_roots",
        "solve_fold",
        "sort_rows",
        "starts_of_g",
        "stays_clear",
        "take_clear",
        "take_nearest",
        "tangent7",
        "verify",
    )
)
# Numba's name of what makes an array of an address in the table and a shape: inlined, its callers know the shape.
_ARRAY_OF_TABLE = "impl_carray"
# What frees an array that nobody needs any more. All arrays here belong to the caller: there is nothing to free.
_NOTHING_TO_FREE = "define void @NRT_MemInfo_call_dtor(ptr %memory) { ret void }"
# From C's convention to numba's: status = function(address of the result, address of what an exception leaves, table).
_C_FUNCTION = """
declare i32 @"{inner}"(ptr, ptr, i64)
define i64 @"{name}"(ptr %table) {{
  %result = alloca i64
  %exception = alloca ptr
  %address = ptrtoint ptr %table to i64
  %status = call i32 @"{inner}"(ptr %result, ptr %exception, i64 %address)
  %value = load i64, ptr %result
  %fine = icmp eq i32 %status, 0
  %returned = select i1 %fine, i64 %value, i64 {failed}
  ret i64 %returned
}}
"""


def translate(groups: Iterable[Sequence[Entry]]) -> Iterator[ModuleRef]:
    """The modules of groups of kernels, with functions ``jacokin_<name>``: what they share is translated once.

    For a process that compiles nothing else (`translating_only`).
    """
    copies = _Copies()
    with translating_only(), remembering():
        for group in groups:
            yield exporting({PREFIX + entry.run.__name__: _c_function(entry, copies) for entry in group})


def _c_function(entry: Entry, copies: _Copies) -> Dispatcher:
    """A kernel as a function of the address of a table."""
    namespace: dict[str, Any] = {"__name__": __name__, "__builtins__": __builtins__}
    namespace.update(carray=numba.carray, pointer=_pointer_intrinsic(), float64=np.float64, int64=np.int64)
    namespace["run"] = copies.compiled(entry.run)
    exec(_entry_source(entry, namespace), namespace)
    function: Dispatcher = numba.njit(namespace["entry"], **_OPTIONS)
    function.compile((nb.intp,))
    return function


class _Kernel(CPUDispatcher):  # type: ignore[misc]  # numba has no types
    """A function that is translated once for arguments of the same types, whichever of them are constants where."""

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Numba's question for the compiled form of a call."""
        named = {name: nb.unliteral(each) for name, each in kws.items()}
        return super().get_call_template(tuple(nb.unliteral(each) for each in args), named)


class _Copies:
    """Copies of kernels and their modules that see each other's compiled forms; the modules themselves stay plain."""

    def __init__(self) -> None:
        self._made: dict[Callable[..., Any], Dispatcher] = {}
        self._namespaces: dict[str, dict[str, Any]] = {}

    def compiled(self, function: Callable[..., Any]) -> Dispatcher:
        """A function to be compiled where it is called."""
        if function not in self._made:
            assert isinstance(function, types.FunctionType)
            copy = types.FunctionType(function.__code__, self._namespace(function), function.__name__)
            inlined = function.__module__.startswith(_INLINED) and function.__name__ not in _CALLED
            options = {**_KERNEL_OPTIONS, "forceinline": inlined}
            self._made[function] = _Kernel(copy, targetoptions=options, pipeline_class=Passes)
        return self._made[function]

    def _namespace(self, function: types.FunctionType) -> dict[str, Any]:
        found = self._namespaces.get(function.__module__)
        if found is None:
            found = self._namespaces[function.__module__] = dict(function.__globals__)
            for name, value in function.__globals__.items():
                if isinstance(value, types.FunctionType) and value.__module__.startswith(_PACKAGE):
                    found[name] = self.compiled(value)
        return found


def _entry_source(entry: Entry, namespace: dict[str, Any]) -> str:
    """A function that finds the work arrays through a table: addresses, each followed by the length if that is free."""
    place = 0

    def source(value: object) -> str:
        nonlocal place
        if isinstance(value, np.ndarray):
            address, shape = f"table[{place}]", repr(value.shape)
            place += 1
            if value.shape[0] == 0:
                shape = f"(table[{place}], {', '.join(map(str, value.shape[1:]))})"
                place += 1
            return f"carray(pointer({value.dtype.name}, {address}), {shape})"
        assert isinstance(value, tuple)
        namespace[type(value).__name__] = type(value)
        return f"{type(value).__name__}({', '.join(map(source, value))})"

    work = source(entry.make_work())
    return f"def entry(address):\n    table = carray(pointer(int64, address), {place})\n    return run({work})\n"


def _pointer_intrinsic() -> Any:
    """A function of compiled code: pointer(dtype, address)."""

    def pointer(typing_context: Any, dtype: Any, address: Any) -> Any:
        signature = nb.CPointer(dtype.dtype)(dtype, nb.intp)

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[1], context.get_value_type(signature.return_type))

        return signature, generate

    return intrinsic(pointer)


def exporting(functions: Mapping[str, Dispatcher]) -> ModuleRef:
    """The module of compiled functions of one address by name, which are C functions and all that others see of it."""
    module = link(functions)
    for known in (*module.functions, *module.global_variables):
        if known.name not in functions and not known.is_declaration and not known.name.startswith("llvm."):
            known.linkage = "internal"
    for called in module.functions:
        if _ARRAY_OF_TABLE in called.name and not called.is_declaration:
            called.add_function_attribute("alwaysinline")
    return module


def main(folder: str, *groups: str) -> None:
    """Write the modules of groups of entries, as names with commas between, in order; print each once it is there."""
    # Most objects of a compiler live until it ends: looking for dead ones as often as usual takes a third of the time,
    # and not at all twice the memory.
    gc.set_threshold(200_000, 20, 100)
    known = {entry.run.__name__: entry for entry in entries.ENTRIES}
    chosen = ([known[name] for name in group.split(",")] for group in groups)
    for group, module in zip(groups, translate(chosen), strict=True):
        Path(folder, f"{group}.bc").write_bytes(module.as_bitcode())
        print(group, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
