"""A compiled scene and its simulation. Read this file first, then `entity`.

`Physics` wraps MuJoCo's model and data: `bind` reads and writes the values of elements, `step` advances time. What
MuJoCo derives from the state is never read, nor integrated from, when it is older than the state.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.mujoco_bridge.simulation.binding import Binding
from jacokin.mujoco_bridge.simulation.elements import element_id, kind_of
from jacokin.mujoco_bridge.simulation.forward_cache import Freshness

if TYPE_CHECKING:
    from jacokin.mujoco_bridge.entities.entity import Entity

_FLAG = "mjDSBL_"
_WHOLE_NUMBER = int | np.integer


class Seconds(float):
    """A time [s]: a number that may also be called, since the interface this bridge follows has methods here."""

    def __call__(self) -> float:
        """The time [s]."""
        return float(self)


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
            InvalidInputError: model is no `mujoco.MjModel`.
            PhysicsError: the reference state cannot be simulated.
        """
        if not isinstance(model, mujoco.MjModel):
            raise InvalidInputError(f"model must be a mujoco.MjModel, got {model!r}")
        self.model = model
        self._data = mujoco.MjData(model)
        self._spec = spec
        self._bindings: dict[Any, Binding] = {}
        self._freshness = Freshness(model, self._data)
        self.after_reset()

    @classmethod
    def from_entity(cls, entity: Entity) -> Physics:
        """Compile an entity with everything attached to it.

        Raises:
            InvalidInputError: not an entity, or one that is attached to another.
            ModelError: MuJoCo refuses the model; its message is passed on.
        """
        from jacokin.mujoco_bridge.entities.entity import Entity  # which imports this module

        if not isinstance(entity, Entity):
            raise InvalidInputError(f"entity must be an Entity such as an Arena, got {entity!r}")
        return cls(entity.compile(), entity.mjcf_model)

    @classmethod
    def from_model(cls, model: mujoco.MjModel) -> Physics:
        """Simulate a `mujoco.MjModel` that was compiled elsewhere; elements are looked up by their names."""
        return cls(model)

    @property
    def data(self) -> mujoco.MjData:
        """The `mujoco.MjData`. Writes to its state, controls and applied forces are noticed."""
        if self._freshness.forces_are_due:
            self._freshness.forward()
        return self._data

    @property
    def time(self) -> Seconds:
        """Simulated time [s]."""
        return Seconds(self._data.time)

    @property
    def timestep(self) -> Seconds:
        """Length of one time step [s]."""
        return Seconds(self.model.opt.timestep)

    def bind(self, elements: Any) -> Binding:
        """The values MuJoCo keeps for one element of a spec, or for several of one kind.

        Args:
            elements: an element such as ``arm.wrist_site``, or a list of elements of one kind.

        Returns:
            A `Binding`: ``physics.bind(arm.joints).qpos`` is a live array. Bindings are kept and reused.

        Raises:
            InvalidInputError: not elements, of several kinds, or of another model.
        """
        try:
            key = elements if kind_of(elements) else tuple(elements)
            return self._bindings[key]
        except KeyError:
            pass
        except TypeError:
            raise InvalidInputError(f"elements must be an MjSpec element or a list of them, got {elements!r}") from None
        single = not isinstance(key, tuple)
        each = (key,) if single else key
        if not each:
            raise InvalidInputError("elements is empty: nothing to bind")
        kinds = [kind_of(element) for element in each]
        if None in kinds:
            raise InvalidInputError(f"{each[kinds.index(None)]!r} is no element of an MjSpec that can be bound")
        if len(set(kinds)) > 1:
            names = sorted({kind.name for kind in kinds if kind})
            raise InvalidInputError(f"elements must be of one kind, got {' and '.join(names)}")
        ids = [element_id(self.model, self._spec, element) for element in each]
        binding = self._bindings[key] = Binding(type(each[0]), ids, single=single, freshness=self._freshness)
        return binding

    def forward(self) -> None:
        """Compute everything MuJoCo derives from the present state and controls.

        Raises:
            PhysicsError: the state is not finite, or MuJoCo warns.
        """
        self._freshness.forward()

    def set_qpos(self, rows: NDArray[np.intp], values: NDArray[np.float64]) -> None:
        """Write some of qpos, and compute what follows from positions and velocities at once.

        Forces and accelerations follow when they are read, through `bind` or `data`, or needed for a step.

        Args:
            rows: (k,) where in qpos.
            values: (k,) what to write there.
        """
        self._data.qpos[rows] = values
        self._freshness.forward_motion()

    def refresh(self) -> None:
        """Run `forward` if anything changed since the last pass; for those who read ``physics.data`` directly.

        Raises:
            PhysicsError: the state is not finite, or MuJoCo warns.
        """
        self._freshness.ensure()

    def step(self, n: int = 1) -> None:
        """Advance n time steps; positions and velocities are then those of the new state.

        Forces, accelerations and the sensors of both are of the last step taken, as MuJoCo computes them on the way.

        Raises:
            InvalidInputError: n is no whole number >= 1.
            PhysicsError: the simulation diverged or MuJoCo warned; the state is as before the call.
        """
        if isinstance(n, bool) or not isinstance(n, _WHOLE_NUMBER) or n < 1:
            raise InvalidInputError(f"n must be a whole number of steps >= 1, got {n!r}")
        self._freshness.step(int(n))

    def reset(self, keyframe: int | str | None = None) -> None:
        """Go to the model's reference state (for a Jaco q = 0, which is illegal: go on with `set_home`), or a keyframe.

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
            self._freshness.forward()
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
        valid = {name.removeprefix(_FLAG).lower(): int(bit) for name, bit in _disable_bits()}
        for flag in flags:
            if not isinstance(flag, str) or flag not in valid:
                raise UnknownNameError("flag", str(flag), valid)
        before = self.model.opt.disableflags
        self.model.opt.disableflags = before | sum({valid[flag] for flag in flags})
        self._freshness.invalidate()
        try:
            yield
        finally:
            self.model.opt.disableflags = before
            self._freshness.invalidate()

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


def _disable_bits() -> list[tuple[str, Any]]:
    return [item for item in mujoco.mjtDisableBit.__members__.items() if item[0].startswith(_FLAG)]
