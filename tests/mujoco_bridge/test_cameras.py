"""Cameras: where they look, what they report, and what happens without OpenGL.

MuJoCo chooses its OpenGL backend when it is imported, so what renders runs in a process of its own.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, cast

import mujoco
import numpy as np
import pytest

from jacokin.errors import InvalidInputError
from jacokin.mujoco_bridge import Arena, Physics, cameras, observations, robots
from tests.programs import python

SPECS = (
    cameras.FRONT_CLOSE,
    cameras.FRONT_FAR,
    cameras.TOP_DOWN,
    cameras.LEFT_CLOSE,
    cameras.RIGHT_CLOSE,
)

RENDERING = """
import mujoco
import numpy as np
from jacokin.mujoco_bridge import Arena, Physics, cameras, observations, robots
from jacokin.mujoco_bridge.updater import observables_of
from jacokin.mujoco_bridge.updater import Updater

CUBE = np.array([-0.1, -0.1, 0.05])  # [m]
arm, hand = robots.make_arm(observations.VISION), robots.make_hand(observations.VISION)
arm.attach(hand)
arena = Arena()
arena.attach(arm, position=robots.ARM_OFFSET)
arena.mjcf_model.worldbody.add_geom(
    type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.02] * 3, pos=CUBE, rgba=[1, 0, 0, 1]
)
specs = (cameras.FRONT_CLOSE, cameras.LEFT_CLOSE, cameras.FRONT_FAR, cameras.TOP_DOWN, cameras.RIGHT_CLOSE)[:CAMERAS]
views = cameras.add_camera_observables(arena, observations.VISION, *specs)
physics = Physics.from_entity(arena)
arm.set_home(physics)
physics.step()
"""

WHERE_THE_CUBE_IS = """
for spec in specs:
    height, width = 240, 320
    views[spec.name].configure(height=height, width=width)
    picture = views[spec.name](physics).astype(float)
    assert picture.shape == (height, width, 3)
    red = picture[..., 0] - picture[..., 1:].max(axis=-1) > 50.0
    assert red.sum() > 9, (spec.name, red.sum())
    rows, columns = np.nonzero(red)
    right = np.array(spec.xyaxes[:3])
    up = np.array(spec.xyaxes[3:]) / np.linalg.norm(spec.xyaxes[3:])
    offset = CUBE - spec.pos
    depth = -offset @ np.cross(right, up)
    focal = 0.5 * height / np.tan(np.radians(45.0) / 2)  # [pixels], MuJoCo's default field of view
    expected = [height / 2 - focal * (offset @ up) / depth, width / 2 + focal * (offset @ right) / depth]
    measured = [rows.mean() + 0.5, columns.mean() + 0.5]
    # The cube's visible centre is off its own by less than its half size of 2 cm.
    assert np.abs(np.subtract(expected, measured)).max() < 1.0 + focal * 0.02 / depth, (spec.name, measured)
print("looked", len(specs))
"""

UPDATING = """
for view in views.values():
    view.configure(height=84, width=84)
updater = Updater({**observables_of(arena), **views}, 20, strip_singleton_buffer_dim=True)
updater.reset(physics, np.random.default_rng(0))
first = updater.get_observation()
physics.bind(arm.actuators).ctrl = [0.5, 0.3, 0.3, 0.8, 0.8, 0.8]
for _ in range(STEPS):
    last = updater.advance()
pictures = {name for name, value in last.items() if value.shape == (84, 84, 3)}
assert pictures == set(views), pictures
assert all(last[name].dtype == np.uint8 for name in views)
assert all((first[name] != last[name]).mean() > 1e-3 for name in ("front_close", "left_close") if name in views)
assert "jaco_arm/jaco_hand/pinch_site_pos" in last
fields = "qpos", "qvel", "ctrl", "qacc_warmstart", "sensordata", "site_xpos"
kept = {field: getattr(physics.data, field).copy() for field in fields}
again = views["front_close"](physics)
np.testing.assert_array_equal(again, last["front_close"])
for field in fields:
    np.testing.assert_array_equal(getattr(physics.data, field), kept[field])
arm.set_home(physics)
assert (views["front_close"](physics) != again).mean() > 1e-3  # fresh after a write, without a step
print("updated", len(pictures))
"""

TOO_LARGE = """
from jacokin.errors import InvalidInputError
views["front_close"].height = 481
try:
    views["front_close"](physics)
except InvalidInputError as error:
    assert "481 x 84" in str(error) and "480 x 640" in str(error), error
    print("refused")
"""

WITHOUT_CONTEXT = """
from jacokin.errors import PhysicsError
updater = Updater({**observables_of(arena), **views}, 20)
size = mujoco.mj_stateSize(physics.model, mujoco.mjtState.mjSTATE_INTEGRATION)
before, after = np.empty(size), np.empty(size)
mujoco.mj_getState(physics.model, physics.data, before, mujoco.mjtState.mjSTATE_INTEGRATION)
for read in (lambda: views["front_close"](physics), lambda: updater.reset(physics)):
    try:
        read()
    except PhysicsError as error:
        assert "MUJOCO_GL=egl" in str(error) and "libegl1" in str(error), error
        print("explained")
