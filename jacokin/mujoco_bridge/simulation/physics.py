"""A compiled scene and its simulation. Read this file first, then `entity`.

`Physics` wraps MuJoCo's model and data: `bind` reads and writes the values of elements, `render` takes pictures. Steps,
resets and states are those of `Simulation`, which it extends.

A physics may be used by several threads: calls that compute wait for one another. The arrays are live all the same, so
whoever reads several values of one moment holds ``physics.lock``.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable
from typing import Any, Protocol, cast, runtime_checkable

import mujoco
import numpy as np
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError, shown
from jacokin.mujoco_bridge.simulation.binding import EMPTY, Binding
from jacokin.mujoco_bridge.simulation.elements import KINDS, Element, ElementIds
from jacokin.mujoco_bridge.simulation.rendering import FREE_CAMERA, Renderers, RenderFlags
from jacokin.mujoco_bridge.simulation.simulation import Simulation


@runtime_checkable
class Compilable(Protocol):
    """What a physics is made from: an `Entity`, or anything else with a spec that it compiles."""

    @property
    def mjcf_model(self) -> mujoco.MjSpec:
        """The spec."""

    def compile(self) -> mujoco.MjModel:
        """The compiled model."""


class Physics(Simulation):
    """One MuJoCo simulation, whose elements can be bound and pictured."""

    def __init__(self, model: mujoco.MjModel, spec: mujoco.MjSpec | None = None) -> None:
        """Start a simulation at the model's reference state; see also `from_entity`.

        Args:
            model: the compiled model.
            spec: the `mujoco.MjSpec` it was compiled from; None if it came from elsewhere, then elements are looked
                up by their names alone.

        Raises:
            InvalidInputError: model is not a `mujoco.MjModel`, or the spec was changed since.
            PhysicsError: the reference state cannot be simulated.
        """
        super().__init__(model)
        self._ids = ElementIds(model, spec)
        self._bindings: dict[Element | str | tuple[Element | str, ...], Binding] = {}
        self._renderers = Renderers(model)

    @classmethod
    def from_entity(cls, entity: Compilable) -> Physics:
        """Compile an entity with everything attached to it.

        Raises:
            InvalidInputError: not an entity, or one that is attached to another.
            ModelError: MuJoCo refuses the model; its message is passed on.
        """
        if isinstance(entity, type) or not isinstance(entity, Compilable):
            raise InvalidInputError(f"entity must be an Entity such as an Arena, got {shown(entity)}")
        return cls(entity.compile(), entity.mjcf_model)

    @classmethod
    def from_model(cls, model: mujoco.MjModel) -> Physics:
        """Simulate a `mujoco.MjModel` that was compiled elsewhere; elements are looked up by their names."""
        return cls(model)

    def bind(self, elements: Element | str | Iterable[Element | str]) -> Binding:
        """The values MuJoCo keeps for one element of a spec, or for several of one kind.

        Args:
            elements: an element such as ``arm.wrist_site``, its full name such as ``"jaco_arm/wristsite"``, or a list
                of elements or names of one kind. A name that elements of several kinds have, as joints and their
                actuators do, means the first of body, joint, geom, site, camera, light, actuator, sensor.

        Returns:
            A `Binding`: ``physics.bind(arm.joints).qpos`` is a live array. Bindings are kept and reused. Every field
            of the binding of an empty list is an empty array.

        Raises:
            InvalidInputError: not elements, of several kinds, or of another model.
            UnknownNameError: no element has this name.
        """
        single = isinstance(elements, str) or type(elements) in KINDS
        try:
            each = cast("tuple[Element | str, ...]", (elements,) if single else tuple(elements))
            key = each[0] if single else each
            return self._bindings[key]
        except KeyError:
            pass
        except TypeError:
            raise InvalidInputError(
                f"elements must be an MjSpec element, a name, or a list of them, got {shown(elements)}"
            ) from None
        if not each:
            return EMPTY
        kind, ids = self._ids.find(each)
        binding = self._bindings[key] = Binding(kind, ids, single=single, cache=self._cache)
        return binding

    def render(
        self,
        height: int = 240,
        width: int = 320,
        camera_id: int | str = FREE_CAMERA,
        *,
        depth: bool = False,
        segmentation: bool = False,
        scene_option: mujoco.MjvOption | None = None,
        render_flag_overrides: RenderFlags | None = None,
    ) -> NDArray[Any]:
        """Take a picture of the present state.

        Args:
            height: rows [pixels].
            width: columns [pixels].
            camera_id: a camera's number or full name; -1 for the free camera.
            depth: return distances instead of colours.
            segmentation: return what is seen instead of colours.
            scene_option: what is drawn; None for MuJoCo's default.
            render_flag_overrides: flags of rendering to switch, such as ``{"wireframe": True}``.

        Returns:
            (height, width, 3) uint8 red, green, blue; of depth (height, width) float32 [m]; of segmentation (height,
            width, 2) int32: the id and the type (`mujoco.mjtObj`) of what is seen, -1 and -1 for nothing.

        Raises:
            InvalidInputError: an argument is wrong.
            UnknownNameError: no such camera or flag.
            PhysicsError: there is no OpenGL context, or the state cannot be simulated.
        """
        with self.lock:
            self.update()
            return self._renderers.render(
                self._data,
                height,
                width,
                camera_id,
                depth=depth,
                segmentation=segmentation,
                scene_option=scene_option,
                render_flag_overrides=render_flag_overrides,
            )

    def copy(self) -> Physics:
        """A second simulation in the same state, independent of this one."""
        with self.lock:
            twin = Physics(copy.copy(self.model))
            twin.set_state(self.get_state())
        twin._ids = self._ids
        return twin

    def __deepcopy__(self, memo: dict[int, object]) -> Physics:
        """The same as `copy`."""
        return self.copy()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the model and the state; elements are looked up by their names afterwards."""
        with self.lock:
            return _unpickled, (self.model, self.get_state())


def _unpickled(model: mujoco.MjModel, state: NDArray[np.float64]) -> Physics:
    physics = Physics(model)
    physics.set_state(state)
    return physics


def check_physics(physics: Physics) -> Physics:
    """The physics, or an error that says what was given instead.

    Raises:
        InvalidInputError: not a `Physics`.
    """
    if not isinstance(physics, Physics):
        raise InvalidInputError(f"physics must be a Physics, made by Physics.from_entity(arena); got {shown(physics)}")
    return physics
