"""Random values for initial states and for the timing of observables, drawn from a random state.

A sampler is a callable ``f(initial_value, current_value, random_state)``: what the value was at first, what it is now,
and the source of random numbers. ``f(random_state)`` is accepted too. The classes here are samplers.
"""

from __future__ import annotations

import inspect
import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks

RandomState = np.random.RandomState | np.random.Generator
Sampler = Callable[..., ArrayLike]

__all__ = [
    "IDENTITY_QUATERNION",
    "Normal",
    "QuaternionFromAxisAngle",
    "Sampler",
    "Uniform",
    "UniformQuaternion",
    "constant_or_sampler",
    "sampler",
    "uniform_box",
]

IDENTITY_QUATERNION = checks.read_only((1.0, 0.0, 0.0, 0.0))
"""No rotation, wxyz."""

_ARGUMENTS = ("initial_value", "current_value", "random_state")


def _drawn(
    function: Sampler,
    arguments: tuple[str, ...],
    by_name: bool,
    initial_value: object,
    current_value: object,
    random_state: RandomState | None,
) -> ArrayLike:
    """What a user's function of some of these arguments draws."""
    given = dict(zip(_ARGUMENTS, (initial_value, current_value, random_state), strict=True))
    values = {name: given[name] for name in arguments}
    return function(**values) if by_name else function(*values.values())


def _constant(value: ArrayLike, initial_value: object, current_value: object, random_state: object) -> ArrayLike:
    return value


def sampler(name: str, function: Sampler) -> Sampler:
    """A callable of (initial_value, current_value, random_state) that calls a user's function.

    Args:
        name: of the argument, for messages.
        function: takes these three by name or position, or the random state alone.

    Raises:
        InvalidInputError: the function takes other arguments, or none, or the name is not a string.
    """
    checks.text("name", name)
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        raise InvalidInputError(
            f"{name}: Python cannot tell the arguments of {shown(function)}; wrap it, as in lambda random_state: ..."
        ) from None
    for by_name, arguments in itertools.product((True, False), (_ARGUMENTS, _ARGUMENTS[-1:])):
        try:
            signature.bind(**dict.fromkeys(arguments)) if by_name else signature.bind(*arguments)
        except TypeError:
            continue
        return partial(_drawn, function, arguments, by_name)
    raise InvalidInputError(
        f"{name} must take (initial_value, current_value, random_state), or (random_state), so that a seed determines "
        f"what it returns; got a callable of {signature}"
    )


def constant_or_sampler(name: str, value: ArrayLike | Sampler) -> Sampler:
    """A callable of (initial_value, current_value, random_state) that returns the value, or draws it from a sampler.

    Raises:
        InvalidInputError: a callable with other arguments than a sampler's.
    """
    return sampler(name, value) if callable(value) else partial(_constant, value)


class _Distribution:
    """A distribution of numbers: one sample for each number of the initial value, or as many as its parameters have."""

    single_sample: bool

    def __call__(
        self,
        initial_value: ArrayLike | None = None,
        current_value: object = None,
        random_state: RandomState | None = None,
    ) -> Array | float:
        """Draw from the random state.

        Args:
            initial_value: its shape is that of the sample, unless there is none or with ``single_sample``.
            current_value: not used.
            random_state: the source of random numbers.

        Raises:
            InvalidInputError: there is no random state, or the parameters do not fit the shape of the initial value.
        """
        state = check_random_state(random_state)
        size = None if self.single_sample or initial_value is None else np.shape(initial_value)
        try:
            return self._draw(state, size)
        except (ValueError, OverflowError) as error:  # an overflow of bounds that are too far apart
            wanted = "" if size is None else f" for numbers of shape {size}"
            raise InvalidInputError(f"{self} cannot be drawn{wanted}: {error}") from error

    def _draw(self, random_state: RandomState, size: tuple[int, ...] | None) -> Array | float:
        raise NotImplementedError

    def _checked(self, first: str, second: str) -> tuple[Array, Array]:
        """The two parameters of these names."""
        checks.flag("single_sample", self.single_sample)
        a, b = _finite(self, first), _finite(self, second)
        try:
            np.broadcast_shapes(a.shape, b.shape)
        except ValueError:
            raise InvalidInputError(
                f"{first} and {second} must fit together, got shapes {a.shape} and {b.shape}"
            ) from None
        return a, b


@dataclass(frozen=True)
class Uniform(_Distribution):
    """Uniform between two bounds.

    Attributes:
        low: lower bound, a number or an array.
        high: upper bound, a number or an array.
        single_sample: draw in the shape of the bounds, whatever the shape of the initial value.
    """

    low: ArrayLike = 0.0
    high: ArrayLike = 1.0
    single_sample: bool = False

    def __post_init__(self) -> None:
        """Check the bounds."""
        low, high = self._checked("low", "high")
        if (low > high).any():
            raise InvalidInputError(f"low must not be above high, got {low.tolist()} and {high.tolist()}")

    def _draw(self, random_state: RandomState, size: tuple[int, ...] | None) -> Array | float:
        return random_state.uniform(np.asarray(self.low, float), np.asarray(self.high, float), size)


