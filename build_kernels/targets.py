"""`Target`: a machine that the library is made for, this one or another, and what compilers are told about it.

Another machine gets the C library: the kernels that C programs call, and the C files. LLVM emits objects for all of
these machines, and the package ``ziglang`` has their C libraries and links.
"""

from __future__ import annotations

import platform
import sys
from dataclasses import dataclass

from jacokin.kernels import library


@dataclass(frozen=True, slots=True)
class Target:
    """One machine.

    Attributes:
        name: as `python -m build_kernels --target` takes it.
        system: as `sys.platform` is called there.
        library: file name of the library.
        triple: LLVM's name of the machine; empty for this one.
        zig: zig's name of it.
    """

    name: str
    system: str
    library: str
    triple: str = ""
    zig: str = ""

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
#: Those that there are wheels for: Pinocchio has none for others.
WHEELS = tuple(name for name, target in TARGETS.items() if target.system in ("linux", "darwin"))
