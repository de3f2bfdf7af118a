"""Kinematics of the Kinova Jaco: load it, solve it within its limits, drive it in MuJoCo.

Importing this package is cheap: Pinocchio, MuJoCo, mink and the compiled kernels load when first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jacokin.errors import JacokinError as JacokinError
    from jacokin.ik.results import IKResult as IKResult
    from jacokin.ik.results import Status as Status
    from jacokin.ik.solver import IKSolver as IKSolver
    from jacokin.ik.solver import solve_ik as solve_ik
    from jacokin.ik.tracker import Tracker as Tracker
    from jacokin.model.crosscheck import crosscheck as crosscheck
    from jacokin.model.loading import load_robot as load_robot
    from jacokin.model.poses import pose as pose
    from jacokin.model.robot import Robot as Robot

__version__ = "0.1.0"

_HOME_OF = {
    "IKResult": "jacokin.ik.results",
    "IKSolver": "jacokin.ik.solver",
    "JacokinError": "jacokin.errors",
    "Robot": "jacokin.model.robot",
    "Status": "jacokin.ik.results",
    "Tracker": "jacokin.ik.tracker",
    "crosscheck": "jacokin.model.crosscheck",
    "load_robot": "jacokin.model.loading",
    "pose": "jacokin.model.poses",
    "solve_ik": "jacokin.ik.solver",
}

__all__ = [
    "IKResult",
    "IKSolver",
    "JacokinError",
    "Robot",
    "Status",
    "Tracker",
    "__version__",
    "crosscheck",
    "load_robot",
    "pose",
    "solve_ik",
]


def __getattr__(name: str) -> object:
    """Load the module a public name lives in when the name is first used."""
    home = _HOME_OF.get(name)
    if home is None:
        raise AttributeError(f"module 'jacokin' has no attribute {name!r}; public names: {', '.join(__all__)}")
    value = getattr(importlib.import_module(home), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
