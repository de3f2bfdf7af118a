"""MuJoCo's flags that switch parts of the simulation off, by name."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco

from jacokin.model import checks

_PREFIX = "mjDSBL_"


def flag_bits() -> dict[str, int]:
    """The bit of each flag, by its name in lower case: "contact", "gravity", "actuation", "limit", ..."""
    members = mujoco.mjtDisableBit.__members__
    return {name.removeprefix(_PREFIX).lower(): int(bit) for name, bit in members.items() if name.startswith(_PREFIX)}


def mask(flags: Sequence[str]) -> int:
    """The bits of several flags together.

    Raises:
        UnknownNameError: there is no such flag; lists the valid ones.
    """
    bits = flag_bits()
    combined = 0
    for flag in flags:
        combined |= bits[checks.choice("flag", flag, bits)]
    return combined
