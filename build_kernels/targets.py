"""`Target`: a machine that the library is made for, this one or another, and what compilers are told about it.

Another machine gets the C library: the kernels that C programs call, and the C files. LLVM emits objects for all of
these machines, and the package ``ziglang`` has their C libraries and links.

Processors of a kind run the same code, that of the oldest; but a few kernels are there a second time for those with
wider vectors (`Target.wide`). Without fused multiply-add they give the same bits.
"""

from __future__ import annotations

import platform
import sys
from dataclasses import dataclass, replace

from jacokin.kernels import library

#: Kernels that are there twice where `Target.wide` is: wider vectors take a tenth to a quarter off their time.
WIDE_KERNELS = ("solve_targets", "run_free_motion")
#: The wider vectors: name in functions and in those of targets, and LLVM's feature.
AVX2, AVX2_FEATURE = "avx2", "+avx2"


@dataclass(frozen=True, slots=True)
class Target:
    """One machine.

    Attributes:
        name: as `python -m build_kernels --target` takes it.
        system: as `sys.platform` is called there.
        library: file name of the library.
        triple: LLVM's name of the machine; empty for this one.
        zig: zig's name of it.
        features: LLVM's names of what the oldest processor of this kind has not; empty for that one.
    """

    name: str
    system: str
    library: str
    triple: str = ""
    zig: str = ""
    features: str = ""

    @property
    def wide(self) -> Target | None:
        """This machine with the wider vectors that most processors of its kind have; None where there are none."""
        kind = self.triple or platform.machine().lower()
        if not kind.startswith(("x86_64", "amd64")) or self.features:
            return None
        return replace(self, name=f"{self.name}-{AVX2}".lstrip("-"), features=AVX2_FEATURE)

    @property
    def processor(self) -> tuple[str, str]:
        """Kind of processor and vectors: LLVM optimises the same code for all systems on it."""
        return self.name.partition("-")[0], self.features

    @property
    def is_wasm(self) -> bool:
        """Whether it is WebAssembly, whose module is linked as one piece and brings its own C library."""
        return self.system == "wasi"


#: This machine: the library of the package, with all kernels.
HERE = Target("", sys.platform, library.PATH.name, zig=f"{platform.machine()}-linux-gnu.2.17")
#: Others, by name. Linux as old as that of manylinux_2_17.
TARGETS = {
    target.name: target
    for target in (
        Target("aarch64-linux", "linux", "libjacokin.so", "aarch64-unknown-linux-gnu", "aarch64-linux-gnu.2.17"),
        Target("x86_64-linux", "linux", "libjacokin.so", "x86_64-unknown-linux-gnu", "x86_64-linux-gnu.2.17"),
        Target("x86_64-windows", "win32", "jacokin.dll", "x86_64-pc-windows-gnu", "x86_64-windows-gnu"),
        Target("aarch64-macos", "darwin", "libjacokin.dylib", "arm64-apple-macosx11.0.0", "aarch64-macos.11.0"),
        Target("x86_64-macos", "darwin", "libjacokin.dylib", "x86_64-apple-macosx11.0.0", "x86_64-macos.11.0"),
        Target("wasm32", "wasi", "jacokin.wasm", "wasm32-unknown-wasi", "wasm32-wasi"),
    )
}
#: All that machine code is made for, by name: the machines, and those of them with wider vectors.
EMITTED = {
    target.name: target for each in (HERE, *TARGETS.values()) for target in (each, each.wide) if target is not None
}
#: Those that there are wheels for: Pinocchio has none for others.
WHEELS = tuple(name for name, target in TARGETS.items() if target.system in ("linux", "darwin"))
