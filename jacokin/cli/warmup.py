"""`jacokin warmup`: compile the closed form once, ahead of the first solve."""

from __future__ import annotations

import click

NOT_COMPILED = 1  # exit code


def warmup() -> None:
    """Compile the closed form ahead of the first solve.

    The machine code goes into a cache on disk, so that no later command waits for the compiler.

    Exit code: 0 when the compiled closed form is ready, 1 when NUMBA_DISABLE_JIT keeps it in plain Python.

    Examples:
      jacokin warmup
    """
    from jacokin.ik.closed_form import compilation

    seconds = compilation.warmup()
    if compilation.is_disabled():
        raise SystemExit(NOT_COMPILED)
    click.echo(f"the closed form is ready ({seconds:.1f} s)")
