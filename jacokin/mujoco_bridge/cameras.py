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

from jacokin.errors import InvalidInputError, PhysicsError
from jacokin.mujoco_bridge.observables.observable import Bound, Observable
from jacokin.mujoco_bridge.observables.options import CAMERA_CHECKS, Options
from jacokin.mujoco_bridge.observations import ObservationSettings

if TYPE_CHECKING:
    from jacokin.mujoco_bridge.entities.entity import Entity
    from jacokin.mujoco_bridge.simulation.physics import Physics

_NO_CONTEXT = (
    "no picture can be rendered: {reason}. Without a display, set MUJOCO_GL=egl (Debian: libegl1 and "
    "libegl-mesa0) or MUJOCO_GL=osmesa (Debian: libosmesa6) before Python starts"
)
_RENDERERS: weakref.WeakKeyDictionary[Physics, dict[tuple[int, int], mujoco.Renderer]]
_RENDERERS = weakref.WeakKeyDictionary()

# The first failure to make a context, if there was one: a second attempt makes MuJoCo abort the process.
_FAILURES: list[str] = []


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

    def __init__(self, camera: Any, *, height: int = 240, width: int = 320, **options: Unpack[Options]) -> None:
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
        self._camera = Bound(camera)
        super().__init__(self._picture, **options)
        self.height = height
        self.width = width

    def _picture(self, physics: Physics) -> NDArray[np.uint8]:
        """Return the picture of the present state; raises what `_new_renderer` raises."""
        camera = self._camera(physics)
        renderer = _renderer(physics, self.height, self.width)
        _ = camera.xpos  # runs a forward pass if one is due
        renderer.update_scene(physics.data, camera=camera.element_id)
        picture: NDArray[np.uint8] = renderer.render()
        return picture


def add_camera_observables(
    entity: Entity, obs_settings: ObservationSettings, *camera_specs: CameraSpec
) -> dict[str, MJCFCamera]:
    """Add cameras to an entity, and observables of their pictures. A physics made before does not have them.

    Args:
        entity: usually the arena; the cameras are fixed in its frame.
        obs_settings: its ``camera`` category holds the options of the observables.
        camera_specs: the cameras to add.

    Returns:
        The observables by name of the camera specs. They are not among ``entity.observables``.

    Raises:
        InvalidInputError: an argument has the wrong type, a camera name is taken, or an option has a
            wrong value; no camera is added then.
    """
    from jacokin.mujoco_bridge.entities.entity import Entity  # which need not load for cameras alone

    if not isinstance(entity, Entity):
        raise InvalidInputError(f"entity must be an Entity such as an Arena, got {entity!r}")
    if not isinstance(obs_settings, ObservationSettings):
        raise InvalidInputError(f"obs_settings must be ObservationSettings, got {obs_settings!r}")
    options = MJCFCamera.check_options(obs_settings.camera._asdict())
    taken = {camera.name for camera in entity.root.mjcf_model.cameras}
    for camera_spec in camera_specs:
        if not isinstance(camera_spec, CameraSpec):
            raise InvalidInputError(f"camera_specs must be CameraSpec, got {camera_spec!r}")
        full_name = entity.prefix + camera_spec.name
        if full_name in taken:
            raise InvalidInputError(f"a camera named {full_name!r} is there already")
        taken.add(full_name)
    found: dict[str, MJCFCamera] = {}
    for name, pos, xyaxes in camera_specs:
        camera = entity.root_body.add_camera(name=entity.prefix + name, pos=pos)
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
    headless = sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    if headless and backend not in ("egl", "osmesa"):
        # Not even tried: GLFW warns without end about a missing display.
        raise PhysicsError(_NO_CONTEXT.format(reason=f"there is no display and MUJOCO_GL is {backend or 'not set'}"))
    if _FAILURES:
        raise PhysicsError(_NO_CONTEXT.format(reason=_FAILURES[0]))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # GLFW's; the error below says what they say
            return mujoco.Renderer(model, height, width)
    except Exception as error:  # each backend fails with its own type
        _FAILURES.append(f"{type(error).__name__}: {error}")
        raise PhysicsError(_NO_CONTEXT.format(reason=_FAILURES[0])) from error
