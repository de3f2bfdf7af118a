"""What a robot remembers of where it comes from: its description, and its home."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from jacokin.arrays import Array

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True, slots=True)
class Source:
    """Where a robot came from, and what was read there: the file is not read again.

    Attributes:
        path: the description file.
        kind: "urdf" or "mjcf".
        bundled: name of the bundled robot, or None for a user's own file.
        base: base frame that was asked for, or None.
        tip: tip frame that was asked for, or None.
        package_dirs: folders that hold the packages of package:// meshes.
        limits: a user's own limits: joint, lower and upper [rad].
        content: the checked text of a URDF, or an MJCF as MuJoCo compiled it; None for bundled robots.
    """

    path: Path
    kind: str
    bundled: str | None
    base: str | None
    tip: str | None
    package_dirs: tuple[Path, ...] = ()
    limits: tuple[tuple[str, float, float], ...] = ()
    content: str | mujoco.MjModel | None = field(default=None, repr=False, compare=False)


@dataclass(frozen=True, slots=True, eq=False)
class Home:
    """A configuration to start from, and where it comes from."""

    q: Array
    """(dof,) [rad]."""
    source: str
    """In words: a documented configuration, a keyframe of the file, the middle of the limits, or a search."""
