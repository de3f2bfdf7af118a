"""What may differ between episodes beside the initial state: masses, friction, gains, delays, noise, lights."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields

import mujoco
import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.mujoco_bridge.base import RandomState
from jacokin.mujoco_bridge.distributions import Sampler, constant_or_sampler
from jacokin.tasks.task import CAMERA, CONTROL_TIMESTEP

Choice = float | Sampler | None

FACTORS = ("friction", "mass", "gains", "damping", "lights")
AMOUNTS = ("latency", "observation_noise", "camera")
MAX_LATENCY = 1.0  # [s]
_LARGEST_FACTOR = 1e3


@dataclass(frozen=True, slots=True)
class Randomization:
    """What is drawn at each reset: a number, a sampler such as ``Uniform(0.3, 1.2)``, or None to leave it.

    Attributes:
        friction: factor of the sliding friction of all geoms.
        mass: factor of the masses and inertias of what moves freely.
        gains: factor of the gains of the actuators, and of the damping that belongs to them.
        damping: factor of the damping of the joints of arm and hand.
        lights: factor of the brightness of lights.
        latency: delay of actions [s], rounded to control steps of 0.04 s; at most 1 s.
        observation_noise: standard deviation of normal noise on all features, in their units.
        camera: distance by which the camera is moved, in a direction that is drawn too [m].
    """

    friction: Choice = None
    mass: Choice = None
    gains: Choice = None
    damping: Choice = None
    lights: Choice = None
    latency: Choice = None
    observation_noise: Choice = None
    camera: Choice = None

    def __post_init__(self) -> None:
        """Check what can be checked before anything is drawn.

        Raises:
            InvalidInputError: a number that is impossible, or something else than a number or a sampler.
        """
        for field in fields(self):
            value = getattr(self, field.name)
            if value is None:
                continue
            constant_or_sampler(field.name, value)
            if not callable(value):
                checked(field.name, value)

    def draw(self, random_state: RandomState) -> dict[str, float]:
        """The values of an episode.

        Raises:
            InvalidInputError: a sampler gave an impossible value.
        """
        found = {}
        for field in fields(self):
            value = getattr(self, field.name)
            if value is not None:
                drawn = constant_or_sampler(field.name, value)(None, None, random_state)
                found[field.name] = checked(field.name, drawn)
        if "camera" in found:
            direction = np.asarray(random_state.normal(size=3))
            direction /= max(float(np.linalg.norm(direction)), 1e-12)
            found.update({f"camera_{axis}": float(part) for axis, part in zip("xyz", direction, strict=True)})
        return found

    def replayed(self, values: object) -> dict[str, float]:
        """Values that `draw` gave before, checked.

        Raises:
            InvalidInputError: not such values.
        """
        if not isinstance(values, Mapping):
            raise InvalidInputError(f"randomization must be a dict, as info has it, got {checks.shown(values)}")
        valid = [field.name for field in fields(self) if getattr(self, field.name) is not None]
        directions = ["camera_x", "camera_y", "camera_z"] if self.camera is not None else []
        found = {}
        for name, value in values.items():
            checks.choice("randomized quantity", name, (*valid, *directions))
            found[name] = checks.number(name, value) if name in directions else checked(name, value)
        missing = set(valid) | set(directions)
        missing -= set(found)
        if missing:
            raise InvalidInputError(f"randomization lacks {', '.join(sorted(missing))}")
        return found


def checked(name: str, value: object) -> float:
    """A value that physics allows.

    Raises:
        InvalidInputError: not a number, negative, or too large.
    """
    number = checks.number(name, np.asarray(value).item() if np.size(value) == 1 else value)  # type: ignore[arg-type]  # `number` checks
    if name in FACTORS and not 0.0 < number <= _LARGEST_FACTOR:
        raise InvalidInputError(f"{name} must be a factor above 0 and at most {_LARGEST_FACTOR:g}, got {number:g}")
    if number < 0.0:
        raise InvalidInputError(f"{name} must not be negative, got {number:g}")
    if name == "latency" and number > MAX_LATENCY:
        raise InvalidInputError(f"latency must be at most {MAX_LATENCY:g} s, got {number:g}")
    return number


def steps_of(values: Mapping[str, float]) -> int:
    """The latency in control steps."""
    return round(values.get("latency", 0.0) / CONTROL_TIMESTEP)


class Variation:
    """Applies values to a model, starting from what it was like at first."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Remember the model."""
        self._model = model
        self._scratch = mujoco.MjData(model)
        arrays = (
            *("geom_friction", "body_mass", "body_inertia", "actuator_gainprm", "actuator_biasprm", "dof_damping"),
            *("light_diffuse", "cam_pos"),
        )
        self._at_first: dict[str, Array] = {name: getattr(model, name).copy() for name in arrays}
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
            direction = np.array([values[f"camera_{axis}"] for axis in "xyz"])
            self._model.cam_pos[self._camera] += values["camera"] * direction
        mujoco.mj_setConst(self._model, self._scratch)

    def _scale(self, name: str, factor: float, where: object) -> None:
        getattr(self._model, name)[where] *= factor

    def _scale_mass(self, factor: float) -> None:
        self._scale("body_mass", factor, self._free_bodies)
        self._scale("body_inertia", factor, self._free_bodies)

    def _scale_gains(self, factor: float) -> None:
        self._scale("actuator_gainprm", factor, (slice(None), 0))
        self._scale("actuator_biasprm", factor, (slice(None), 2))
