"""Cameras that look at the workspace, and their pictures as observables.

Rendering needs an OpenGL context: a display, or ``MUJOCO_GL=egl`` or ``osmesa`` in the environment
before Python starts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple, Unpack

import mujoco
import numpy as np
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks
from jacokin.mujoco_bridge.entity import Entity
from jacokin.mujoco_bridge.observables import ArraySpec, Bound, Observable, ObservableOptions
from jacokin.mujoco_bridge.observations import ObservationSettings
from jacokin.mujoco_bridge.simulation.physics import Physics
from jacokin.mujoco_bridge.simulation.rendering import RenderFlags


class CameraSpec(NamedTuple):
    """A camera that is fixed in an entity's frame."""

    name: str
    pos: tuple[float, float, float]  # [m]
    xyaxes: tuple[float, float, float, float, float, float]  # picture's right and up, not normalised


FRONT_CLOSE = CameraSpec("front_close", pos=(0.0, -0.6, 0.75), xyaxes=(1.0, 0.0, 0.0, 0.0, 0.7, 0.75))
FRONT_FAR = CameraSpec("front_far", pos=(0.0, -0.8, 1.0), xyaxes=(1.0, 0.0, 0.0, 0.0, 0.7, 0.75))
WHOLE = CameraSpec("whole", pos=(1.0, -0.98, 1.25), xyaxes=(1.0, 1.0, 0.0, -0.34, 0.34, 0.877))
TOP_DOWN = CameraSpec("top_down", pos=(0.0, 0.0, 2.5), xyaxes=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0))
LEFT_CLOSE = CameraSpec("left_close", pos=(-0.6, 0.0, 0.75), xyaxes=(0.0, -1.0, 0.0, 0.7, 0.0, 0.75))
RIGHT_CLOSE = CameraSpec("right_close", pos=(0.6, 0.0, 0.75), xyaxes=(0.0, 1.0, 0.0, -0.7, 0.0, 0.75))


class MJCFCamera(Observable):
    """The picture a camera of the model takes: colours, depth, or what is seen; see `Physics.render`.

    Attributes:
        height: rows of the picture [pixels].
        width: columns of the picture [pixels].
    """

    checks: ClassVar[Mapping[str, Callable[[str, object], object]]] = {
        **Observable.checks,
        "height": lambda name, value: checks.whole_number(name, value, 1),
        "width": lambda name, value: checks.whole_number(name, value, 1),
    }

    def __init__(
        self,
        camera: mujoco.MjsCamera,
        *,
        height: int = 240,
        width: int = 320,
        depth: bool = False,
        segmentation: bool = False,
        scene_option: mujoco.MjvOption | None = None,
        render_flag_overrides: RenderFlags | None = None,
        **options: Unpack[ObservableOptions],
    ) -> None:
        """Observe a camera element.

        Args:
            camera: the camera element, of the model's ``MjSpec``.
            height: rows of the picture [pixels].
            width: columns of the picture [pixels].
            depth: observe distances (height, width) float32 [m] instead of colours (height, width, 3) uint8.
            segmentation: observe ids and types of what is seen, (height, width, 2) int32, instead of colours.
            scene_option: what is drawn; None for MuJoCo's default.
            render_flag_overrides: flags of rendering to switch, such as ``{"shadow": False}``.
            options: the options of ``Observable``.

        Raises:
            InvalidInputError: camera is not a camera element, both depth and segmentation are asked for, or an option
                has a wrong value.
        """
        checks.instance("camera", camera, mujoco.MjsCamera, "a camera element of an MjSpec")
        if checks.flag("depth", depth) and checks.flag("segmentation", segmentation):
            raise InvalidInputError("at most one of depth and segmentation can be observed by one camera observable")
        self._camera = Bound(camera)
        self._look: dict[str, Any] = {
            "depth": depth,
            "segmentation": segmentation,
            "scene_option": scene_option,
            "render_flag_overrides": render_flag_overrides,
        }
        super().__init__(self._picture, **options)
        self.height = height
        self.width = width

    @property
    def array_spec(self) -> ArraySpec:
        """Shape, type and bounds of the picture."""
        if self._look["depth"]:
            return ArraySpec((self.height, self.width), np.float32, minimum=0.0)
        if self._look["segmentation"]:
            return ArraySpec((self.height, self.width, 2), np.int32, minimum=-1)
        return ArraySpec((self.height, self.width, 3), np.uint8, minimum=0, maximum=255)

    def _picture(self, physics: Physics) -> NDArray[Any]:
        """The picture of the present state; raises what `Physics.render` raises."""
        return physics.render(self.height, self.width, self._camera(physics).element_ids[0], **self._look)


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
    if not isinstance(entity, Entity):
        raise InvalidInputError(f"entity must be an Entity such as an Arena, got {shown(entity)}")
    checks.instance("obs_settings", obs_settings, ObservationSettings, "ObservationSettings")
    options = MJCFCamera.check_options(obs_settings.camera._asdict())
    taken = {camera.name for camera in entity.root.mjcf_model.cameras}
    for camera_spec in camera_specs:
        checks.instance("camera_specs", camera_spec, CameraSpec, "CameraSpec")
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
