"""A compiled scene and its simulation: binding elements, steps, resets, states, pictures. Read this file first.

What MuJoCo derives from the state is never read, nor integrated from, when it is older than the state.

A physics may be used by several threads: calls that compute wait for one another. The arrays are live all the same, so
hold ``physics.lock`` to read several values of one moment.
"""

from __future__ import annotations

import copy
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol, cast, runtime_checkable

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, PhysicsError, UnknownNameError, shown
from jacokin.model import checks
from jacokin.mujoco_bridge.simulation.binding import Binding, ForwardCache
from jacokin.mujoco_bridge.simulation.elements import KINDS, Element, ElementIds
from jacokin.mujoco_bridge.simulation.rendering import FREE_CAMERA, Renderers, RenderFlags

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
_DISABLED = "mjDSBL_"  # before the names of the parts of MuJoCo that can be disabled


@runtime_checkable
class Compilable(Protocol):
    """What a physics is made from: an `Entity`, or anything else with a spec that it compiles."""

    @property
    def mjcf_model(self) -> mujoco.MjSpec:
        """The spec."""

    def compile(self) -> mujoco.MjModel:
        """The compiled model."""


class Physics:
    """One MuJoCo simulation, whose elements can be bound and pictured.

    Attributes:
        model: the `mujoco.MjModel`. After writing to it directly, call `forward`.
    """

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
        checks.instance("model", model, mujoco.MjModel, "a mujoco.MjModel")
        self.model = model
        self._data = mujoco.MjData(model)
        self._cache = ForwardCache(model, self._data)
        self._forward_without_actuators(may_be_crowded=True)
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
            raise checks.refusal("elements", "an MjSpec element, a name, or a list of them", elements) from None
        kind, ids = self._ids.find(each)
        binding = self._bindings[key] = Binding(kind, ids, single=single, cache=self._cache)
        return binding

    @property
    def data(self) -> mujoco.MjData:
        """The `mujoco.MjData`. Writes to its state, controls and applied forces are noticed.

        Reading this property computes what `set_qpos` has left due; an `MjData` that was kept from before then has only
        its poses, and what Jacobians are made of, up to date.
        """
        if self._cache.rest_is_due:
            self._cache.forward()
        return self._data

    @property
    def lock(self) -> threading.RLock:
        """Held while MuJoCo computes; hold it to read or write several values without another thread in between."""
        return self._cache.lock

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self._data.time)

    @property
    def timestep(self) -> float:
        """Length of one time step [s]."""
        return float(self.model.opt.timestep)

    def forward(self) -> None:
        """Compute everything MuJoCo derives from the present state and controls.

        Raises:
            PhysicsError: the state is not finite, or MuJoCo warns.
        """
        self._cache.forward()

    def set_qpos(self, rows: NDArray[np.intp], values: NDArray[np.float64]) -> None:
        """Write some of qpos, and compute poses and what Jacobians are made of at once.

        A forward pass computes everything else at the next read through `data`, `render` or a computed field of `bind`,
        and before a step.

        Args:
            rows: (k,) where in qpos.
            values: (k,) what to write there.

        Raises:
            InvalidInputError: not such rows, or not as many finite numbers.
            PhysicsError: MuJoCo gives up; qpos is then as before.
        """
        rows = self._checked_rows(rows)
        values = checks.vector("values", values, len(rows), "qpos")
        with self.lock:
            self._try_qpos(rows, values)
            self._keep_qpos()

    def _try_qpos(self, rows: NDArray[np.intp], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Write some of qpos and compute poses; returns what was there, (k,).

        The caller, who holds the lock, then either calls `_keep_qpos` or puts back what was there in the same way.
        """
        qpos = self._data.qpos
        before: NDArray[np.float64] = qpos[rows]
        qpos[rows] = values
        try:
            self._cache.forward_poses()
        except PhysicsError:
            qpos[rows] = before
            raise
        return before

    def _keep_qpos(self) -> None:
        """Make everything due that `_try_qpos` has not computed."""
        self._cache.rest_is_due = True

    def _checked_rows(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        try:
            found = np.asarray(rows)
            is_list = found.dtype.kind in "iu" and found.ndim == 1
        except Exception:  # rows of different lengths, or an array of another library
            is_list = False
        places: list[int] = found.tolist() if is_list else [-1]
        if places and not (min(places) >= 0 and max(places) < self.model.nq):  # faster than NumPy's for a few
            raise InvalidInputError(f"rows must be whole numbers from 0 to {self.model.nq - 1}, got {shown(rows)}")
        return found

    def refresh(self) -> None:
        """Compute all that follows from the state; needed after writing derived values to ``physics.data`` directly.

        Raises:
            PhysicsError: the state is not finite, or MuJoCo warns.
        """
        self._cache.forward()

    def update(self) -> None:
        """Run `forward` if anything was changed since the last pass, as reading a derived field through `bind` does.

        Call it before reading ``physics.data`` directly.

        Raises:
            PhysicsError: the state is not finite, or MuJoCo warns.
        """
        self._cache.ensure()

    def set_control(self, control: ArrayLike) -> None:
        """Write the controls of all actuators.

        Args:
            control: (nu,) in the order of the model's actuators.

        Raises:
            InvalidInputError: wrong shape, not numbers, or not finite.
        """
        self._data.ctrl[:] = checks.vector("control", control, self.model.nu, "control")

    def step(self, n: int = 1) -> None:
        """Advance n time steps; positions and velocities are then those of the new state.

        Forces, accelerations and the sensors of both are of the last step taken, as MuJoCo computes them on the way.

        Raises:
            InvalidInputError: n is not a whole number >= 1.
            PhysicsError: the simulation diverged or MuJoCo warned; the state is as before the call.
        """
        self._cache.step(checks.whole_number("n", n, 1, 2**31 - 1))  # MuJoCo counts in 32 bits

    def reset(self, keyframe: int | str | None = None) -> None:
        """Go to the model's reference state, or to a keyframe.

        For a Jaco the reference state is q = 0, outside the limits of the joints: go on with `set_home`.

        Raises:
            UnknownNameError: there is no such keyframe; lists those there are.
        """
        names = [self.model.key(i).name or i for i in range(self.model.nkey)]
        index = names.index(keyframe) if isinstance(keyframe, str) and keyframe in names else keyframe
        if index is not None and (not isinstance(index, int) or not 0 <= index < self.model.nkey):
            raise UnknownNameError("keyframe", keyframe, map(str, names))
        with self.lock:
            if index is None:
                mujoco.mj_resetData(self.model, self._data)
            else:
                mujoco.mj_resetDataKeyframe(self.model, self._data, index)
            self._forward_without_actuators(may_be_crowded=True)

    def after_reset(self) -> None:
        """Compute everything derived from the state, with the actuators off: controls may not make sense yet.

        Raises:
            PhysicsError: the state is not finite, or MuJoCo warns.
        """
        self._forward_without_actuators(may_be_crowded=False)

    def _forward_without_actuators(self, *, may_be_crowded: bool) -> None:
        """Run a forward pass; the reference state of a Jaco, where all of it touches, need not fit into the memory."""
        with self.lock:
            flags = self.model.opt.disableflags
            self.model.opt.disableflags = flags | int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
            try:
                self._cache.forward(may_be_crowded=may_be_crowded)
            finally:
                self.model.opt.disableflags = flags

    @contextmanager
    def disable(self, *flags: str) -> Iterator[None]:
        """Switch parts of the simulation off for the length of a ``with`` block.

        Args:
            flags: "contact", "gravity", "actuation", "limit", ... : MuJoCo's names, in lower case.

        Raises:
            UnknownNameError: there is no such part; lists those there are.
        """
        bits = disable_mask(flags)
        with self.lock:  # for the whole block: other threads must not see the flags
            before = self.model.opt.disableflags
            self.model.opt.disableflags = before | bits
            self._cache.invalidate()
            try:
                yield
            finally:
                self.model.opt.disableflags = before
                self._cache.invalidate()

    def get_state(self) -> NDArray[np.float64]:
        """A copy of the state: time, positions, velocities, controls, applied forces, and MuJoCo's warm start."""
        state = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        with self.lock:
            mujoco.mj_getState(self.model, self._data, state, _STATE)
        return state

    def set_state(self, state: ArrayLike) -> None:
        """Go back to a state that `get_state` gave; the simulation goes on from it bit by bit as it did then.

        Raises:
            InvalidInputError: not a state of this model.
        """
        size = mujoco.mj_stateSize(self.model, _STATE)
        values = checks.array("state", state, f"{size} numbers, as get_state gives them")
        if values.shape != (size,):
            raise InvalidInputError(f"state must have shape ({size},), got {values.shape}")
        with self.lock:
            mujoco.mj_setState(self.model, self._data, values, _STATE)

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
        """A second simulation in the same state, independent of this one."""
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


def disable_mask(flags: Sequence[str]) -> int:
    """The bits of `mujoco.mjtDisableBit` of several parts of MuJoCo together, by their names as in `Physics.disable`.

    Raises:
        UnknownNameError: there is no such part; lists the valid ones.
    """
    members = mujoco.mjtDisableBit.__members__
    bits = {
        name.removeprefix(_DISABLED).lower(): int(bit) for name, bit in members.items() if name.startswith(_DISABLED)
    }
    mask = 0
    for flag in flags:
        mask |= bits[checks.choice("flag", flag, bits)]
    return mask
