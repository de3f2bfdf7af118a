"""Time passed by ticks, for the tests of both drivers."""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array
from jacokin.twin import KinovaDriver, TrajectoryController, TwinGoal

HALF_DEGREE = np.radians(0.5)


def pass_time(driver: KinovaDriver | TrajectoryController, seconds: float) -> None:
    for _ in range(round(seconds / 0.01)):
        driver.tick()


def wait(driver: KinovaDriver | TrajectoryController, goal: TwinGoal, patience: float = 20.0) -> float:
    """Until a goal ends; returns when that was [s]."""
    begun = driver.arm.state.time
    while not goal.has_ended:
        assert driver.arm.state.time - begun < patience
        driver.tick()
    return driver.arm.state.time - begun


def away(driver: KinovaDriver | TrajectoryController, q: Array) -> float:
    return float(np.abs(driver.arm.state.q - q).max())
