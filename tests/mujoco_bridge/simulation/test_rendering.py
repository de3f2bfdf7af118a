"""Pictures: colours, depth and segmentation agree with the geometry; the arena is not over-exposed.

MuJoCo chooses its OpenGL backend when it is imported, so what renders runs in a process of its own.
"""

from __future__ import annotations

from typing import Any

import mujoco
import pytest

from jacokin.errors import InvalidInputError, PhysicsError, UnknownNameError
from tests.mujoco_bridge.scenes import Scene
from tests.mujoco_bridge.test_cameras import run

SCENE = """
import mujoco
import numpy as np
from jacokin.mujoco_bridge import Arena, JacoArm, JacoHand, Physics, Primitive, cameras, observations, robots

arena, ball = Arena(), Primitive("sphere", (0.05,), rgba=(1.0, 0.0, 0.0, 1.0), name="ball")
arena.attach(ball, position=(0.0, 0.0, 0.3))
"""

PICTURES = """
views = cameras.add_camera_observables(arena, observations.VISION, cameras.TOP_DOWN)
camera = arena.mjcf_model.camera("top_down")
depth_view = cameras.MJCFCamera(camera, height=120, width=160, depth=True, enabled=True)
what_view = cameras.MJCFCamera(camera, height=120, width=160, segmentation=True, enabled=True)
views["top_down"].configure(height=120, width=160)
physics = Physics.from_entity(arena)
size = {"height": 120, "width": 160, "camera_id": "top_down"}
colours = physics.render(**size)
assert (colours.shape, colours.dtype) == ((120, 160, 3), np.uint8)
depth = physics.render(**size, depth=True)
assert (depth.shape, depth.dtype) == ((120, 160), np.float32)
# From 2.5 m above: the top of the ball in the middle, the floor beside it, distances along the view.
np.testing.assert_allclose(depth[60, 80], 2.5 - 0.35, atol=2e-3)
np.testing.assert_allclose(depth[60, 40], 2.5, atol=2e-3)
what = physics.render(**size, segmentation=True)
assert (what.shape, what.dtype) == ((120, 160, 2), np.int32)
ball_id, floor_id = physics.bind(ball.geom).element_id, physics.bind("ground").element_id
assert tuple(what[60, 80]) == (ball_id, mujoco.mjtObj.mjOBJ_GEOM)
assert tuple(what[60, 40]) == (floor_id, mujoco.mjtObj.mjOBJ_GEOM)
red = colours[..., 0] > colours[..., 1] + 60
assert (red == (what[..., 0] == ball_id)).mean() > 0.99
# Colours come back after depth and segmentation.
np.testing.assert_array_equal(physics.render(**size), colours)
option = mujoco.MjvOption()
option.geomgroup[:] = 0
hidden = physics.render(**size, segmentation=True, scene_option=option)
assert (hidden == -1).all()
wires = physics.render(**size, render_flag_overrides={"wireframe": True})
assert (wires != colours).mean() > 0.1
np.testing.assert_array_equal(physics.render(**size), colours)
assert physics.render().shape == (240, 320, 3)
# Observables of the same, and what they say of themselves.
for view, kind in ((views["top_down"], np.uint8), (depth_view, np.float32), (what_view, np.int32)):
    picture = view(physics)
    assert (view.array_spec.shape, view.array_spec.dtype) == (picture.shape, picture.dtype) == (picture.shape, kind)
    assert (picture >= view.array_spec.minimum).all()
ball.set_pose(physics, position=(0.0, 0.0, 0.5))
np.testing.assert_allclose(depth_view(physics)[60, 80], 2.5 - 0.55, atol=5e-3)
print("seen")
"""

EXPOSURE = """
arena, arm = Arena(), JacoArm()
arm.attach(JacoHand())
arena.attach(arm, position=robots.ARM_OFFSET)
cameras.add_camera_observables(
    arena, observations.VISION, cameras.FRONT_CLOSE, cameras.TOP_DOWN, cameras.LEFT_CLOSE, cameras.FRONT_FAR
)
arena.add_free_entity(Primitive("box", rgba=(1.0, 1.0, 0.0, 1.0)), position=(0.1, 0.0, 0.02))  # a pure colour
physics = Physics.from_entity(arena)
arm.set_home(physics)
for name in NAMES:
    picture = physics.render(240, 320, name)
    saturated = (picture == 255).any(axis=-1).mean()
    assert saturated < 1e-3, (name, saturated)
    assert 60 < picture.mean() < 200, (name, picture.mean())
    assert picture.std() > 15, (name, picture.std())
print("exposed")
"""


DISCARDED = """
import gc
physics = Physics.from_entity(arena)
size = {"height": 60, "width": 80}
before = physics.render(**size)
for _ in range(ROUNDS):
    other = Physics.from_entity(Arena())
    other.render(**size)
    physics.render(**size)
    del other
    gc.collect()
    np.testing.assert_array_equal(physics.render(**size), before)
other = Physics.from_entity(Arena())
other.render(**size)
physics.render(**size)
other._renderers.close()
np.testing.assert_array_equal(physics.render(**size), before)
print("seen")
"""


QUALITY = """
physics = Physics.from_entity(arena)
size, quality = {"height": 60, "width": 80}, physics.model.vis.quality
fine = physics.render(**size)
quality.shadowsize, quality.offsamples = 64, 0
coarse = physics.render(**size)
assert (coarse != fine).any()
quality.shadowsize, quality.offsamples = 4096, 4
np.testing.assert_array_equal(physics.render(**size), fine)
print("seen")
"""


@pytest.mark.slow
def test_quality_may_be_changed_after_the_first_picture() -> None:
    assert run(SCENE + QUALITY, MUJOCO_GL="egl") == "seen\n"


@pytest.mark.slow
def test_colours_depth_and_segmentation() -> None:
    assert run(SCENE + PICTURES, MUJOCO_GL="egl") == "seen\n"


@pytest.mark.slow
def test_a_scene_that_is_gone_leaves_the_pictures_of_others_alone() -> None:
    assert run("ROUNDS = 3\n" + SCENE + DISCARDED, MUJOCO_GL="egl") == "seen\n"


@pytest.mark.parametrize(
    "names",
    [
        ("front_close", "overview"),
        pytest.param(("top_down", "left_close", "front_far"), marks=pytest.mark.slow),
    ],
)
def test_pictures_of_the_arena_are_not_over_exposed(names: tuple[str, ...]) -> None:
    assert run(f"NAMES = {names}\n" + SCENE + EXPOSURE, MUJOCO_GL="egl") == "exposed\n"


def test_wrong_arguments_are_refused_before_a_context_is_made(jaco: Scene) -> None:
    physics = jaco.physics
    with pytest.raises(UnknownNameError, match="overview"):
        physics.render(camera_id="overveiw")
    with pytest.raises(UnknownNameError, match="wireframe"):
        physics.render(render_flag_overrides={"wires": True})
    wrong: dict[str, Any]
    for wrong, words in (
        ({"camera_id": 7}, "camera_id must be below 1"),
        ({"height": 0}, "height"),
        ({"depth": True, "segmentation": True}, "at most one of depth and segmentation"),
        ({"scene_option": "all"}, "MjvOption"),
        ({"render_flag_overrides": {"wireframe": 1}}, "True or False"),
        ({"width": 10_000}, "offscreen buffer"),
    ):
        with pytest.raises(InvalidInputError, match=words):
            physics.render(**wrong)


def test_without_a_display_the_remedy_is_named(jaco: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(PhysicsError, match="MUJOCO_GL=egl"):
        jaco.physics.render(scene_option=mujoco.MjvOption())
