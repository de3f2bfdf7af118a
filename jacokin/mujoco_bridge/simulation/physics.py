"""A compiled scene and its simulation. Read this file first, then `entity`.

`Physics` wraps MuJoCo's model and data: `bind` reads and writes the values of elements, `step` advances time. What
MuJoCo derives from the state is never read, nor integrated from, when it is older than the state.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol, cast, runtime_checkable

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, PhysicsError, UnknownNameError
from jacokin.mujoco_bridge.simulation.binding import EMPTY, Binding
from jacokin.mujoco_bridge.simulation.element_arrays import KINDS
from jacokin.mujoco_bridge.simulation.elements import Element, ElementIds
from jacokin.mujoco_bridge.simulation.forward_cache import ForwardCache

_FLAG = "mjDSBL_"
_WHOLE_NUMBER = int | np.integer


@runtime_checkable
class Compilable(Protocol):
    """What a physics is made from: an `Entity`, or anything else with a spec that it compiles."""

    @property
    def mjcf_model(self) -> mujoco.MjSpec:
        """The spec."""

    def compile(self) -> mujoco.MjModel:
        """The compiled model."""


class Physics:
    """One MuJoCo simulation.

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
            InvalidInputError: model is not a `mujoco.MjModel`.
            PhysicsError: the reference state cannot be simulated.
        """
        if not isinstance(model, mujoco.MjModel):
            raise InvalidInputError(f"model must be a mujoco.MjModel, got {model!r}")
        self.model = model
        self._data = mujoco.MjData(model)
        self._spec = spec
        self._ids = ElementIds(model, spec)
        self._bindings: dict[Element | str | tuple[Element | str, ...], Binding] = {}
        self._cache = ForwardCache(model, self._data)
        self.after_reset()

    @classmethod
    def from_entity(cls, entity: Compilable) -> Physics:
        """Compile an entity with everything attached to it.

        Raises:
            InvalidInputError: not an entity, or one that is attached to another.
            ModelError: MuJoCo refuses the model; its message is passed on.
        """
        if isinstance(entity, type) or not isinstance(entity, Compilable):
            raise InvalidInputError(f"entity must be an Entity such as an Arena, got {entity!r}")
        return cls(entity.compile(), entity.mjcf_model)

    @classmethod
    def from_model(cls, model: mujoco.MjModel) -> Physics:
        """Simulate a `mujoco.MjModel` that was compiled elsewhere; elements are looked up by their names."""
        return cls(model)

    @property
    def data(self) -> mujoco.MjData:
        """The `mujoco.MjData`. Writes to its state, controls and applied forces are noticed."""
        if self._cache.forces_are_due:
            self._cache.forward()
        return self._data

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self._data.time)

    @property
    def timestep(self) -> float:
        """Length of one time step [s]."""
        return float(self.model.opt.timestep)

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
                f"elements must be an MjSpec element, a name, or a list of them, got {elements!r}"
            ) from None
        if not each:
            return EMPTY
        kind, ids = self._ids.find(each)
        binding = self._bindings[key] = Binding(kind, ids, single=single, cache=self._cache)
        return binding

    def forward(self) -> None:
        """Compute everything MuJoCo derives from the present state and controls.

        Raises:
            PhysicsError: the state is not finite, or MuJoCo warns.
        """
        self._cache.forward()

    def set_qpos(self, rows: NDArray[np.intp], values: NDArray[np.float64]) -> None:
        """Write some of qpos, and compute what follows from positions and velocities at once.

        Forces and accelerations follow when they are read, through `bind` or `data`, or needed for a step.

        Args:
            rows: (k,) where in qpos.
            values: (k,) what to write there.

        Raises:
            PhysicsError: MuJoCo gives up, for example for lack of memory; qpos is then as before.
        """
        qpos = self._data.qpos
        before = qpos[rows]
        qpos[rows] = values
        try:
            self._cache.forward_motion()
        except PhysicsError:
            qpos[rows] = before
            raise

    def refresh(self) -> None:
        """Run `forward` if anything changed since the last pass; for those who read ``physics.data`` directly.

        Raises:
            PhysicsError: the state is not finite, or MuJoCo warns.
        """
        self._cache.ensure()

    def step(self, n: int = 1) -> None:
        """Advance n time steps; positions and velocities are then those of the new state.

        Forces, accelerations and the sensors of both are of the last step taken, as MuJoCo computes them on the way.

        Raises:
            InvalidInputError: n is not a whole number >= 1.
            PhysicsError: the simulation diverged or MuJoCo warned; the state is as before the call.
        """
        if isinstance(n, bool) or not isinstance(n, _WHOLE_NUMBER) or n < 1:
            raise InvalidInputError(f"n must be a whole number of steps >= 1, got {n!r}")
        self._cache.step(int(n))

    def reset(self, keyframe: int | str | None = None) -> None:
        """Go to the model's reference state, or to a keyframe.

        For a Jaco the reference state is q = 0, outside the limits of the joints: go on with `set_home`.

        Raises:
            UnknownNameError: there is no such keyframe; lists those there are.
        """
        if keyframe is None:
            mujoco.mj_resetData(self.model, self._data)
        else:
            names = [self.model.key(i).name or i for i in range(self.model.nkey)]
            index = names.index(keyframe) if keyframe in names else keyframe
            if not isinstance(index, int) or not 0 <= index < self.model.nkey:
                raise UnknownNameError("keyframe", str(keyframe), map(str, names))
            mujoco.mj_resetDataKeyframe(self.model, self._data, index)
        self.after_reset()

    def after_reset(self) -> None:
        """Compute everything derived from the state, with the actuators off: controls may not make sense yet.

        Raises:
            PhysicsError: the state is not finite, or MuJoCo warns.
        """
        flags = self.model.opt.disableflags
        self.model.opt.disableflags = flags | int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
        try:
            self._cache.forward()
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
        valid = flag_bits()
        for flag in flags:
            if not isinstance(flag, str) or flag not in valid:
                raise UnknownNameError("flag", str(flag), valid)
        before = self.model.opt.disableflags
        self.model.opt.disableflags = before | sum({valid[flag] for flag in flags})
        self._cache.invalidate()
        try:
            yield
        finally:
            self.model.opt.disableflags = before
            self._cache.invalidate()

    def get_state(self) -> NDArray[np.float64]:
        """A copy of the state: time, positions, velocities, controls, applied forces, and MuJoCo's warm start."""
        signature = int(mujoco.mjtState.mjSTATE_INTEGRATION)
        state = np.empty(mujoco.mj_stateSize(self.model, signature))
        mujoco.mj_getState(self.model, self._data, state, signature)
        return state

    def set_state(self, state: ArrayLike) -> None:
        """Go back to a state that `get_state` gave; the simulation goes on from it bit by bit as it did then.

        Raises:
            InvalidInputError: not a state of this model.
        """
        signature = int(mujoco.mjtState.mjSTATE_INTEGRATION)
        size = mujoco.mj_stateSize(self.model, signature)
        try:
            values = np.asarray(state, dtype=np.float64)
        except (TypeError, ValueError):
            raise InvalidInputError(f"state must be {size} numbers, as get_state gives them, got {state!r}") from None
        if values.shape != (size,):
            raise InvalidInputError(f"state must have shape ({size},), got {values.shape}")
        mujoco.mj_setState(self.model, self._data, values, signature)

    def copy(self) -> Physics:
        """A second simulation in the same state, independent of this one."""
        twin = Physics(copy.copy(self.model), self._spec)
        twin.set_state(self.get_state())
        return twin

    def __deepcopy__(self, memo: dict[int, Any]) -> Physics:
        """The same as `copy`: the spec, which MuJoCo cannot copy deeply, is shared."""
        return self.copy()


def check_physics(physics: Physics) -> Physics:
    """The physics, or an error that says what was given instead.

    Raises:
        InvalidInputError: not a `Physics`.
    """
    if not isinstance(physics, Physics):
        raise InvalidInputError(f"physics must be a Physics, made by Physics.from_entity(arena); got {physics!r}")
    return physics


def flag_bits() -> dict[str, int]:
    """MuJoCo's flags that switch parts of the simulation off, by their names in lower case."""
    members = mujoco.mjtDisableBit.__members__
    return {name.removeprefix(_FLAG).lower(): int(bit) for name, bit in members.items() if name.startswith(_FLAG)}
