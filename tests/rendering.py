"""Which of MuJoCo's rendering back ends work on this machine."""

from __future__ import annotations

import functools

from jacokin.cli import doctor
from jacokin.cli.doctor_packages import OK


@functools.cache
def backends() -> tuple[str, ...]:
    """Values of MUJOCO_GL that draw a picture here."""
    return tuple(finding.name for finding in doctor.renderers() if finding.state == OK)
