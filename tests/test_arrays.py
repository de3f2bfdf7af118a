"""What is read-only stays so when it is copied or pickled."""

from __future__ import annotations

import copy
import dataclasses
import importlib
import pickle
from collections.abc import Callable, Iterator

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.arrays import Sealed
from jacokin.calibration import Measurements
from jacokin.model import Box, ContactObserver, Gripper, PointCloud, Scene, Sphere
from jacokin.motion import AxisTarget, JointTarget, OrientationTarget, PositionTarget, Posture, RegionTarget
from jacokin.reachability import Grid, Orientations, bundled
from jacokin.teleop import Teleop

PACKAGES = ("ik", "model", "motion", "reachability", "calibration", "teleop", "logs")


def objects(robot: Robot) -> Iterator[object]:
    """One of each kind."""
    q, still = robot.home, np.zeros(6)
    yield from (Box("box", [0.1, 0.2, 0.3], [1.0, 0.0, 0.0]), Sphere("ball", 0.1, [1.0, 0.0, 0.0]))
    yield PointCloud("seen", np.eye(3), radius=0.01)
    yield from (PositionTarget([0.3, 0.2, 0.4]), OrientationTarget(np.eye(3)), AxisTarget([0.0, 0.0, 1.0]))
    yield from (RegionTarget(lower=[0.1] * 3, upper=[0.2] * 3), JointTarget(q), Posture(q))
    tracker = jacokin.Tracker(robot)
    yield tracker.step(robot.forward_kinematics(q))
    yield Teleop(tracker, clutch=True).step([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    yield ContactObserver(robot, threshold=0.5).step(q, still, robot.gravity(q), dt=0.01)
    yield robot.external_wrench(q, still, still, robot.gravity(q))
    yield from jacokin.crosscheck(robot, samples=2).deviations[:1]
    yield Gripper.of(jacokin.load_robot("gen3_lite"))
    yield from (Grid([0.0] * 3, [1.0] * 3, 0.1), Orientations.even(5), bundled("j2n6s300"))
    yield Measurements(robot.sample(np.random.default_rng(0), 4), positions=np.zeros((4, 3)), sigma=1e-3)


def arrays_of(value: object) -> dict[str, np.ndarray]:
    """Public arrays of an object, by name."""
    names = [name for name in dir(value) if not name.startswith("_")]
    found = {name: getattr(value, name) for name in names}
    return {name: each for name, each in found.items() if isinstance(each, np.ndarray)}


@pytest.mark.parametrize(
    "duplicate",
    [copy.copy, copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))],
    ids=["copy", "deep", "pickle"],
)
def test_arrays_stay_read_only(duplicate: Callable[[object], object], robot: Robot) -> None:
    for value in objects(robot):
        own, again = arrays_of(value), arrays_of(duplicate(value))
        assert own, value
        assert own.keys() == again.keys()
        for name, array in own.items():
            np.testing.assert_array_equal(again[name], array)
            assert again[name].flags.writeable == array.flags.writeable, (type(value), name)


def test_a_copied_scene_is_solved_alike(robot: Robot) -> None:
    cloud = PointCloud("seen", np.array([[0.4, -0.4, 0.3], [0.3, 0.4, 0.3]]), radius=0.05, pose=[0.0, 0.0, 0.05])
    scene = Scene([Box("box", [0.2, 0.2, 0.2], [0.4, 0.2, 0.2]), cloud]).adding_robot(
        robot, robot.home, name="other", base=jacokin.pose([1.2, 0.0, 0.0])
    )
    rows = robot.sample(np.random.default_rng(1), 50)
    for again in (copy.deepcopy(scene), pickle.loads(pickle.dumps(scene))):
        np.testing.assert_array_equal(robot.clearance(rows, again), robot.clearance(rows, scene))


@pytest.mark.parametrize("package", PACKAGES)
def test_public_dataclasses_with_arrays_are_sealed(package: str) -> None:
    module = importlib.import_module(f"jacokin.{package}")
    for name in module.__all__:
        kind = getattr(module, name)
        if not (isinstance(kind, type) and dataclasses.is_dataclass(kind)):
            continue
        holds_arrays = any("Array" in str(each.type) for each in dataclasses.fields(kind))
        assert not holds_arrays or issubclass(kind, Sealed) or "__reduce__" in vars(kind), kind
