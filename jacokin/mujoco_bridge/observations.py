"""Settings of observables by category: which are enabled, with which options.

The categories are ``proprio`` (joint positions and velocities, pose of the hand), ``ftt`` (force,
torque and touch), ``prop_pose`` (poses and velocities of free props) and ``camera``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks
from jacokin.model.angles import nearest_copy, wrap_to_turn
from jacokin.mujoco_bridge.distributions import RandomState
from jacokin.mujoco_bridge.observables import Aggregator, Corruptor, Steps


class ObservableSpec(NamedTuple):
    """Options of an observable; see ``observables.Observable``."""

    enabled: bool
    update_interval: Steps  # [physics steps]
    buffer_size: int | None
    delay: Steps | None  # [physics steps]
    aggregator: str | Aggregator | None
    corruptor: Corruptor | None


class CameraObservableSpec(NamedTuple):
    """Options of a camera observable; see ``cameras.MJCFCamera``."""

    height: int  # [pixels]
    width: int  # [pixels]
    enabled: bool
    update_interval: Steps  # [physics steps]
    buffer_size: int | None
    delay: Steps | None  # [physics steps]
    aggregator: str | Aggregator | None
    corruptor: Corruptor | None


class ObservationSettings(NamedTuple):
    """The options of each category of observables."""

    proprio: ObservableSpec
    ftt: ObservableSpec
    prop_pose: ObservableSpec
    camera: CameraObservableSpec


class ObservableNames(NamedTuple):
    """The names of an entity's observables, by category."""

    proprio: tuple[str, ...] = ()
    ftt: tuple[str, ...] = ()
    prop_pose: tuple[str, ...] = ()
    camera: tuple[str, ...] = ()


def symmetric_log(value: ArrayLike, random_state: RandomState | None = None) -> NDArray[np.float64]:
    """Return sign(x) log(1 + abs(x)): large and small forces and torques on one scale.

    Args:
        value: readings of any shape.
        random_state: unused; corruptors are called with it.

    Raises:
        InvalidInputError: value is not made of real numbers.
    """
    x = checks.array("value", value, "numbers")
    return np.asarray(np.copysign(np.log1p(np.abs(x)), x))


_FEATURE = ObservableSpec(enabled=True, update_interval=1, buffer_size=1, delay=0, aggregator=None, corruptor=None)
_FORCE = _FEATURE._replace(corruptor=symmetric_log)
_CAMERA = CameraObservableSpec(height=84, width=84, **_FEATURE._asdict())

PERFECT_FEATURES = ObservationSettings(
    proprio=_FEATURE, ftt=_FORCE, prop_pose=_FEATURE, camera=_CAMERA._replace(enabled=False)
)
"""All measurements, no camera."""

VISION = ObservationSettings(proprio=_FEATURE, ftt=_FORCE, prop_pose=_FEATURE._replace(enabled=False), camera=_CAMERA)
"""Cameras instead of the props' poses."""

JACO_ARM_OBSERVABLES = ObservableNames(proprio=("joints_pos", "joints_vel"), ftt=("joints_torque",))
JACO_HAND_OBSERVABLES = ObservableNames(proprio=("joints_pos", "joints_vel", "pinch_site_pos", "pinch_site_rmat"))
TWO_FINGER_HAND_OBSERVABLES = ObservableNames(proprio=("joints_pos", "joints_vel", "grip_site_pos", "grip_site_rmat"))
FREEPROP_OBSERVABLES = ObservableNames(prop_pose=("position", "orientation", "linear_velocity", "angular_velocity"))


def make_options(obs_settings: ObservationSettings, obs_names: ObservableNames) -> dict[str, dict[str, object]]:
    """Return ``{observable: {option: value}}``, as ``Observables.set_options`` takes it.

    Args:
        obs_settings: the options of each category.
        obs_names: the names of the observables in each category.

    Raises:
        InvalidInputError: an argument has another type.
    """
    checks.instance("obs_settings", obs_settings, ObservationSettings, "ObservationSettings")
    checks.instance("obs_names", obs_names, ObservableNames, "ObservableNames")
    return {
        name: spec._asdict()
        for category, spec in obs_settings._asdict().items()
        for name in getattr(obs_names, category)
    }


def sin_cos(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pairs (sin, cos) of checked angles (...) [rad], (..., 2); `angles_from_sin_cos` undoes it."""
    pairs = np.empty((*angles.shape, 2))
    np.sin(angles, out=pairs[..., 0])
    np.cos(angles, out=pairs[..., 1])
    return pairs


def angles_from_sin_cos(sin_cos: ArrayLike, near: ArrayLike | None = None) -> NDArray[np.float64]:
    """Return the joint angles of (sin, cos) pairs.

    A pair determines an angle up to full turns. The angle in [0, 2 pi) is returned, where the ranges of joints 2 and
    3 lie, and to which ``set_site_to_xpos`` wraps the joints without limits.

    Args:
        sin_cos: pairs (..., 2), sine first; pairs of another norm than 1 are allowed.
        near: angles (...) [rad]; each result is the one nearest to its own of these, up to full turns.

    Returns:
        Angles (...) [rad].

    Raises:
        InvalidInputError: a wrong shape, a value that is not finite, or a pair (0, 0), as in a buffer padded with
            zeros.
    """
    pairs = checks.array("sin_cos", sin_cos, "pairs of numbers (..., 2)")
    reference = None if near is None else checks.array("near", near, "angles (...)", "rad")
    if pairs.ndim < 1 or pairs.shape[-1] != 2:
        raise InvalidInputError(f"sin_cos must have the shape (..., 2), got {pairs.shape}")
    if not np.isfinite(pairs).all():
        raise InvalidInputError("sin_cos must be finite")
    if not pairs.any(axis=-1).all():
        raise InvalidInputError("sin_cos contains a pair (0, 0), which has no angle")
    angles = np.arctan2(pairs[..., 0], pairs[..., 1])
    if reference is None:
        return wrap_to_turn(angles)
    if not np.isfinite(reference).all() or reference.shape != angles.shape:
        raise InvalidInputError(f"near must be finite angles of the shape {angles.shape}, got {shown(reference)}")
    return np.asarray(nearest_copy(angles, reference))
