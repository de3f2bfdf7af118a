"""A robot's own description in MuJoCo, everything movable still movable."""

from __future__ import annotations

from pathlib import Path

import mujoco

from jacokin.errors import ModelError
from jacokin.model.descriptions import bundled, mjcf
from jacokin.model.robot import Robot


def compiled(robot: Robot) -> mujoco.MjModel:
    """MuJoCo's own compilation of the robot's description, everything movable still movable.

    A bundled robot's MJCF, a user's MJCF, or a user's URDF read by MuJoCo with all its links kept.

    Raises:
        ModelError: MuJoCo cannot load the file.
    """
    source = robot.source
    if source.bundled is not None:
        return mjcf.compile_mjcf(bundled.urdf_folder() / f"{source.bundled}.xml")
    if source.kind == "mjcf":
        return mjcf.compile_mjcf(source.path)
    return _compile_urdf(source.path)


def _compile_urdf(path: Path) -> mujoco.MjModel:
    """A URDF in MuJoCo with all its links; masses as in the file unless MuJoCo refuses moving links without mass."""
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.compiler.fusestatic = False
        spec.compiler.discardvisual = False
        try:
            return spec.compile()
        except ValueError:
            spec.compiler.balanceinertia = True
            spec.compiler.boundmass, spec.compiler.boundinertia = 1e-9, 1e-15
            return spec.compile()
    except (ValueError, RuntimeError) as error:
        raise ModelError(f"{path}: MuJoCo cannot load the shapes of this URDF: {error}") from error
