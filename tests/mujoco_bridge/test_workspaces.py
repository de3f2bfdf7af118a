"""Sites that show boxes and goals."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from jacokin.errors import InvalidInputError
from jacokin.mujoco_bridge import Arena, Physics, workspaces


def test_sites_show_boxes_and_goals() -> None:
    arena = Arena()
    world = arena.mjcf_model.worldbody
    box = workspaces.BoundingBox(lower=(-0.1, -0.2, 0.0), upper=(0.3, 0.2, 0.0))
    shown = workspaces.add_bbox_site(world, box.lower, box.upper, visible=True, name="start", rgba=workspaces.GREEN)
    goal = workspaces.add_target_site(world, 0.05, name="goal")
    physics = Physics.from_entity(arena)
    np.testing.assert_allclose(physics.bind(shown).pos, (0.1, 0.0, 0.0))
    np.testing.assert_allclose(physics.bind(shown).size, (0.2, 0.2, 1e-6))  # flat, but not without extent
    assert physics.bind(shown).type[0] == mujoco.mjtGeom.mjGEOM_BOX
    assert (physics.bind(shown).group[0], physics.bind(goal).group[0]) == (0, 3)
    assert physics.bind(goal).size[0] == 0.05
    np.testing.assert_allclose(physics.bind(goal).rgba, workspaces.RED)


def test_malformed_boxes_are_refused() -> None:
    world = Arena().mjcf_model.worldbody
    with pytest.raises(InvalidInputError, match="lower must not be above upper"):
        workspaces.add_bbox_site(world, (0.0, 0.0, 1.0), (1.0, 1.0, 0.0))
    with pytest.raises(InvalidInputError, match="radius"):
        workspaces.add_target_site(world, 0.0)
    wrong: Any
    for wrong in (None, "worldbody", Arena().mjcf_model):
        with pytest.raises(InvalidInputError, match="body must be a body of an MjSpec"):
            workspaces.add_target_site(wrong, 0.05)
        with pytest.raises(InvalidInputError, match="body must be a body of an MjSpec"):
            workspaces.add_bbox_site(wrong, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    for wrong in (None, 3, "a\0b", "\ud800"):
        with pytest.raises(InvalidInputError, match="name must be a"):
            workspaces.add_target_site(world, 0.05, name=wrong)
    with pytest.raises(InvalidInputError, match="visible must be True or False"):
        workspaces.add_target_site(world, 0.05, visible=np.ones(2))  # type: ignore[arg-type]  # what is tested
    assert not world.sites
