"""Cameras that look at the workspace, and their pictures as observables.

Rendering needs an OpenGL context: a display, or ``MUJOCO_GL=egl`` or ``osmesa`` in the environment
before Python starts.
"""

from __future__ import annotations

import os
import sys
import warnings
import weakref
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import mujoco
import numpy as np
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError, PhysicsError, UnknownNameError
from jacokin.mujoco_bridge.observable import Observable
from jacokin.mujoco_bridge.observable_options import CAMERA_CHECKS, Options
from jacokin.mujoco_bridge.observations import ObservationSettings

if TYPE_CHECKING:
    from jacokin.mujoco_bridge.entity import Entity
    from jacokin.mujoco_bridge.physics import Physics

_NO_CONTEXT = (
    "no picture can be rendered: {reason}. Without a display, set MUJOCO_GL=egl (Debian: libegl1 and "
    "libegl-mesa0) or MUJOCO_GL=osmesa (Debian: libosmesa6) before Python starts"
)
_RENDERERS: weakref.WeakKeyDictionary[Physics, dict[tuple[int, int], mujoco.Renderer]]
_RENDERERS = weakref.WeakKeyDictionary()


class CameraSpec(NamedTuple):
    """A camera that is fixed in an entity's frame."""

    name: str
    pos: tuple[float, float, float]  # [m]
    xyaxes: tuple[float, float, float, float, float, float]  # picture's right and up, not normalised


FRONT_CLOSE = CameraSpec("front_close", pos=(0.0, -0.6, 0.75), xyaxes=(1.0, 0.0, 0.0, 0.0, 0.7, 0.75))
FRONT_FAR = CameraSpec("front_far", pos=(0.0, -0.8, 1.0), xyaxes=(1.0, 0.0, 0.0, 0.0, 0.7, 0.75))
TOP_DOWN = CameraSpec("top_down", pos=(0.0, 0.0, 2.5), xyaxes=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0))
LEFT_CLOSE = CameraSpec("left_close", pos=(-0.6, 0.0, 0.75), xyaxes=(0.0, -1.0, 0.0, 0.7, 0.0, 0.75))
RIGHT_CLOSE = CameraSpec("right_close", pos=(0.6, 0.0, 0.75), xyaxes=(0.0, 1.0, 0.0, -0.7, 0.0, 0.75))


class MJCFCamera(Observable):
    """The picture a camera of the model takes, (height, width, 3), uint8 RGB.

    Attributes:
        height: rows of the picture [pixels].
        width: columns of the picture [pixels].
    """

    height: int
    width: int

    checks = CAMERA_CHECKS

    def __init__(
        self, camera: Any, *, height: int = 240, width: int = 320, **options: Unpack[Options]
    ) -> None:
        """Observe a camera element.

        Args:
            camera: the camera element, of the model's ``MjSpec``.
            height: rows of the picture [pixels].
            width: columns of the picture [pixels].
            options: the options of ``Observable``.

        Raises:
            InvalidInputError: camera is no camera element, or an option has a wrong value.
        """
        if not isinstance(camera, mujoco.MjsCamera):
            raise InvalidInputError(f"camera must be a camera element of an MjSpec, got {camera!r}")
        super().__init__(lambda physics: render(physics, camera.name, self.height, self.width), **options)
        self.height = height
        self.width = width


def render(physics: Physics, camera: str, height: int = 240, width: int = 320) -> NDArray[np.uint8]:
    """Return the picture that a camera takes of the present state.

    Args:
        physics: the simulation, which is not changed.
        camera: full name of the camera.
        height: rows of the picture [pixels].
        width: columns of the picture [pixels].

    Returns:
        The picture, (height, width, 3), RGB.

    Raises:
        UnknownNameError: the model has no such camera; lists the cameras.
        InvalidInputError: the picture is larger than the model's offscreen buffer.
        PhysicsError: there is no OpenGL context to render with.
    """
    model = physics.model
    names = [model.camera(i).name for i in range(model.ncam)]
    if camera not in names:
        raise UnknownNameError("camera", camera, names)
    renderer = _renderer(physics, height, width)
    renderer.update_scene(physics.data, camera=names.index(camera))
    picture: NDArray[np.uint8] = renderer.render()
    return picture


def add_camera_observables(
    entity: Entity, obs_settings: ObservationSettings, *camera_specs: CameraSpec
) -> dict[str, MJCFCamera]:
    """Add cameras to an entity before it is compiled, and observables of their pictures.

    Args:
        entity: usually the arena; the cameras are fixed to its world body.
        obs_settings: its ``camera`` category holds the options of the observables.
        camera_specs: the cameras to add.

    Returns:
        The observables by camera name. They are not among ``entity.observables``.

    Raises:
        InvalidInputError: something else than a CameraSpec was given, a camera name is taken, or an
            option has a wrong value; no camera is added then.
    """
    spec = entity.mjcf_model
    taken = {camera.name for camera in spec.cameras}
    for camera_spec in camera_specs:
        if not isinstance(camera_spec, CameraSpec):
            raise InvalidInputError(f"camera_specs must be CameraSpec, got {camera_spec!r}")
        if camera_spec.name in taken:
            raise InvalidInputError(f"a camera named {camera_spec.name!r} is there already")
        taken.add(camera_spec.name)
    options = obs_settings.camera._asdict()
    found: dict[str, MJCFCamera] = {}
    for name, pos, xyaxes in camera_specs:
        camera = spec.worldbody.add_camera(name=name, pos=pos)
        camera.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
        camera.alt.xyaxes = xyaxes
        found[name] = MJCFCamera(camera, **options)
    return found


def _renderer(physics: Physics, height: int, width: int) -> mujoco.Renderer:
    """Return the renderer of this size, made when it is first needed."""
    renderers = _RENDERERS.setdefault(physics, {})
    if (height, width) not in renderers:
        renderers[height, width] = _new_renderer(physics.model, height, width)
    return renderers[height, width]


def _new_renderer(model: mujoco.MjModel, height: int, width: int) -> mujoco.Renderer:
    largest = model.vis.global_.offheight, model.vis.global_.offwidth
    if height > largest[0] or width > largest[1]:
        raise InvalidInputError(
            f"height x width is {height} x {width}, larger than the model's offscreen buffer of "
            f"{largest[0]} x {largest[1]} (mjcf_model.visual.global_.offheight and offwidth)"
        )
    backend = os.environ.get("MUJOCO_GL", "").lower().strip()
    headless = sys.platform == "linux" and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )
    if headless and backend not in ("egl", "osmesa"):
        # Not even tried: GLFW warns without end about a missing display.
        raise PhysicsError(
            _NO_CONTEXT.format(reason=f"there is no display and MUJOCO_GL is {backend or 'not set'}")
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # GLFW's warnings; the error below says it
            return mujoco.Renderer(model, height, width)
    except Exception as error:  # each backend fails with its own type
        raise PhysicsError(_NO_CONTEXT.format(reason=f"{type(error).__name__}: {error}")) from error
