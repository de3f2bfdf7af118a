"""From a module of LLVM's language to machine code. Run as a program, it writes object files of one module.

A module is optimised once for a kind of processor, whichever systems run on it. This needs llvmlite and not numba: the
modules come from `compiling`.
"""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path

import llvmlite.binding as llvm
from llvmlite.binding import ModuleRef, TargetMachine

from build_kernels.targets import AVX2, EMITTED, HERE, Target
from jacokin.kernels.library import PREFIX


def emit(module: ModuleRef, target: Target = HERE) -> bytes:
    """Machine code of a module: it stays as it is for another machine, and is optimised in place for this one.

    The function of a kernel that is there twice is called ``jacokin_<name>_avx2`` in the code for wider vectors.

    Raises:
        RuntimeError: it calls what is not there without numba.
    """
    return machine_code(optimised(module, target), target)


def optimised(module: ModuleRef, target: Target = HERE) -> ModuleRef:
    """A module optimised for the processor of a target, as for the first of the targets that have it.

    Raises:
        RuntimeError: it calls what is not there without numba.
    """
    process = ctypes.CDLL(None)  # what a process without numba finds; llvmlite would find numba's functions as well
    first = next(each for each in EMITTED.values() if each.processor == target.processor)
    machine = target_machine(first)
    if first.triple:
        module = _for_system(module, first, machine)
    if first.features:
        for function in module.functions:
            if function.name.startswith(PREFIX) and not function.is_declaration:
                function.name = f"{function.name}_{AVX2}"
    optimise(module, machine)
    for called in module.functions:
        if called.is_declaration and not called.name.startswith("llvm.") and not hasattr(process, called.name):
            raise RuntimeError(f"the compiled kernels call {called.name}, which exists within numba only")
    return module


def machine_code(module: ModuleRef, target: Target = HERE) -> bytes:
    """Machine code of a module that was optimised for the processor of a target."""
    machine = target_machine(target)
    return bytes(machine.emit_object(_for_system(module, target, machine) if target.triple else module))


def _for_system(module: ModuleRef, target: Target, machine: TargetMachine) -> ModuleRef:
    """A copy of a module for another system."""
    copy = llvm.parse_bitcode(module.as_bitcode())
    copy.triple, copy.data_layout = target.triple, str(machine.target_data)
    return copy


def target_machine(target: Target = HERE) -> TargetMachine:
    """The oldest processor of this kind, on all of which the code runs, with what a target has beyond it.

    The bits are the same on all of them.
    """
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    kind = llvm.Target.from_triple(target.triple) if target.triple else llvm.Target.from_default_triple()
    reloc, model = ("static", "default") if target.is_wasm else ("pic", "small")
    return kind.create_target_machine(
        cpu="generic", features=target.features, opt=3, reloc=reloc, codemodel=model, jit=False
    )


def optimise(module: ModuleRef, machine: TargetMachine) -> None:
    """Run LLVM's third level of optimisation: it keeps every rounding.

    Before that, the shapes of the work arrays become constants in all functions that they are handed to: loops along
    them are not made vector instructions otherwise.
    """
    first = llvm.create_new_module_pass_manager()
    first.add_always_inliner_pass()
    first.add_sroa_pass()
    first.add_instruction_combine_pass()
    first.add_ipsccp_pass()
    first.add_dead_arg_elimination_pass()
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization = options.slp_vectorization = True
    builder = llvm.create_pass_builder(machine, options)
    first.run(module, builder)
    builder.getModulePassManager().run(module, builder)


def main(file: str, *words: str) -> None:
    """Write object files of the module in a file: names of targets with one processor, each followed by its file."""
    names, places = words[::2], words[1::2]
    module = optimised(llvm.parse_bitcode(Path(file).read_bytes()), EMITTED[names[0]])
    for name, place in zip(names, places, strict=True):
        Path(place).write_bytes(machine_code(module, EMITTED[name]))


if __name__ == "__main__":
    main(*sys.argv[1:])