mujoco.mj_getState(physics.model, physics.data, after, mujoco.mjtState.mjSTATE_INTEGRATION)
assert before.tobytes() == after.tobytes()
"""


def run(script: str, **environment: str) -> str:
    """Run a script without a display; it must neither fail nor warn nor leave messages behind."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY", "PYOPENGL_PLATFORM"):
            patch.delenv(name, raising=False)
        done = python("-W", "error", "-c", script, timeout=120.0, environment=environment)
    assert done.stderr == ""
    return done.stdout


@pytest.mark.parametrize(("count", "steps"), [(1, 2), pytest.param(5, 3, marks=pytest.mark.slow)])
def test_pictures_show_the_scene_and_follow_it(count: int, steps: int) -> None:
    numbers = f"CAMERAS, STEPS = {count}, {steps}\n"
    output = run(numbers + RENDERING + WHERE_THE_CUBE_IS + UPDATING + TOO_LARGE, MUJOCO_GL="egl")
    assert output.split("\n") == [f"looked {count}", f"updated {count}", "refused", ""]


@pytest.mark.one_quick
@pytest.mark.parametrize(
    "environment",
    [{}, {"MUJOCO_GL": "disable"}, {"DISPLAY": ":404"}],
    ids=["unset", "disabled", "no such display"],
)
def test_without_opengl_reading_a_camera_explains_and_changes_nothing(environment: dict[str, str]) -> None:
    assert run("CAMERAS = 1\n" + RENDERING + WITHOUT_CONTEXT, **environment).split() == ["explained", "explained"]


def test_cameras_are_in_the_model_with_their_poses_and_options() -> None:
    arena = Arena()
    views = cameras.add_camera_observables(arena, observations.VISION, *SPECS)
    assert list(views) == ["front_close", "front_far", "top_down", "left_close", "right_close"]
    assert all(view.enabled and (view.height, view.width) == (84, 84) for view in views.values())
    physics = Physics.from_entity(arena)
    for spec in SPECS:
        camera = physics.model.camera(spec.name)
        np.testing.assert_allclose(camera.pos, spec.pos)
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, camera.quat)
        right, up, back = rotation.reshape(3, 3).T
        np.testing.assert_allclose(right, spec.xyaxes[:3], atol=1e-12)
        np.testing.assert_allclose(np.cross(up, spec.xyaxes[3:]), 0.0, atol=1e-12)
        assert up @ spec.xyaxes[3:] > 0
        assert back[2] > 0.6  # each looks down at the workspace
    quiet = cameras.add_camera_observables(Arena(), observations.PERFECT_FEATURES, cameras.TOP_DOWN)
    assert not quiet["top_down"].enabled


def test_wrong_cameras_are_refused_and_none_is_added() -> None:
    arena = Arena()
    cameras.add_camera_observables(arena, observations.VISION, cameras.TOP_DOWN)
    before = len(arena.mjcf_model.cameras)
    with pytest.raises(InvalidInputError, match="'top_down' is there already"):
        cameras.add_camera_observables(arena, observations.VISION, cameras.FRONT_FAR, cameras.TOP_DOWN)
    with pytest.raises(InvalidInputError, match="CameraSpec"):
        cameras.add_camera_observables(arena, observations.VISION, cameras.FRONT_FAR, cast(Any, "top_down"))
    with pytest.raises(InvalidInputError, match="ObservationSettings"):
        cameras.add_camera_observables(arena, cast(Any, {"camera": {}}), cameras.FRONT_FAR)
    wrong = observations.VISION._replace(camera=observations.VISION.camera._replace(height=0))
    with pytest.raises(InvalidInputError, match="height"):
        cameras.add_camera_observables(arena, wrong, cameras.FRONT_FAR)
    assert len(arena.mjcf_model.cameras) == before


def test_a_camera_of_another_model_is_refused() -> None:
    view = cameras.add_camera_observables(Arena(), observations.VISION, cameras.TOP_DOWN)["top_down"]
    arena = Arena()
    arena.attach(robots.make_arm(observations.PERFECT_FEATURES))
    with pytest.raises(InvalidInputError, match="camera 'top_down' is not part of this physics"):
        view(Physics.from_entity(arena))
    with pytest.raises(InvalidInputError, match="camera element"):
        cameras.MJCFCamera("top_down")


@pytest.mark.slow
def test_the_page_on_observables_runs() -> None:
    page = Path(__file__).parents[2] / "docs" / "observables.md"
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert blocks
    run("\n".join(blocks), MUJOCO_GL="egl")


@pytest.mark.parametrize("before_attaching", [True, False])
def test_cameras_of_an_attached_entity_move_with_it(before_attaching: bool) -> None:
    arm, arena = robots.make_arm(observations.PERFECT_FEATURES), Arena()
    if not before_attaching:
        arena.attach(arm, position=robots.ARM_OFFSET)
    views = cameras.add_camera_observables(arm, observations.VISION, cameras.TOP_DOWN)
    assert list(views) == ["top_down"]
    if before_attaching:
        arena.attach(arm, position=robots.ARM_OFFSET)
    with pytest.raises(InvalidInputError, match="'jaco_arm/top_down' is there already"):
        cameras.add_camera_observables(arm, observations.VISION, cameras.TOP_DOWN)
    physics = Physics.from_entity(arena)
    expected = np.add(robots.ARM_OFFSET, cameras.TOP_DOWN.pos)
    np.testing.assert_allclose(physics.data.camera("jaco_arm/top_down").xpos, expected)
