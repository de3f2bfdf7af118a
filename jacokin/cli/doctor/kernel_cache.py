"""Is the closed form compiled, and can it be kept on disk?"""

from __future__ import annotations

import os

from jacokin.cli.doctor.finding import MISSING, OK, WARNING, Finding


def kernel_cache() -> Finding:
    """Does the compiled closed form wait on disk, and does it load?"""
    state, detail = _state()
    return Finding("closed form", "cache", state, detail)


def _state() -> tuple[str, str]:
    from jacokin.ik.closed_form import cache, compilation
    from jacokin.ik.closed_form.kernel_library import KernelLibrary

    if compilation.is_disabled():
        return WARNING, compilation.DISABLED
    file = cache.path()
    if file is None:
        return WARNING, "no home folder to cache in: set NUMBA_CACHE_DIR to a folder of your own"
    found = cache.read()
    if found.code is not None:
        try:
            KernelLibrary(found.code)
        except RuntimeError as error:
            return WARNING, f"{file} does not load: {error}; `jacokin warmup` compiles it anew"
        return OK, f"compiled, in {file}"
    if found.problem:
        return WARNING, found.problem
    existing = next(parent for parent in file.parents if parent.exists())
    if not os.access(existing, os.W_OK):
        return WARNING, (
            f"{file.parent} cannot be written, so each process compiles anew: "
            "set NUMBA_CACHE_DIR to a folder of your own"
        )
    return MISSING, f"not compiled yet: `jacokin warmup` compiles it into {file.parent}"
