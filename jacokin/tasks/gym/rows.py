"""Observations of many environments: an array or a dictionary of arrays, in which each environment has a row."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import create_empty_array

from jacokin.tasks.gym.packing import Observation


def zeros(space: spaces.Space[Any], count: int) -> Observation:
    """Room for the observations of so many environments."""
    return cast(Observation, create_empty_array(space, count))


def row(observations: Observation, index: int) -> Observation:
    """The observation of one environment: views."""
    if isinstance(observations, np.ndarray):
        return np.asarray(observations[index])
    return {name: value[index] for name, value in observations.items()}


def put(observations: Observation, index: int, observation: Observation) -> None:
    """Write the observation of one environment."""
    if isinstance(observations, np.ndarray):
        observations[index] = np.asarray(observation)
    else:
        for name, value in cast(Mapping[str, Any], observation).items():
            observations[name][index] = value


def copied(observations: Observation) -> Observation:
    """The same in new arrays."""
    if isinstance(observations, np.ndarray):
        return observations.copy()
    return {name: value.copy() for name, value in observations.items()}