@dataclass(frozen=True)
class Normal(_Distribution):
    """Normal with a mean and a standard deviation.

    Attributes:
        loc: mean, a number or an array.
        scale: standard deviation, a number or an array.
        single_sample: draw in the shape of the parameters, whatever the shape of the initial value.
    """

    loc: ArrayLike = 0.0
    scale: ArrayLike = 1.0
    single_sample: bool = False

    def __post_init__(self) -> None:
        """Check the parameters."""
        _, scale = self._checked("loc", "scale")
        if (scale < 0.0).any():
            raise InvalidInputError(f"scale must not be negative, got {shown(self.scale)}")

    def _draw(self, random_state: RandomState, size: tuple[int, ...] | None) -> Array | float:
        return random_state.normal(np.asarray(self.loc, float), np.asarray(self.scale, float), size)


@dataclass(frozen=True)
class QuaternionFromAxisAngle:
    """Rotation about an axis by an angle that may be drawn; a quaternion (4,) wxyz.

    Attributes:
        axis: (3,) of any length but 0.
        angle: [rad], or a sampler such as ``Uniform(0, 2 * pi, single_sample=True)``.
    """

    axis: ArrayLike
    angle: float | Sampler

    def __post_init__(self) -> None:
        """Check the axis."""
        if not np.linalg.norm(checks.vector("axis", self.axis, 3, "")) > 0.0:
            raise InvalidInputError(f"axis must not be zero, got {shown(self.axis)}")
        _finite(self, "axis")
        if not callable(self.angle):
            checks.number("angle", self.angle, "rad")
        constant_or_sampler("angle", self.angle)

    def __call__(
        self, initial_value: object = None, current_value: object = None, random_state: RandomState | None = None
    ) -> Array:
        """Draw the angle.

        Raises:
            InvalidInputError: the angle drawn is not a number.
        """
        drawn = constant_or_sampler("angle", self.angle)(initial_value, current_value, random_state)
        angle = checks.vector("angle", np.reshape(drawn, -1), 1, "rad")[0]
        axis = checks.vector("axis", self.axis, 3, "")
        quat_wxyz = np.empty(4)
        mujoco.mju_axisAngle2Quat(quat_wxyz, axis / np.linalg.norm(axis), angle)
        return quat_wxyz


@dataclass(frozen=True)
class UniformQuaternion:
    """Any orientation, uniformly; a quaternion (4,) wxyz."""

    def __call__(
        self, initial_value: object = None, current_value: object = None, random_state: RandomState | None = None
    ) -> Array:
        """Draw three numbers (Shoemake, Uniform random rotations, Graphics Gems III, 1992)."""
        u, first, second = check_random_state(random_state).uniform((0.0, 0.0, 0.0), (1.0, 2.0 * np.pi, 2.0 * np.pi))
        inner, outer = np.sqrt(1.0 - u), np.sqrt(u)
        return np.array((inner * np.sin(first), inner * np.cos(first), outer * np.sin(second), outer * np.cos(second)))


def uniform_box(lower: ArrayLike, upper: ArrayLike) -> Uniform:
    """A sampler of positions (3,) [m], uniform between two corners.

    Raises:
        InvalidInputError: malformed corners, or lower above upper.
    """
    low, high = check_corners(lower, upper)
    return Uniform(checks.read_only(low), checks.read_only(high), single_sample=True)


def check_corners(lower: ArrayLike, upper: ArrayLike) -> tuple[Array, Array]:
    """The lower and the upper corner (3,) of a box [m].

    Raises:
        InvalidInputError: malformed corners, or lower above upper.
    """
    low, high = checks.vector("lower", lower, 3, "m"), checks.vector("upper", upper, 3, "m")
    if (low > high).any():
        raise InvalidInputError(f"lower must not be above upper, got {low.tolist()} and {high.tolist()}")
    return low, high


def check_random_state(random_state: object) -> RandomState:
    """A source of random numbers, or an error that says what was given instead.

    Raises:
        InvalidInputError: neither a `numpy.random.RandomState` nor a `numpy.random.Generator`.
    """
    if not isinstance(random_state, RandomState):
        raise checks.refusal("random_state", "a numpy.random.RandomState or numpy.random.Generator", random_state)
    return random_state


def _finite(distribution: object, name: str) -> Array:
    """A parameter as an array; the distribution keeps it as numbers, which compare, and which JSON can write."""
    array = checks.array(name, getattr(distribution, name), "numbers")
    if not np.isfinite(array).all():
        raise InvalidInputError(f"{name} must be finite, got {array.tolist()}")
    object.__setattr__(distribution, name, _as_tuples(array))
    return array


def _as_tuples(array: Array) -> Any:  # Any: floats, or tuples of them nested as deep as the array
    return array.item() if array.ndim == 0 else tuple(map(_as_tuples, array))
