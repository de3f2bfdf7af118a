"""Which of MuJoCo's rendering back ends work on this machine."""

from __future__ import annotations

import functools

from jacokin.cli import doctor


@functools.cache
def backends() -> tuple[str, ...]:
    """Values of MUJOCO_GL that draw a picture here."""
    return tuple(finding.name for finding in doctor.check_renderers() if finding.state == doctor.OK)
