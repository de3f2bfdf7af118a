"""Results: frozen, and whole after a copy."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin import IKSolver, Robot, Status
from jacokin.ik.results import IKResult
from jacokin.ik.targets import TargetPose
from jacokin.motion.tracking.steps import TrackerStep

VALUES = (
    np.array([1.0, 2.0]),
    Status.OK,
    1e-9,
    2e-9,
    "closed_form",
    None,
    0,
    0,
    "branch 1 of 2",
    (("a", "b"),),
    0.5,
    np.eye(3),
)


def test_an_answer_holds_what_it_is_made_of() -> None:
    made = IKResult(*VALUES)
    for field, value in zip(dataclasses.fields(IKResult), VALUES, strict=True):
        assert getattr(made, field.name) is value
    assert made.success


@pytest.mark.parametrize("kind", [IKResult, TrackerStep])
def test_what_is_made_again_and_again_takes_the_arguments_of_its_fields(kind: Any) -> None:
    fields = dataclasses.fields(kind)
    parameters = inspect.signature(kind).parameters
    assert list(parameters) == [field.name for field in fields]
    needed = [field.name for field in fields if field.default is dataclasses.MISSING]
    made = kind(**dict.fromkeys(needed, "given"))
    for field in fields:
        assert getattr(made, field.name) == ("given" if field.name in needed else field.default)
    with pytest.raises(TypeError, match=f"{kind.__name__}.*missing"):
        kind()
    with pytest.raises(TypeError, match=f"{kind.__name__}.*unexpected"):
        kind(**dict.fromkeys(needed, "given"), other=1)


def test_an_answer_cannot_be_changed_and_survives_copies(robot: Robot) -> None:
    q = robot.home.copy()
    result = IKSolver(robot).solve(robot.forward_kinematics(q), seed=q)
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.status = Status.UNREACHABLE  # type: ignore[misc]  # that is the test
    for kept in (result, copy.deepcopy(result), pickle.loads(pickle.dumps(result)), dataclasses.replace(result)):
        assert type(kept) is IKResult
        np.testing.assert_array_equal(kept.q, result.q)
        with pytest.raises(ValueError, match="read-only"):
            kept.q[0] = 0.0
        with pytest.raises(ValueError, match="WRITEABLE"):
            kept.q[:2].flags.writeable = True


def test_an_answer_does_not_change_with_the_next_one_nor_with_the_seed(robot: Robot) -> None:
    rng = np.random.default_rng(3)
    solver = IKSolver(robot)
    seed = robot.sample(rng)
    results = [solver.solve(robot.forward_kinematics(robot.sample(rng)), seed) for _ in range(20)]
    failed = solver.solve(jacokin.pose([3.0, 0.0, 0.0]), seed, closest=False)
    kept = [result.q.copy() for result in (*results, failed)]
    seed[:] = 0.0
    solver.solve(robot.forward_kinematics(robot.home))
    for result, q in zip((*results, failed), kept, strict=True):
        np.testing.assert_array_equal(result.q, q)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.3, 0.72, 0.73, 2.0, np.pi - 1e-6, np.pi - 1e-9])
def test_errors_are_the_distance_and_the_angle_at_every_size(robot: Robot, angle: float) -> None:
    rng = np.random.default_rng(4)
    verifier = IKSolver(robot).verifier
    for _ in range(20):
        q, axis, step = robot.sample(rng), rng.standard_normal(3), rng.standard_normal(3) * angle
        T = robot.forward_kinematics(q).homogeneous
        x, y, z = axis / np.linalg.norm(axis)
        K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        T[:3, :3] = T[:3, :3] @ (np.eye(3) + np.sin(angle) * K + 2.0 * np.sin(angle / 2.0) ** 2 * K @ K)
        T[:3, 3] += step
        position, orientation = verifier.measure(q, TargetPose(T, position_only=False))
        assert position == pytest.approx(np.linalg.norm(step), rel=1e-12, abs=1e-15)
        assert orientation == pytest.approx(angle, rel=1e-9, abs=3e-15)
