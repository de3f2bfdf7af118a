"""The options of an observable: their types, and the checks of their values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, UnknownNameError, shown
from jacokin.model import checks
from jacokin.mujoco_bridge import distributions

RandomState = np.random.RandomState | np.random.Generator | None
Steps = int | distributions.Sampler  # physics steps, or a sampler of them
Aggregator = Callable[[NDArray[Any]], ArrayLike]  # (buffer_size, ...) -> one observation
Corruptor = Callable[..., ArrayLike]  # corruptor(value, random_state=...) -> value

AGGREGATORS: Mapping[str, Aggregator] = {
    "min": partial(np.min, axis=0),
    "max": partial(np.max, axis=0),
    "mean": partial(np.mean, axis=0),
    "median": partial(np.median, axis=0),
    "sum": partial(np.sum, axis=0),
}


class UnknownObservableError(UnknownNameError, KeyError):
    """An observable, option or aggregator of this name does not exist; also a ``KeyError``."""

    __str__ = Exception.__str__  # KeyError would print the message in quotes


class Options(TypedDict, total=False):
    """The options of every observable; see ``observable.Observable``."""

    update_interval: Steps
    buffer_size: int | None
    delay: Steps | None
    aggregator: str | Aggregator | None
    corruptor: Corruptor | None
    enabled: bool


class CameraOptions(Options, total=False):
    """The options of a camera observable; see ``cameras.MJCFCamera``."""

    height: int
    width: int


def _check_steps(name: str, value: object, lowest: int) -> Steps:
    if not callable(value):
        return checks.whole_number(name, value, lowest)
    distributions.sampler(name, value)
    return value  # a sampler of whole numbers, which are checked when they are drawn


def _check_aggregator(name: str, value: object) -> str | Aggregator | None:
    if isinstance(value, str) and value not in AGGREGATORS:
        raise UnknownObservableError(name, value, AGGREGATORS)
    return value if isinstance(value, str) else _check_callable(name, value)


def _check_callable(name: str, value: object) -> Callable[..., Any] | None:
    if value is not None and not callable(value):
        raise InvalidInputError(f"{name} must be None or callable, got {shown(value)}")
    return value


# The check of each option, called when it is set: check(name, value) -> value.
CHECKS: Mapping[str, Callable[[str, object], object]] = {
    "update_interval": lambda name, value: _check_steps(name, value, 1),
    "buffer_size": lambda name, value: None if value is None else checks.whole_number(name, value, 1),
    "delay": lambda name, value: None if value is None else _check_steps(name, value, 0),
    "aggregator": _check_aggregator,
    "corruptor": _check_callable,
    "enabled": checks.flag,
}
CAMERA_CHECKS: Mapping[str, Callable[[str, object], object]] = {
    **CHECKS,
    "height": lambda name, value: checks.whole_number(name, value, 1),
    "width": lambda name, value: checks.whole_number(name, value, 1),
}
