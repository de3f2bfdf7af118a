"""The closed form's kernels: compiled by numba and cached on disk, or run as plain Python until that pays.

There is one implementation, the functions of the modules in ``kernels``. ``solver`` hands out their entry point
``kernels.batch.solve`` as it is, or compiled: from the cache when an earlier process left it there, otherwise as soon
as many poses are asked for. Nothing here happens on import, and nothing that takes seconds happens silently.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.metadata
import logging
import os
import platform
import threading
import time
import types
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Solve = Callable[
    [
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
    ],
    int,
]

#: In order of use: each module needs only functions of the ones before it.
KERNEL_MODULES = (
    "vector",
    "tolerances",
    "arm",
    "resultant",
    "roots",
    "wrist",
    "spherical",
    "chain",
    "limits",
    "pose",
    "batch",
)
ENTRY_POINT = "solve"
#: Poses solved in plain Python, at some 10 ms each, before loading compiled kernels (half a second, with numba) pays.
LOAD_AFTER = 30
#: The same where there is nothing to load yet: before compiling pays.
COMPILE_AFTER = 500
_MARKER = "complete.txt"
_KERNELS = "jacokin.ik.closed_form.kernels"

logger = logging.getLogger(__name__)

_lock = threading.Lock()
_compiled: Solve | None = None
_plain_poses = 0
_cached: bool | None = None
_warned: set[str] = set()


def solver(poses: int = 1) -> Solve:
    """The entry point ``kernels.batch.solve`` for so many more poses: compiled if that is quick or pays."""
    if _compiled is not None:
        return _compiled
    return _choose(poses)


def warmup() -> float:
    """Compile the closed form, or load it from the cache, so that nothing waits for it later.

    Returns:
        Seconds it took.
    """
    start = time.perf_counter()
    with _lock:
        _load()
    return time.perf_counter() - start


def cache_folder() -> Path | None:
    """Where the compiled kernels of this version, machine and Python belong; None without a home folder.

    ``NUMBA_CACHE_DIR`` and ``XDG_CACHE_HOME`` are respected.
    """
    base = os.environ.get("NUMBA_CACHE_DIR")
    try:
        root = Path(base) if base else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:
        return None
    return root / "jacokin" / _key()


def is_cached() -> bool:
    """Whether compiled kernels wait in the cache folder."""
    folder = cache_folder()
    return folder is not None and _complete(folder)


def _choose(poses: int) -> Solve:
    global _plain_poses, _cached
    from jacokin.ik.closed_form.kernels.batch import solve

    with _lock:
        if _compiled is not None:
            return _compiled
        if _cached is None:
            _cached = is_cached()
        _plain_poses += poses
        if _plain_poses > (LOAD_AFTER if _cached else COMPILE_AFTER):
            return _load()
        if not _cached:
            _warn_once(
                "the closed form is not compiled yet: using its plain Python form, about 10 ms a pose. "
                "`jacokin warmup` compiles it once and for all."
            )
        return solve


def _load() -> Solve:
    """Compile or read from the cache; the lock is held."""
    global _compiled
    if _compiled is None:
        folder = cache_folder()
        if folder is not None and _complete(folder):
            _compiled = _compile(folder)
            return _compiled
        if folder is None or not _writable(folder):
            _warn_once(f"cannot write the cache folder {folder}: the compiled closed form is kept in memory only.")
            folder = None
        logger.warning("compiling the closed form (10 to 30 s, once).")
        start = time.perf_counter()
        try:
            _compiled = _compile(folder)
        except OSError as error:
            _warn_once(f"cannot keep the compiled closed form in {folder}: {error}")
            _compiled, folder = _compile(None), None
        logger.info(f"compiled in {time.perf_counter() - start:.0f} s" + (f", kept in {folder}" if folder else ""))
        if folder is not None:
            files = sorted(path for path in folder.rglob("*.nb[ci]"))
            lines = [f"{path.stat().st_size} {path.relative_to(folder)}\n" for path in files]
            (folder / _MARKER).write_text("".join(lines))
    return _compiled


def _compile(folder: Path | None) -> Solve:
    """The entry point compiled for its one signature, through the cache if there is one."""
    import numba
    from numba import float64
    from numba import types as nb

    if numba.config.DISABLE_JIT:
        from jacokin.ik.closed_form.kernels.batch import solve

        return solve
    namespace = _one_namespace([importlib.import_module(f"{_KERNELS}.{name}") for name in KERNEL_MODULES])
    functions = [value for value in namespace.values() if isinstance(value, types.FunctionType)]
    namespace.update(__name__=f"{_KERNELS}.{KERNEL_MODULES[-1]}", __builtins__=__builtins__)
    # Copies that see each other's compiled forms; the modules themselves stay plain. Without fastmath the compiled
    # form does the plain form's operations in the same order: both give the same bits.
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
    inner = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    copies = {f.__name__: types.FunctionType(f.__code__, namespace, f.__name__) for f in functions}
    for name, copy in copies.items():
        if name != ENTRY_POINT:
            namespace[name] = numba.njit(copy, **options, **inner)

    def fixed(ndim: int) -> Any:
        return nb.Array(float64, ndim, "C", readonly=True)

    written = nb.Array(float64, 2, "C")
    signature = nb.intp(fixed(3), fixed(1), fixed(2), fixed(3), fixed(2), written, written)
    before = numba.config.CACHE_DIR
    try:
        # numba takes the folder from its configuration when a function is decorated, and only then.
        numba.config.CACHE_DIR = str(folder) if folder is not None else ""
        entry = numba.njit(copies[ENTRY_POINT], cache=folder is not None, **options)
    finally:
        numba.config.CACHE_DIR = before
    entry.compile(signature)
    entry.disable_compile()
    compiled: Solve = entry
    return compiled


def _one_namespace(modules: Sequence[types.ModuleType]) -> dict[str, Any]:
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


def _key() -> str:
    """A name that changes with everything the machine code depends on."""
    llvm = importlib.import_module("llvmlite.binding")  # numba's own, without the second it takes to import numba
    digest = hashlib.sha256()
    here = Path(__file__).parent
    for name in (*(f"kernels/{module}.py" for module in KERNEL_MODULES), Path(__file__).name):
        digest.update((here / name).read_bytes())
    stamp = (here / "kernels" / "batch.py").stat()  # numba's own index goes by it
    parts = (
        stamp.st_mtime_ns,
        here,
        importlib.metadata.version("numba"),
        importlib.metadata.version("numpy"),
        platform.python_version(),
        llvm.get_host_cpu_name(),
        sorted(llvm.get_host_cpu_features().items()),
    )
    digest.update(repr(parts).encode())
    return digest.hexdigest()[:16]


def _complete(folder: Path) -> bool:
    """Whether every file that the marker lists is there in full size."""
    try:
        lines = (folder / _MARKER).read_text().splitlines()
        return bool(lines) and all(
            (folder / name).stat().st_size == int(size) for size, name in (line.split(" ", 1) for line in lines)
        )
    except (OSError, ValueError):
        return False


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f"probe-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError:
        return False
    return True


def _warn_once(text: str) -> None:
    """Log a warning once in a process."""
    if text not in _warned:
        _warned.add(text)
        logger.warning(text)
