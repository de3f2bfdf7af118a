"""`Randomization`: masses, friction, gains, delays, noise, pushes, lights and poses that differ between episodes."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.mujoco_bridge.base import RandomState
from jacokin.mujoco_bridge.distributions import Normal, Sampler, Uniform, constant_or_sampler
from jacokin.mujoco_bridge.entity import quaternion_product
from jacokin.tasks.task import CAMERA, PHYSICS_TIMESTEP

Choice = float | Sampler | Mapping[str, Any] | None

FACTORS = (
    "friction",
    "mass",
    "gains",
    "damping",
    "lights",
    "armature",
    "dry_friction",
    "ambient",
    "field_of_view",
    "textures",
)
MAX_LATENCY = 1.0  # [s] of actions and of observations
FEATURE_NOISE, FEATURE_BIAS = "feature_noise", "feature_bias"
_BY_FEATURE = (FEATURE_NOISE, FEATURE_BIAS)  # fields with a number for each feature that is named
_LARGEST_FACTOR = 1e3
_CAMERA = ("camera_x", "camera_y", "camera_z")
_BASE = ("base_x", "base_y", "base_z", "base_yaw")
_COLOR = ("color_red", "color_green", "color_blue")
_AXIS = ("camera_axis_x", "camera_axis_y", "camera_axis_z")
ARM_PUSH, PROP_PUSH = "arm_push", "prop_push"
_JOINTS = range(1, 7)
_EACH = {  # fields with a number for each joint or actuator, or for each direction
    "base_pose": _BASE,
    "joint_offsets": tuple(f"joint_offset_{number}" for number in _JOINTS),
    "joint_gains": tuple(f"joint_gain_{number}" for number in range(1, 10)),
    "link_masses": tuple(f"link_mass_{number}" for number in _JOINTS),
}
_DIRECTIONS = {"camera": _CAMERA, "colors": _COLOR, "camera_turn": _AXIS}  # of fields that are lengths of a vector
_VALUES = {**_EACH, **{field: (field, *names) for field, names in _DIRECTIONS.items()}}
_MOST = {  # largest values, and their units
    "camera": (0.5, " m"),
    "colors": (1.0, ""),
    "camera_turn": (0.5, " rad"),
    "latency": (MAX_LATENCY, " s"),
    "observation_delay": (MAX_LATENCY, " s"),
}
_MAGNITUDES = {  # of values that may be negative: displacements [m], angles [rad], and parts of directions
    **dict.fromkeys(_BASE[:3], 0.5),
    _BASE[3]: math.pi,
    **dict.fromkeys(_EACH["joint_offsets"], 0.5),
    **dict.fromkeys((*_CAMERA, *_COLOR, *_AXIS), 1.0),
}


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
        latency: delay of actions [s], in fractions of a control step too: rounded to physics steps of 0.002 s, at
            most 1 s.
        observation_noise: standard deviation of normal noise on all features and on ``achieved_goal``, in their units;
            rewards and ``desired_goal`` are exact.
        camera: distance by which the camera is moved, in a direction that is drawn too [m]; at most 0.5 m.
        base_pose: displacement of the arm's base: x, y, z [m] and yaw about its vertical axis [rad]. One number, or a
            sampler of one, means each of the four: ``Uniform(-0.02, 0.02)`` draws four numbers.
        armature: factor of the inertia of the motors of arm and hand.
        dry_friction: factor of the dry friction in the joints of arm and hand.
        ambient: factor of the brightness of ambient light.
        field_of_view: factor of the camera's field of view.
        joint_offsets: by how much the zero of each joint of the arm is off [rad], at most 0.5: the arm stands turned
            by it where its joints are said to be, at the start of an episode too, whose angles are those without
            offsets. Six numbers, or one, or a sampler of one, for each; of seven joints, those of the first six.
        joint_gains: factors of the gains of the nine actuators, each its own, as `gains` is for all; of ten, those of
            the first nine.
        link_masses: factors of the masses and inertias of the six links of the arm; of seven, those of the first six.
        action_noise: standard deviation of normal noise on the velocities of all actuators [rad/s].
        observation_bias: standard deviation of what is added to each feature all through an episode, in its unit.
        colors: distance by which the colours of props and of the table are shifted, in a direction that is drawn too,
            0..1; not of bricks whose colours say which is which.
        observation_delay: how old an observation is [s], pictures and ``achieved_goal`` included, in fractions of a
            control step too: rounded to physics steps of 0.002 s, at most 1 s; the first of an episode until there is
            one so old. Rewards are of now.
        feature_noise: standard deviations of normal noise by the name of a feature, in its unit, such as
            ``{"duplo2x4/position": 0.005}``; "achieved_goal" may be one. Each a number, a sampler or its arguments.
        feature_bias: likewise, of what is added to a feature all through an episode, to each of its numbers its own.
        textures: factor of how many tiles of the floor there are on a metre.
        camera_turn: angle by which the camera is turned about an axis that is drawn too [rad], at most 0.5.
        arm_push: force on the centre of mass of one of the six links of the arm [N], now and then: link, direction and
            beginning of each push are drawn.
        prop_push: likewise, on one of the things that move freely. A brick weighs 0.12 N.
        push_rate: how many pushes of the arm, and of things, begin in a second, on average, while there is none [1/s];
            0.5 if None.
        push_duration: how long a push lasts [s], in whole control steps, at least one; 0.2 s if None.
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
    # Further fields come last: the numbers that a seed draws for those above stay the same.
    armature: Choice = None
    dry_friction: Choice = None
    ambient: Choice = None
    field_of_view: Choice = None
    joint_offsets: Choice | ArrayLike = None
    joint_gains: Choice | ArrayLike = None
    link_masses: Choice | ArrayLike = None
    action_noise: Choice = None
    observation_bias: Choice = None
    colors: Choice = None
    observation_delay: Choice = None
    feature_noise: Mapping[str, Choice] | None = field(default=None, hash=False)
    feature_bias: Mapping[str, Choice] | None = field(default=None, hash=False)
    textures: Choice = None
    camera_turn: Choice = None
    arm_push: Choice = None
    prop_push: Choice = None
    push_rate: Choice = None
    push_duration: Choice = None

    def __post_init__(self) -> None:
        """Check what can be checked before anything is drawn.

        Raises:
            InvalidInputError: a number that is impossible, or something else than a number or a sampler.
        """
        for name, value in self._given().items():
            if name in _BY_FEATURE:
                given = checks.mapping(name, value, "a dict of deviations by the name of a feature")
                checked = {each: _checked_deviation(name, each, choice) for each, choice in given.items()}
                object.__setattr__(self, name, checked)
                continue
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
        given = self._given()
        found = [name for field in given if field not in _BY_FEATURE for name in _VALUES.get(field, (field,))]
        return [*found, *(f"{field}/{name}" for field in _BY_FEATURE for name in given.get(field, ()))]

    def draw(self, random_state: RandomState) -> dict[str, float]:
        """The values of an episode.

        Raises:
            InvalidInputError: a sampler gave an impossible value.
        """
        found = {}
        given = self._given()
        by_feature = {field: given.pop(field, {}) for field in _BY_FEATURE}
        for name, value in given.items():
            first = np.zeros(len(_EACH[name])) if name in _EACH else None
            found.update(_values_by_name(name, constant_or_sampler(name, value)(first, None, random_state)))
            if name in _DIRECTIONS:
                direction = np.asarray(random_state.normal(size=len(_DIRECTIONS[name])))
                direction /= max(float(np.linalg.norm(direction)), 1e-12)
                found.update(zip(_DIRECTIONS[name], direction.tolist(), strict=True))
        for which, each in by_feature.items():
            for name, value in each.items():
                key = f"{which}/{name}"
                found.update(_values_by_name(key, constant_or_sampler(key, value)(None, None, random_state)))
        return found

    def scaled(self, part: float) -> Randomization:
        """This randomization with smaller ranges, for a curriculum: 0 for none, 1 for all.

        Numbers and the bounds of `Uniform` come nearer to what changes nothing (1 for factors, 0 for others), and so do
        mean and deviation of `Normal`. Give the result to an environment or a vector, `env.unwrapped.randomization`,
        between two episodes.

        Args:
            part: of each range, 0..1.

        Raises:
            InvalidInputError: not such a number, or another sampler, of which nobody knows the range.
        """
        scale = checks.number("part", part)
        if not 0.0 <= scale <= 1.0:
            raise checks.refusal("part", "in 0..1", part)
        found: dict[str, Any] = {}
        for name, value in self._given().items():
            if name in _BY_FEATURE:
                found[name] = {each: _scaled(f"{name}/{each}", choice, 0.0, scale) for each, choice in value.items()}
            else:
                neutral = 1.0 if name in (*FACTORS, "joint_gains", "link_masses") else 0.0
                found[name] = _scaled(name, value, neutral, scale)
        return Randomization(**found)

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


def _checked_deviation(field: str, feature: object, value: Any) -> Any:
    if not isinstance(feature, str):
        raise checks.refusal(field, "a dict of deviations by the name of a feature", feature)
    name = f"{field}/{feature}"
    if isinstance(value, Mapping):
        return _distribution(name, value)
    constant_or_sampler(name, value)
    return value if callable(value) else check_value(name, value)


def _scaled(name: str, value: Any, neutral: float, scale: float) -> Any:  # Any: numbers and samplers
    """A number or a sampler that is nearer to what changes nothing."""

    def nearer(number: ArrayLike) -> Any:
        return (neutral + scale * (np.asarray(number, dtype=np.float64) - neutral)).tolist()

    if isinstance(value, Uniform):
        return replace(value, low=nearer(value.low), high=nearer(value.high))
    if isinstance(value, Normal):
        return replace(value, loc=nearer(value.loc), scale=(scale * np.asarray(value.scale)).tolist())
    if callable(value):
        raise InvalidInputError(f"{name} is a sampler other than Uniform and Normal, which cannot be scaled")
    return nearer(value)


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
    names = _EACH.get(name, (name,))
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
    is_factor = name in (*FACTORS, *_EACH["joint_gains"], *_EACH["link_masses"])
    if is_factor and not 0.0 < number <= _LARGEST_FACTOR:
        raise InvalidInputError(f"{name} must be a factor above 0 and at most {_LARGEST_FACTOR:g}, got {number:g}")
    if name in _MOST and not number <= _MOST[name][0]:
        most, unit = _MOST[name]
        raise InvalidInputError(f"{name} must be at most {most:g}{unit}, got {number:g}")
    largest = _MAGNITUDES.get(name)
    if largest is None and number < 0.0:
        raise InvalidInputError(f"{name} must not be negative, got {number:g}")
    if largest is not None and abs(number) > largest:
        raise InvalidInputError(f"{name} must be at most {largest:.4g} in magnitude, got {number:g}")
    return number


def has_offsets(values: Mapping[str, float]) -> bool:
    """Whether the joints of the arm have other zeros."""
    return _EACH["joint_offsets"][0] in values


def delay(values: Mapping[str, float], name: str, substeps: int) -> tuple[int, int]:
    """A delay, "latency" or "observation_delay", in control steps, and the physics steps beyond them.

    Args:
        values: of the episode.
        name: of the delay.
        substeps: physics steps of a control step.
    """
    return divmod(round(values.get(name, 0.0) / PHYSICS_TIMESTEP), substeps)


SIMULATED = (
    *("geom_friction", "body_mass", "body_inertia", "actuator_gainprm", "actuator_biasprm", "dof_damping"),
    *("body_pos", "body_quat", "cam_pos", "cam_quat", "dof_armature", "dof_frictionloss", "cam_fovy"),
)
"""What a `Variation` changes of a model that `mujoco.MjData` depends on; constants that follow from it change too."""


_DRAWN = ("light_diffuse", "geom_rgba", "mat_texrepeat")  # and what only pictures depend on


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
        changed = [*(getattr(model, name) for name in (*SIMULATED, *_DRAWN)), model.vis.headlight.ambient]
        self._at_first: list[tuple[Array, Array]] = [(array, array.copy()) for array in changed]
        bodies = _free_bodies(model)
        dofs = np.asarray(model.jnt_dofadr[model.jnt_type != mujoco.mjtJoint.mjJNT_FREE], dtype=np.intp)
        self._joints = np.arange(len(_EACH["joint_offsets"]))  # those of the arm come first
        self._links = np.asarray(model.jnt_bodyid[self._joints], dtype=np.intp)
        self._colored = np.flatnonzero(np.isin(model.geom_bodyid, bodies) | (model.geom_bodyid == 0))
        self._camera = int(model.camera(CAMERA).id)
        every = slice(None)
        # What each factor multiplies: arrays, and where in them.
        self._scaled: dict[str, list[tuple[Array, Any]]] = {  # Any: an index of NumPy
            "friction": [(model.geom_friction, (every, 0))],
            "mass": [(model.body_mass, bodies), (model.body_inertia, bodies)],
            "gains": [(model.actuator_gainprm, (every, 0)), (model.actuator_biasprm, (every, 2))],
            "damping": [(model.dof_damping, dofs)],
            "lights": [(model.light_diffuse, every)],
            "armature": [(model.dof_armature, dofs)],
            "dry_friction": [(model.dof_frictionloss, dofs)],
            "field_of_view": [(model.cam_fovy, self._camera)],
            "ambient": [(model.vis.headlight.ambient, every)],
            "textures": [(model.mat_texrepeat, every)],
        }

    def apply(self, values: Mapping[str, float], *, is_starting: bool = False) -> None:
        """Give the model these values, and its first ones otherwise.

        Args:
            values: of the episode.
            is_starting: leave out the offsets of joints: initial angles are planned for an arm without them.
        """
        for array, first in self._at_first:
            array[:] = first
        for name, factor in values.items():
            for array, where in self._scaled.get(name, ()):
                array[where] *= factor
        self._apply_each(values, is_starting)
        if "camera" in values:
            self._model.cam_pos[self._camera] += values["camera"] * np.array([values[name] for name in _CAMERA])
        if "camera_turn" in values:
            turn = _turn(np.array([values[name] for name in _AXIS]), values["camera_turn"])
            self._model.cam_quat[self._camera] = quaternion_product(self._model.cam_quat[self._camera], turn)
        if _BASE[0] in values:
            x, y, z, yaw = (values[name] for name in _BASE)
            turn = _turn(np.array((0.0, 0.0, 1.0)), yaw)
            self._model.body_pos[self._base] += x, y, z
            self._model.body_quat[self._base] = quaternion_product(turn, self._model.body_quat[self._base])
        mujoco.mj_setConst(self._model, self._scratch)

    def _apply_each(self, values: Mapping[str, float], is_starting: bool) -> None:
        """Apply what is another number for each joint, link or colour."""
        model = self._model
        if _EACH["joint_gains"][0] in values:
            factors = np.array([values[name] for name in _EACH["joint_gains"]])[: model.nu]
            model.actuator_gainprm[: len(factors), 0] *= factors
            model.actuator_biasprm[: len(factors), 2] *= factors
        if _EACH["link_masses"][0] in values:
            factors = np.array([values[name] for name in _EACH["link_masses"]])
            model.body_mass[self._links] *= factors
            model.body_inertia[self._links] *= factors[:, None]
        if has_offsets(values) and not is_starting:
            for joint, body, name in zip(self._joints, self._links, _EACH["joint_offsets"], strict=True):
                turn = _turn(model.jnt_axis[joint], values[name])
                model.body_quat[body] = quaternion_product(model.body_quat[body], turn)
        if "colors" in values:
            shift = values["colors"] * np.array([values[name] for name in _COLOR])
            model.geom_rgba[self._colored, :3] = np.clip(model.geom_rgba[self._colored, :3] + shift, 0.0, 1.0)


def _turn(axis: Array, angle: float) -> Array:
    """The quaternion (4,) wxyz of a turn about a unit vector (3,) [rad]."""
    return np.concatenate(((math.cos(angle / 2.0),), math.sin(angle / 2.0) * axis))


def _free_bodies(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Ids of the bodies that move freely."""
    return np.asarray(model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE], dtype=np.intp)


