"""All that a compiled function calls in one LLVM module, which is optimised once.

Left to itself, numba optimises every function together with all that it calls, and makes machine code of each: for
functions that call each other ten levels deep that takes three times as long as the whole does once.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from llvmlite.binding import ModuleRef, TargetMachine
    from numba.core.dispatcher import Dispatcher


@contextlib.contextmanager
def translating_only() -> Iterator[None]:
    """Meanwhile numba translates functions to LLVM's language, but neither optimises nor loads them.

    For a process that compiles nothing else: what it compiles later may lack parts that were compiled meanwhile.
    """
    from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
    from numba.core.registry import cpu_target

    class Library(JITCodeLibrary):  # type: ignore[misc]  # numba has no types
        """One function: not linked with those it calls."""

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


def linked(entry: Dispatcher) -> tuple[ModuleRef, str]:
    """The module of a function's one compiled form with all that it calls, and the function's name there."""
    import llvmlite.binding as llvm

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
    import llvmlite.binding as llvm

    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization = options.slp_vectorization = True
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
