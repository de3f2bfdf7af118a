"""Which options of `jacokin ik` go together."""

from __future__ import annotations

from pathlib import Path

from jacokin.errors import InvalidInputError


def check(
    position: tuple[float, float, float] | None,
    oriented: bool,
    every: bool,
    targets: Path | None,
    output: Path | None,
    random_seed: int | None,
    degrees: bool,
    free: bool,
    prefer: str | None,
) -> None:
    """Refuse options that do not go together.

    Raises:
        InvalidInputError: names the options.
    """
    if targets is None and position is None:
        raise InvalidInputError("give --position X Y Z or --targets FILE.csv; `jacokin ik --help` has examples")
    if targets is None and output is not None:
        raise InvalidInputError("--output goes with --targets")
    if targets is not None:
        for name, given in (
            ("--position", position is not None),
            ("an orientation", oriented),
            ("--all", every),
            ("--random-seed", random_seed is not None),
            ("--degrees", degrees),
            ("a free axis", free),
            ("--prefer", prefer is not None),
        ):
            if given:
                raise InvalidInputError(f"{name} does not go with --targets: files hold poses, and angles in radians")
    if every and prefer is not None:
        raise InvalidInputError("--prefer does not go with --all, which shows every branch")
    if every and not oriented:
        raise InvalidInputError("--all needs an orientation: a position alone is reached by infinitely many")