class Pushes:
    """Forces on links of the arm, and on what moves freely, that come and go."""

    def __init__(self, model: mujoco.MjModel, dt: float) -> None:
        """Find what may be pushed.

        Args:
            model: the model, the joints of the arm first.
            dt: control step [s].
        """
        links = model.jnt_bodyid[: len(_EACH["joint_offsets"])]
        self._bodies = {ARM_PUSH: np.asarray(links, dtype=np.intp), PROP_PUSH: _free_bodies(model)}
        self._dt = dt

    @property
    def none(self) -> NDArray[np.intp]:
        """For how many control steps the push of each kind goes on, at the start of an episode."""
        return np.zeros(len(self._bodies), dtype=np.intp)

    def advance(
        self, values: Mapping[str, float], left: NDArray[np.intp], forces: Array, random_state: np.random.Generator
    ) -> None:
        """Begin and end pushes, before a control step.

        Args:
            values: of the episode.
            left: for how many control steps the push of each kind goes on; changed in place.
            forces: (nbody, 6) MuJoCo's forces on bodies; changed in place.
            random_state: where pushes come from.
        """
        begins = values.get("push_rate", 0.5) * self._dt  # [1/s]
        steps = max(1, round(values.get("push_duration", 0.2) / self._dt))  # [s]
        for kind, (name, bodies) in enumerate(self._bodies.items()):
            if name not in values or not len(bodies):
                continue
            if left[kind]:
                left[kind] -= 1
            if left[kind]:
                continue
            forces[bodies, :3] = 0.0
            if random_state.uniform() < begins:
                direction = random_state.normal(size=3)
                body = bodies[random_state.integers(len(bodies))]
                forces[body, :3] = values[name] * direction / max(float(np.linalg.norm(direction)), 1e-12)
                left[kind] = steps


def has_pushes(names: Collection[str]) -> bool:
    """Whether something is pushed, by the names of values."""
    return ARM_PUSH in names or PROP_PUSH in names
