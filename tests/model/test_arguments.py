"""Whatever a public callable of the model gets, it answers or raises one of the package's own errors."""

from __future__ import annotations

import datetime
import decimal
import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin import JacokinError, Robot
from jacokin.model import ContactObserver, SelfContact, quat_wxyz, to_mujoco


class Unprintable:
    def __repr__(self) -> str:
        raise RuntimeError("no repr")

    def __array__(self, *_: object, **__: object) -> np.ndarray[Any, Any]:
        raise RuntimeError("no array")


VALUES: list[Any] = [
    None, True, np.True_, -1, 10**400, np.nan, np.inf, "x", b"1", 1j, [], [1], [1] * 6, [True] * 6, ["1"] * 6,
    np.ones(6), np.ones(5), np.ones((6, 1)), np.ones((2, 6)), np.full(6, np.nan), np.ma.masked, np.ma.ones(6),
    [np.ma.masked] * 6, np.datetime64("2020-01-01"), datetime.date(2020, 1, 1), [decimal.Decimal(1)] * 6, {}, {"a": 1},
    {"joint_1": 1}, {3: (1, 2)}, set(), object(), Unprintable(), [Unprintable()] * 6, np.array([1] * 6, dtype=object),
    np.eye(4), 2.0 * np.eye(3), np.random.RandomState(0), "link_3", Path(), Path("/dev/null"), range(6), [[1], [2, 3]],
    float, np.array("link_3"), [1e308] * 6, 10**5000, NotImplemented, np.timedelta64(5, "s"), "\ud800", "a\0b",
    np.zeros(6, dtype=[("a", float)]),
]  # fmt: skip

contact_of = functools.cache(SelfContact)


def observer_of(robot: Robot) -> ContactObserver:
    observer = ContactObserver(robot, 1.0)
    observer.step(robot.home, np.zeros(6), np.zeros(6), 0.01)
    return observer


CALLS: dict[str, Callable[[Robot, Any], object]] = {
    "forward_kinematics": lambda robot, x: robot.forward_kinematics(x),
    "frame": lambda robot, x: robot.forward_kinematics(robot.home, x),
    "jacobian": lambda robot, x: robot.jacobian(x),
    "reference": lambda robot, x: robot.jacobian(robot.home, reference=x),
    "velocity": lambda robot, x: robot.jacobian_time_derivative(robot.home, x),
    "representation": lambda robot, x: robot.analytical_jacobian(robot.home, representation=x),
    "mass_matrix": lambda robot, x: robot.mass_matrix(x),
    "gravity": lambda robot, x: robot.gravity(x),
    "base of gravity": lambda robot, x: robot.gravity(robot.home, base=x),
    "coriolis": lambda robot, x: robot.coriolis(robot.home, x),
    "inverse_dynamics": lambda robot, x: robot.inverse_dynamics(robot.home, x, np.zeros(6)),
    "acceleration": lambda robot, x: robot.inverse_dynamics(robot.home, np.zeros(6), x),
    "external": lambda robot, x: robot.inverse_dynamics(robot.home, np.zeros(6), np.zeros(6), external=x),
    "forward_dynamics": lambda robot, x: robot.forward_dynamics(robot.home, np.zeros(6), x),
    "centre_of_mass": lambda robot, x: robot.centre_of_mass(x),
    "operational_space_inertia": lambda robot, x: robot.operational_space_inertia(x),
    "external_wrench": lambda robot, x: robot.external_wrench(robot.home, np.zeros(6), np.zeros(6), x),
    "torque_covariance": lambda robot, x: robot.external_wrench(
        robot.home, np.zeros(6), np.zeros(6), np.zeros(6), torque_covariance=x
    ),
    "mass": lambda robot, x: robot.with_payload(x, [0, 0, 0]),
    "com": lambda robot, x: robot.with_payload(1.0, x),
    "inertia": lambda robot, x: robot.with_payload(1.0, [0, 0, 0], x),
    "threshold": lambda robot, x: ContactObserver(robot, x),
    "velocity of an observer": lambda robot, x: ContactObserver(robot, 1.0).step(robot.home, x, np.zeros(6), 0.01),
    "time of an observer": lambda robot, x: observer_of(robot).step(robot.home, np.ones(6), np.zeros(6), x),
    "torque of an observer": lambda robot, x: observer_of(robot).step(robot.home, np.ones(6), x, 0.01),
    "within_limits": lambda robot, x: robot.within_limits(x),
    "tolerance": lambda robot, x: robot.within_limits(robot.home, x),
    "rng": lambda robot, x: robot.sample(x),
    "size": lambda robot, x: robot.sample(np.random.default_rng(0), x),
    "name": lambda robot, x: robot.configuration([0.1], name=x),
    "joint": lambda robot, x: robot.joint_index(x),
    "robot": lambda _, x: jacokin.load_robot(x),
    "base": lambda _, x: jacokin.load_robot(base=x),
    "tip": lambda _, x: jacokin.load_robot(tip=x),
    "finger_angle": lambda _, x: jacokin.load_robot(finger_angle=x),
    "limits": lambda _, x: jacokin.load_robot(limits=x),
    "limit": lambda _, x: jacokin.load_robot(limits={"joint_2": x}),
    "package_dirs": lambda _, x: jacokin.load_robot(package_dirs=x),
    "robot_a": lambda _, x: jacokin.crosscheck(x, samples=1),
    "robot_b": lambda robot, x: jacokin.crosscheck(robot, x, samples=1),
    "samples": lambda robot, x: jacokin.crosscheck(robot, robot, samples=x),
    "rng of crosscheck": lambda robot, x: jacokin.crosscheck(robot, robot, rng=x, samples=1),
    "joint_map": lambda robot, x: jacokin.crosscheck(robot, robot, joint_map=x, samples=1),
    "frame_map": lambda robot, x: jacokin.crosscheck(robot, robot, frame_map=x, samples=1),
    "tolerances": lambda robot, x: jacokin.crosscheck(robot, robot, samples=1).within(x),
    "quantity": lambda robot, x: jacokin.crosscheck(robot, robot, samples=1).worst(x),
    "position": lambda _, x: jacokin.pose(x),
    "quat_wxyz": lambda _, x: jacokin.pose([0, 0, 0], x),
    "rpy": lambda _, x: jacokin.pose([0, 0, 0], rpy=x),
    "rotation": lambda _, x: jacokin.pose([0, 0, 0], rotation=x),
    "down": lambda _, x: jacokin.pose([0, 0, 0], down=x),
    "quat_wxyz of": lambda _, x: quat_wxyz(x),
    "to_mujoco": lambda _, x: to_mujoco(x),
    "geometry": lambda robot, x: to_mujoco(robot, geometry=x),
    "SelfContact": lambda _, x: SelfContact(x),
    "touching": lambda robot, x: contact_of(robot).touching(x),
}


@pytest.mark.parametrize("name", CALLS)
def test_any_argument_is_answered_or_refused_by_the_package(robot: Robot, name: str) -> None:
    refused = 0
    for value in VALUES:
        if name == "samples" and isinstance(value, int) and value > 1000:
            continue  # a number of samples like any other, and much to wait for
        try:
            CALLS[name](robot, value)
        except JacokinError as error:
            refused += 1
            assert str(error)  # noqa: PT017 - both outcomes are right
    assert refused > len(VALUES) / 2
