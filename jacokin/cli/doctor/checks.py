"""Every check of `jacokin doctor`, in the order shown."""

from __future__ import annotations

import platform
import sys

from jacokin.cli.doctor import kernel_cache, packages, rendering
from jacokin.cli.doctor.finding import FAILED, OK, Finding

OLDEST_PYTHON = (3, 11)


def all_findings() -> list[Finding]:
    """Every check, in the order shown."""
    return [
        python_version(),
        *packages.packages(),
        packages.shadows(),
        *packages.qp_solvers(),
        *rendering.renderers(),
        kernel_cache.kernel_cache(),
        robots(),
    ]


def python_version() -> Finding:
    """Is this Python new enough?"""
    state = OK if sys.version_info >= OLDEST_PYTHON else FAILED
    return Finding("python", "python", state, f"{platform.python_version()}, {sys.executable}")


def robots() -> Finding:
    """Are the bundled robots there?"""
    from jacokin.errors import JacokinError
    from jacokin.model.descriptions import bundled

    try:
        from jacokin.model.loading import load_robot

        for name in bundled.NAMES:
            load_robot(name)
    except (JacokinError, ImportError, OSError) as error:
        return Finding("robots", "bundled", FAILED, f"{error}")
    return Finding("robots", "bundled", OK, f"{', '.join(bundled.NAMES)} in {bundled.urdf_folder()}")
