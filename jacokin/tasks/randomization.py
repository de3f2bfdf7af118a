"""`Randomization`: masses, friction, gains, delays, noise, lights and poses that differ between episodes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.mujoco_bridge.base import RandomState
from jacokin.mujoco_bridge.distributions import Normal, Sampler, Uniform, constant_or_sampler
from jacokin.mujoco_bridge.entity import quaternion_product
from jacokin.tasks.task import CAMERA, CONTROL_TIMESTEP

Choice = float | Sampler | Mapping[str, Any] | None

FACTORS = ("friction", "mass", "gains", "damping", "lights")
MAX_LATENCY = 1.0  # [s]
MAX_SHIFT = 0.5  # [m] of the base in each direction, and of the camera
_LARGEST_FACTOR = 1e3
_CAMERA = ("camera_x", "camera_y", "camera_z")
_BASE = ("base_x", "base_y", "base_z", "base_yaw")
_VALUES = {"camera": ("camera", *_CAMERA), "base_pose": _BASE}  # of fields that have several, or under other names


@dataclass(frozen=True, slots=True)
class Randomization:
    """What is drawn at each reset: a number, a sampler such as ``Uniform(0.3, 1.2)``, or None to leave it.

    The arguments of `Uniform` or `Normal` in a dictionary mean that sampler, as in JSON: ``{"low": 0.3, "high": 1.2}``.

    Attributes:
        friction: factor of the sliding friction of all geoms.
        mass: factor of the masses and inertias of what moves freely.
        gains: factor of the gains of the actuators, and of the damping that belongs to them.
        damping: factor of the damping of the joints of arm and hand.
        lights: factor of the brightness of lights.
        latency: delay of actions [s], rounded to control steps of 0.04 s; at most 1 s.
        observation_noise: standard deviation of normal noise on all features and on ``achieved_goal``, in their units;
            rewards and ``desired_goal`` are exact.
        camera: distance by which the camera is moved, in a direction that is drawn too [m]; at most 0.5 m.
        base_pose: displacement of the arm's base: x, y, z [m] and yaw about its vertical axis [rad]. One number, or a
            sampler of one, means each of the four: ``Uniform(-0.02, 0.02)`` draws four numbers.
    """

    friction: Choice = None
    mass: Choice = None
    gains: Choice = None
    damping: Choice = None
    lights: Choice = None
    latency: Choice = None
    observation_noise: Choice = None
    camera: Choice = None
    base_pose: Choice | ArrayLike = None

    def __post_init__(self) -> None:
        """Check what can be checked before anything is drawn.

        Raises:
            InvalidInputError: a number that is impossible, or something else than a number or a sampler.
        """
        for name, value in self._given().items():
            if isinstance(value, Mapping):
                object.__setattr__(self, name, _distribution(name, value))
                continue
            constant_or_sampler(name, value)
            if not callable(value):
                numbers = list(_values_by_name(name, value).values())
                object.__setattr__(self, name, numbers[0] if len(numbers) == 1 else tuple(numbers))

    @classmethod
    def of(cls, value: Randomization | Mapping[str, Any]) -> Randomization:
        """The randomization itself, or made of its fields by name.

        Raises:
            InvalidInputError: neither, or impossible values.
            UnknownNameError: an unknown field.
        """
        if isinstance(value, cls):
            return value
        given = checks.mapping("randomization", value, "a Randomization, a dict of its fields or None")
        names = [field.name for field in fields(cls)]
        return cls(**{checks.choice("randomized quantity", name, names): each for name, each in given.items()})

    def _given(self) -> dict[str, Any]:  # Any: numbers and samplers
        """The fields that are not None."""
        values = ((field.name, getattr(self, field.name)) for field in fields(self))
        return {name: value for name, value in values if value is not None}

    @property
    def names(self) -> list[str]:
        """Of the values of an episode."""
        return [name for field in self._given() for name in _VALUES.get(field, (field,))]

    def draw(self, random_state: RandomState) -> dict[str, float]:
        """The values of an episode.

        Raises:
            InvalidInputError: a sampler gave an impossible value.
        """
        found = {}
        for name, value in self._given().items():
            first = np.zeros(len(_BASE)) if name == "base_pose" else None
            found.update(_values_by_name(name, constant_or_sampler(name, value)(first, None, random_state)))
            if name == "camera":
                direction = np.asarray(random_state.normal(size=len(_CAMERA)))
                direction /= max(float(np.linalg.norm(direction)), 1e-12)
                found.update(zip(_CAMERA, direction.tolist(), strict=True))
        return found

    def replayed(self, values: object) -> dict[str, float]:
        """Values that `draw` gave before, checked.

        Raises:
            InvalidInputError: not such values.
        """
        given, names = checks.mapping("randomization", values, "a dict, as info has it"), self.names
        found = {
            checks.choice("randomized quantity", name, names): check_value(name, value) for name, value in given.items()
        }
        missing = set(names) - set(found)
        if missing:
            raise InvalidInputError(f"randomization lacks {', '.join(sorted(missing))}")
        return found


def _distribution(name: str, arguments: Mapping[str, Any]) -> Uniform | Normal:
    """The distribution that takes these arguments.

    Raises:
        InvalidInputError: the arguments of none.
    """
    for kind in (Uniform, Normal):
        if set(arguments) <= {field.name for field in fields(kind)}:
            return kind(**arguments)
    raise InvalidInputError(
        f"{name} must be a number, a sampler, or its arguments (low, high or loc, scale, and single_sample), got "
        f"{checks.shown(dict(arguments))}"
    )


def _values_by_name(name: str, value: ArrayLike) -> dict[str, float]:
    """The values that a number means, or four for the pose of the base, by name.

    Raises:
        InvalidInputError: not such numbers, or impossible ones.
    """
    names = _BASE if name == "base_pose" else (name,)
    expected = "a number" if len(names) == 1 else f"one number or {len(names)}"
    numbers = checks.array(name, value, expected)
    if numbers.size != 1 and numbers.shape != (len(names),):
        raise InvalidInputError(f"{name} must be {expected}, got shape {numbers.shape}")
    each = np.broadcast_to(numbers.ravel(), len(names)).tolist()
    return {key: check_value(key, number) for key, number in zip(names, each, strict=True)}


def check_value(name: str, value: object) -> float:
    """Check that physics allows a value.

    Raises:
        InvalidInputError: not a number, negative, or too large.
    """
    number = checks.number(name, value)
    if name in FACTORS and not 0.0 < number <= _LARGEST_FACTOR:
        raise InvalidInputError(f"{name} must be a factor above 0 and at most {_LARGEST_FACTOR:g}, got {number:g}")
    if name == "camera" and number > MAX_SHIFT:
        raise InvalidInputError(f"camera must be at most {MAX_SHIFT:g} m, got {number:g}")
    if name in (*_BASE, *_CAMERA):
        largest = {"base_yaw": math.pi}.get(name, MAX_SHIFT if name in _BASE else 1.0)
        if abs(number) > largest:
            raise InvalidInputError(f"{name} must be at most {largest:.4g} in magnitude, got {number:g}")
    elif number < 0.0:
        raise InvalidInputError(f"{name} must not be negative, got {number:g}")
    if name == "latency" and number > MAX_LATENCY:
        raise InvalidInputError(f"latency must be at most {MAX_LATENCY:g} s, got {number:g}")
    return number


def latency_steps(values: Mapping[str, float]) -> int:
    """The latency in control steps."""
    return round(values.get("latency", 0.0) / CONTROL_TIMESTEP)


SIMULATED = (
    *("geom_friction", "body_mass", "body_inertia", "actuator_gainprm", "actuator_biasprm", "dof_damping"),
    *("body_pos", "body_quat", "cam_pos"),
)
"""What a `Variation` changes of a model that `mujoco.MjData` depends on; constants that follow from it change too."""


class Variation:
    """Applies values to a model, starting from what it was like at first."""

    def __init__(self, model: mujoco.MjModel, base: int) -> None:
        """Remember the model.

        Args:
            model: the model.
            base: id of the body that carries the arm.
        """
        self._model = model
        self._base = base
        self._scratch = mujoco.MjData(model)
        self._at_first: dict[str, Array] = {name: getattr(model, name).copy() for name in (*SIMULATED, "light_diffuse")}
        free = model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
        self._free_bodies = np.asarray(free, dtype=np.intp)
        hinges = model.jnt_type != mujoco.mjtJoint.mjJNT_FREE
        self._dofs = np.asarray(model.jnt_dofadr[hinges], dtype=np.intp)
        self._camera = int(model.camera(CAMERA).id)
        self._appliers: dict[str, Callable[[float], None]] = {
            "friction": lambda factor: self._scale("geom_friction", factor, (slice(None), 0)),
            "mass": self._scale_mass,
            "gains": self._scale_gains,
            "damping": lambda factor: self._scale("dof_damping", factor, self._dofs),
            "lights": lambda factor: self._scale("light_diffuse", factor, slice(None)),
        }

    def apply(self, values: Mapping[str, float]) -> None:
        """Give the model these values, and its first ones otherwise."""
        for name, array in self._at_first.items():
            getattr(self._model, name)[:] = array
        for name, factor in values.items():
            if name in self._appliers:
                self._appliers[name](factor)
        if "camera" in values:
            self._model.cam_pos[self._camera] += values["camera"] * np.array([values[name] for name in _CAMERA])
        if _BASE[0] in values:
            x, y, z, yaw = (values[name] for name in _BASE)
            turn = np.array((math.cos(yaw / 2.0), 0.0, 0.0, math.sin(yaw / 2.0)))
            self._model.body_pos[self._base] += x, y, z
            self._model.body_quat[self._base] = quaternion_product(turn, self._model.body_quat[self._base])
        mujoco.mj_setConst(self._model, self._scratch)

    def _scale(self, name: str, factor: float, where: object) -> None:
        getattr(self._model, name)[where] *= factor

    def _scale_mass(self, factor: float) -> None:
        self._scale("body_mass", factor, self._free_bodies)
        self._scale("body_inertia", factor, self._free_bodies)

    def _scale_gains(self, factor: float) -> None:
        self._scale("actuator_gainprm", factor, (slice(None), 0))
        self._scale("actuator_biasprm", factor, (slice(None), 2))
