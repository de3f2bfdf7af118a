"""`link`: object files and C files to a library that says what it is, by $CC, the system's C compiler, or zig's.

The package ``ziglang`` has a C compiler that links for all machines, and their C libraries.
"""

from __future__ import annotations

import importlib.util
import json
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from pathlib import Path

import jacokin
from build_kernels import c_library
from build_kernels.targets import HERE, Target
from jacokin.kernels import library
from jacokin.kernels.entries import ENTRIES, Entry
from jacokin.kernels.library import PREFIX, About, ArrayLayout, flatten

#: Old systems that zig links for: those of manylinux_2_17.
ZIG = [sys.executable, "-m", "ziglang", "cc", "-target", HERE.zig]
ZIG_REQUIREMENT = "ziglang==0.17.1"
NO_ZIG = f"linking for another machine takes {ZIG_REQUIREMENT}: `pip install -e '.[kernels,targets]'`"
NO_LINKER = (
    "the kernels need a C compiler to be linked: install one (`cc`), or the package "
    f"`{ZIG_REQUIREMENT}`, or name one in $CC"
)
#: [bytes] of WebAssembly, at the beginning of its memory, where it cannot grow into data.
STACK = 262144
OLDEST_GLIBC = 17  # as in manylinux_2_17
OLDEST_MACOS = "11_0"  # of the targets
_SYMBOL_VERSION = re.compile(rb"GLIBC_2\.(\d+)")


class BuildError(Exception):
    """The library cannot be built; says what is missing."""


def link(objects: list[Path], place: Path, target: Target = HERE, entries: Sequence[Entry] = ENTRIES) -> None:
    """Link object files, and C files as they are, to a library that says what it is.

    Raises:
        BuildError: there is no C compiler, or none that links.
    """
    layouts = {entry.run.__name__: _layout(entry) for entry in entries}
    about = About(jacokin.__version__, library.sources_key(), 0, layouts)
    failures = []
    for command in linkers(target):
        with tempfile.TemporaryDirectory(dir=place.parent) as folder:
            made = Path(folder) / place.name
            try:
                size = _link(command, objects, about, made, target)
                # Now it knows its size: a part of it is noticed.
                if _link(command, objects, about._replace(size=size), made, target) != size:
                    raise BuildError(f"{shlex.join(command)} links differently each time")
            except (OSError, subprocess.CalledProcessError) as error:
                failures.append(getattr(error, "stderr", None) or str(error))
                continue
            for file in (*made.parent.glob("*.lib"), made):  # on Windows, what other linkers read
                file.replace(place.with_name(file.name))
            return
    what = NO_LINKER if target is HERE else f"{target.name} cannot be linked for"
    raise BuildError(what + "".join(f"\n{failure.strip()}" for failure in failures))


def linkers(target: Target = HERE) -> list[list[str]]:
    """The C compilers to try, in order; here, $CC alone where it is set.

    Raises:
        BuildError: $CC is not a command.
    """
    if target is not HERE:
        return [[sys.executable, "-m", "ziglang", "cc", "-target", target.zig]]
    if chosen := os.environ.get("CC"):
        try:
            return [shlex.split(chosen)]
        except ValueError as error:
            raise BuildError(f'$CC is "{chosen}", which is no command: {error}') from None
    system = shutil.which("cc")
    found = [[system]] if system else []
    return [*found, ZIG] if importlib.util.find_spec("ziglang") else found


def _link(command: list[str], objects: list[Path], about: About, made: Path, target: Target) -> int:
    source = made.with_name("about.c")
    shown = f'extern const char {PREFIX}about[] __attribute__((visibility("default")));'
    source.write_text(f"{shown}\nconst char {PREFIX}about[] = {json.dumps(about.text())};\n", encoding="ascii")
    c_library.write_header(made.parent)
    words = [*command, *c_library.flags(made.parent), *_linker_words(made, target), "-o", str(made), str(source)]
    words += [*map(str, objects), "-lm"]
    subprocess.run(words, check=True, capture_output=True, text=True)
    return made.stat().st_size


def _linker_words(made: Path, target: Target) -> list[str]:
    match target.system:
        case "darwin":
            return ["-shared", "-fPIC", f"-Wl,-install_name,@rpath/{made.name}"]
        case "win32":
            return ["-shared", "-s", f"-Wl,--out-implib,{made.with_suffix('.lib')}"]
        case "wasi":  # the kernels' arrays are their callers': they take 2 kB of stack
            exports = ["-Wl,--export-dynamic", "-Wl,--export=malloc", "-Wl,--export=free"]
            return ["-mexec-model=reactor", "-s", f"-Wl,-z,stack-size={STACK}", *exports]
        case "linux":  # see jacokin/kernels/c/glibc.c
            wrapped = [f"-Wl,--wrap={function}" for function in c_library.WRAPPED]
            return ["-shared", "-fPIC", "-s", f"-Wl,-soname,{made.name}", *wrapped]
        case _:
            return ["-shared", "-fPIC", "-s", f"-Wl,-soname,{made.name}"]


def _layout(entry: Entry) -> tuple[ArrayLayout, ...]:
    return tuple(ArrayLayout(array.dtype, array.shape) for array in flatten(entry.make_work()))


def wheel_tag(contents: bytes, target: Target = HERE) -> str:
    """The tag of a wheel with such a library: it has no Python in it, and what it needs of the C library shows."""
    machine = target.name.partition("-")[0] or platform.machine()
    if target.system == "linux":
        newest = max(map(int, _SYMBOL_VERSION.findall(contents)), default=0)
        base = f"manylinux_2_{OLDEST_GLIBC}" if newest <= OLDEST_GLIBC else "linux"
        return f"py3-none-{base}_{machine}"
    if target.name:
        return f"py3-none-macosx_{OLDEST_MACOS}_{machine.replace('aarch64', 'arm64')}"
    return "py3-none-" + re.sub(r"[-.]", "_", sysconfig.get_platform())
