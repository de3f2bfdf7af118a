"""Kinematics of the Kinova Jaco: load it, solve it within its limits, drive it in MuJoCo.

Importing this package is cheap: Pinocchio, MuJoCo, mink and the compiled kernels load when first used.
"""

import importlib

from jacokin import lazy

__version__ = "0.4.0"

# `jacokin.tasks` needs no import of its own; names of rooms are left out of `__all__`, which would load them all.
ROOMS = (
    "calibration",
    "ik",
    "jax",
    "model",
    "motion",
    "mujoco_bridge",
    "reachability",
    "tasks",
    "teleop",
    "torch",
    "viewer",
)

_public, _load, _ = lazy.door(__name__)
__all__ = sorted([*_public, "__version__"])


def __getattr__(name: str) -> object:
    return importlib.import_module(f"jacokin.{name}") if name in ROOMS else _load(name)


def __dir__() -> list[str]:
    return list(__all__)
