"""Pictures of a simulation: colours, depth, and which geom is where.

Rendering needs an OpenGL context: a display, or ``MUJOCO_GL=egl`` or ``osmesa`` in the environment before Python
starts.
"""

from __future__ import annotations

import atexit
import os
import warnings
import weakref
from collections.abc import Mapping
from typing import Any

import mujoco
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError, PhysicsError, shown
from jacokin.model import checks
from jacokin.showing import has_display

FREE_CAMERA = -1
RenderFlags = Mapping[str, bool]

_Kind = tuple[int, int, int, int]  # height, width, size of shadows, samples

_MOST_PIXELS = 2**31 - 1  # along one side, in MuJoCo
_NO_CONTEXT = (
    "no picture can be rendered: {reason}. Without a display, set MUJOCO_GL=egl (Debian: libegl1 and "
    "libegl-mesa0) or MUJOCO_GL=osmesa (Debian: libosmesa6) before Python starts"
)

# The first failure to make a context, if there was one: a second attempt makes MuJoCo abort the process.
_FAILURES: list[str] = []
_OPEN: weakref.WeakSet[Renderers] = weakref.WeakSet()
_DISCARDED: list[mujoco.Renderer] = []  # of renderers that nothing refers to any more; freed before the next picture


class Renderers:
    """The renderers of one model, made when first needed for a size of picture and a quality, `model.vis.quality`."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Start without any."""
        self._model = model
        self._made: dict[_Kind, mujoco.Renderer] = {}
        # Freed by Python at any time, one would take away the OpenGL context that a picture is being taken in.
        weakref.finalize(self, _discard, self._made).atexit = False

    def render(
        self,
        data: mujoco.MjData,
        height: int,
        width: int,
        camera: int | str,
        *,
        depth: bool = False,
        segmentation: bool = False,
        scene_option: mujoco.MjvOption | None = None,
        render_flag_overrides: RenderFlags | None = None,
    ) -> NDArray[Any]:
        """Take a picture of up-to-date data; see `Physics.render` for the arguments.

        Raises:
            InvalidInputError: an argument is wrong.
            UnknownNameError: no such camera or flag.
            PhysicsError: there is no OpenGL context.
        """
        if checks.flag("depth", depth) and checks.flag("segmentation", segmentation):
            raise InvalidInputError("at most one of depth and segmentation can be rendered at a time")
        if scene_option is not None:
            checks.instance("scene_option", scene_option, mujoco.MjvOption, "a mujoco.MjvOption or None")
        flags = _checked_flags(render_flag_overrides)
        number = self._camera_id(camera)
        size = (
            checks.whole_number("height", height, 1, _MOST_PIXELS),
            checks.whole_number("width", width, 1, _MOST_PIXELS),
        )
        _free(_DISCARDED)
        quality = self._model.vis.quality
        kind = (*size, int(quality.shadowsize), int(quality.offsamples))  # which a context keeps as it was made
        if kind not in self._made:
            self._made[kind] = _new_renderer(self._model, *size)
            _close_at_exit(self)
        renderer = self._made[kind]
        renderer.update_scene(data, camera=number, scene_option=scene_option)
        before = renderer.scene.flags.copy()
        try:
            for flag, value in flags.items():
                renderer.scene.flags[flag] = value
            if depth:
                renderer.enable_depth_rendering()
            elif segmentation:
                renderer.enable_segmentation_rendering()
            picture: NDArray[Any] = renderer.render()
        finally:
            renderer.scene.flags[:] = before
            renderer.disable_depth_rendering()
            renderer.disable_segmentation_rendering()
        return picture

    def close(self) -> None:
        """Free the renderers."""
        _discard(self._made)
        _free(_DISCARDED)

    def _camera_id(self, camera: int | str) -> int:
        count = self._model.ncam
        names = [self._model.camera(i).name for i in range(count)]
        if isinstance(camera, str):
            return names.index(checks.choice("camera", camera, names))
        number = checks.whole_number("camera_id", camera, FREE_CAMERA)
        if number >= count:
            raise InvalidInputError(
                f"camera_id must be below {count}, a name, or -1 for the free camera, got {shown(number)}. "
                f"Cameras: {', '.join(names) or '(none)'}"
            )
        return number


def _discard(renderers: dict[_Kind, mujoco.Renderer]) -> None:
    while renderers:
        _DISCARDED.append(renderers.popitem()[1])


def _free(renderers: list[mujoco.Renderer]) -> None:
    while renderers:
        renderer = renderers.pop()
        # MuJoCo 3.17 frees what belongs to the context that happens to be current, of whatever renderer.
        renderer._gl_context.make_current()
        renderer.close()


def _close_at_exit(renderers: Renderers) -> None:
    """Free OpenGL's contexts before Python shuts down; to be called after the first context was made."""
    if not _OPEN:
        atexit.register(_close_all)
    _OPEN.add(renderers)


def _close_all() -> None:
    for each in _OPEN:
        each.close()
    _free(_DISCARDED)


def _checked_flags(overrides: RenderFlags | None) -> dict[int, bool]:
    known = {name.removeprefix("mjRND_").lower(): int(flag) for name, flag in mujoco.mjtRndFlag.__members__.items()}
    valid = {name: number for name, number in known.items() if number < len(mujoco.MjvScene().flags)}
    if overrides is not None:
        overrides = checks.mapping("render_flag_overrides", overrides, "a dict of flags")
    return {
        valid[checks.choice("render flag", name, valid)]: checks.flag(f"render_flag_overrides[{name!r}]", value)
        for name, value in (overrides or {}).items()
    }


def _new_renderer(model: mujoco.MjModel, height: int, width: int) -> mujoco.Renderer:
    largest = model.vis.global_.offheight, model.vis.global_.offwidth
    if height > largest[0] or width > largest[1]:
        raise InvalidInputError(
            f"height x width is {height} x {width}, larger than the model's offscreen buffer of "
            f"{largest[0]} x {largest[1]} (mjcf_model.visual.global_.offheight and offwidth)"
        )
    backend = os.environ.get("MUJOCO_GL", "").lower().strip()
    if not has_display() and backend not in ("egl", "osmesa"):
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
