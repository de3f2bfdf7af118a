"""`jacokin warmup`: compile the closed form once, ahead of the first solve."""

from __future__ import annotations

import typer


def warmup() -> None:
    """Compile the closed form ahead of the first solve.

    The kernels go into a cache on disk, so that no later command waits for the compiler.

    Examples:
      jacokin warmup
    """
    from jacokin.ik import closed_form

    seconds = closed_form.warmup()
    typer.echo(f"the closed form is ready ({seconds:.1f} s)")
