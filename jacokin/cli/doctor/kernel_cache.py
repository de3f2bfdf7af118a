"""Is the closed form compiled, and can it be kept on disk?"""

from __future__ import annotations

import os

from jacokin.cli.doctor.finding import MISSING, OK, WARNING, Finding


def kernel_cache() -> Finding:
    """Does the compiled closed form wait on disk?"""
    from jacokin.ik.closed_form import compilation

    folder = compilation.cache_folder()
    if folder is None:
        return Finding("closed form", "cache", WARNING, "no home folder to cache in: set NUMBA_CACHE_DIR to a folder")
    if compilation.is_cached():
        return Finding("closed form", "cache", OK, f"compiled, in {folder}")
    existing = next(parent for parent in (folder, *folder.parents) if parent.exists())
    if not os.access(existing, os.W_OK):
        detail = f"{existing} cannot be written, so each process compiles anew: set NUMBA_CACHE_DIR to another folder"
        return Finding("closed form", "cache", WARNING, detail)
    return Finding("closed form", "cache", MISSING, f"not compiled yet: `jacokin warmup` compiles it into {folder}")
