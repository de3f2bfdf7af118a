"""Writes to the arrays of a model are noticed, at a cost that does not grow with what was bound."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from jacokin.mujoco_bridge.simulation.binding import ModelWatch
from jacokin.mujoco_bridge.simulation.elements import KINDS, fields_of
from tests.mujoco_bridge.scenes import Scene

MODEL_FIELDS = sorted({field.array for kind in KINDS for field in fields_of(kind).values() if field.in_model})


def test_a_write_to_any_array_that_was_handed_out_is_noticed_once(jaco: Scene) -> None:
    model = jaco.physics.model
    watch = ModelWatch(model)
    for name in MODEL_FIELDS:
        watch.add(name)
    assert not watch.changed()
    for name in MODEL_FIELDS:
        array = getattr(model, name).reshape(-1)
        if not array.size:
            continue
        old = array[-1]
        array[-1] = not old if array.dtype == bool else old + 1
        assert watch.changed(), name
        assert not watch.changed(), name
        array[-1] = old
        assert watch.changed(), name


def test_the_number_of_comparisons_is_bounded_by_the_model(jaco: Scene) -> None:
    watch = ModelWatch(jaco.physics.model)
    for _ in range(3):
        for name in MODEL_FIELDS:
            watch.add(name)
    assert len(watch._spans) <= 4
    wanted = sum(getattr(jaco.physics.model, name).nbytes for name in MODEL_FIELDS)
    compared = sum(span.memory.nbytes for span in watch._spans)
    assert wanted <= compared <= wanted + 4096 * len(watch._spans) + 8192


def test_a_write_before_more_is_bound_is_not_forgotten(jaco: Scene) -> None:
    physics, _, arm, _ = jaco
    bound = physics.bind(arm.joints)
    accelerations = bound.qacc.copy()
    bound.armature[:] += 1.0
    _ = bound.damping, bound.frictionloss  # looks at the memory anew
    assert np.abs(bound.qacc - accelerations).max() > 1e-6


@pytest.mark.parametrize("kind", ["geom", "site"])
def test_moved_frames_are_followed_however_they_are_written(jaco: Scene, kind: str) -> None:
    physics, arena, _, _ = jaco
    elements = arena.mjcf_model.geoms if kind == "geom" else arena.mjcf_model.sites
    bound = physics.bind(list(elements))
    _ = bound.pos
    getattr(physics.model, f"{kind}_pos")[:] += (0.1, 0.0, 0.0)  # not through the binding
    shown = bound.xpos.copy()
    fresh = mujoco.MjData(physics.model)
    fresh.qpos[:] = physics.data.qpos
    getattr(physics.model, f"{kind}_sameframe")[:] = 0
    mujoco.mj_kinematics(physics.model, fresh)
    np.testing.assert_allclose(shown, getattr(fresh, f"{kind}_xpos"), atol=1e-12)
