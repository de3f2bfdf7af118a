"""Kinematics of the Kinova Jaco: load it, solve it within its limits, drive it in MuJoCo.

Importing this package is cheap: Pinocchio, MuJoCo, mink and the compiled kernels load when first used.
"""

from __future__ import annotations

from jacokin import lazy

TYPE_CHECKING = False  # as in typing, whose import takes longer than the rest of this one

if TYPE_CHECKING:
    from jacokin.errors import JacokinError as JacokinError
    from jacokin.ik.closed_form import warmup as warmup
    from jacokin.ik.one_pose import solve_ik as solve_ik
    from jacokin.ik.paths.plan import plan_path as plan_path
    from jacokin.ik.results import IKResult as IKResult
    from jacokin.ik.results import Status as Status
    from jacokin.ik.solver import IKSolver as IKSolver
    from jacokin.ik.tracking.tracker import Tracker as Tracker
    from jacokin.model.comparison import crosscheck as crosscheck
    from jacokin.model.loading import load_robot as load_robot
    from jacokin.model.pose_targets import FreeAxis as FreeAxis
    from jacokin.model.pose_targets import pose as pose
    from jacokin.model.robot import Robot as Robot

__version__ = "0.2.0"

# `jacokin.tasks` needs no import of its own; names of rooms are left out of `__all__`, which would load them all.
ROOMS = ("ik", "model", "mujoco_bridge", "reachability", "tasks", "viewer")

_public, __getattr__, _ = lazy.door(
    __name__,
    {
        "jacokin.errors": ("JacokinError",),
        "jacokin.ik.closed_form": ("warmup",),
        "jacokin.ik.paths.plan": ("plan_path",),
        "jacokin.ik.results": (
            "IKResult",
            "Status",
        ),
        "jacokin.ik.solver": ("IKSolver",),
        "jacokin.ik.one_pose": ("solve_ik",),
        "jacokin.ik.tracking.tracker": ("Tracker",),
        "jacokin.model.comparison": ("crosscheck",),
        "jacokin.model.loading": ("load_robot",),
        "jacokin.model.pose_targets": ("FreeAxis", "pose"),
        "jacokin.model.robot": ("Robot",),
    },
    ROOMS,
)
__all__ = sorted({*_public, "__version__"} - {*ROOMS})


def __dir__() -> list[str]:
    return list(__all__)
