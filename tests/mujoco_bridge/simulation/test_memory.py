"""Scenes that are too small for what happens in them, and many scenes one after the other."""

from __future__ import annotations

import gc
import resource
import weakref
from pathlib import Path

import mujoco
import numpy as np
import pytest

from jacokin.errors import PhysicsError
from jacokin.mujoco_bridge import Physics, TcpInitializer
from tests.mujoco_bridge.scenes import jaco_parts, jaco_scene

BOXES = 10
INTEGRATION = int(mujoco.mjtState.mjSTATE_INTEGRATION)


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes MUJOCO_LOG.TXT when it warns


def boxes(size: str) -> Physics:
    """Boxes far apart; at qpos0 plus an overlap they touch one another."""
    bodies = "".join(
        f'<body pos="{i} 0 5"><freejoint/><geom type="box" size="0.1 0.1 0.1"/></body>' for i in range(BOXES)
    )
    xml = f'<mujoco><size {size}/><worldbody><geom type="plane" size="1 1 1"/>{bodies}</worldbody></mujoco>'
    return Physics.from_model(mujoco.MjModel.from_xml_string(xml))


def pile(physics: Physics) -> None:
    qpos = physics.data.qpos.reshape(BOXES, 7)
    qpos[:, 0] *= 0.05
    qpos[:, 2] = 0.05


@pytest.mark.parametrize("size", ['memory="50K"', 'memory="100K"', 'memory="300K"', 'memory="20K"'])
def test_too_little_memory_is_an_error_and_the_state_is_as_before(size: str) -> None:
    physics = boxes(size)
    physics.step(3)
    good = physics.get_state()
    pile(physics)
    before = physics.get_state()
    for act in (physics.step, physics.forward, lambda: physics.step(5)):
        with pytest.raises(PhysicsError, match="memory"):
            act()
        np.testing.assert_array_equal(physics.get_state(), before)
    physics.set_state(good)
    for _ in range(3):
        physics.step(10)  # it can be used again
    assert physics.data.ncon == 0


def test_a_pile_with_enough_memory_is_simulated() -> None:
    physics = boxes('memory="10M"')
    pile(physics)
    physics.step(5)
    assert physics.data.ncon > 20


def test_the_reference_state_need_not_fit() -> None:
    """At q = 0 a Jaco touches itself in a hundred places; what counts is where it is used."""
    arena, arm, _ = jaco_parts()
    arena.mjcf_model.memory = 400_000  # [bytes]
    physics = Physics.from_entity(arena)
    with pytest.raises(PhysicsError, match="find room"):
        physics.step()
    with pytest.raises(PhysicsError, match="find room"):
        physics.bind(arm.wrist_site).xpos  # noqa: B018 - reading is what is tested
    arm.set_home(physics)
    physics.step(10)
    physics.reset()
    arm.set_home(physics)
    physics.step(10)


def test_nothing_keeps_a_scene_that_is_not_used_any_more() -> None:
    physics, arena, arm, hand = jaco_scene()
    arm.set_site_to_xpos(physics, np.random.default_rng(0), hand.pinch_site, (0.1, 0.0, 0.2))
    TcpInitializer(hand, arm, (0.1, 0.0, 0.2))(physics, np.random.default_rng(0))
    simulation, entity = weakref.ref(physics), weakref.ref(arena)
    del physics, arena, arm, hand
    gc.collect()
    assert simulation() is None
    assert entity() is None


@pytest.mark.slow
def test_scenes_are_freed() -> None:
    def peak() -> float:
        gc.collect()
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0  # [MB]

    def use() -> None:
        physics, _, arm, hand = jaco_scene()
        arm.set_site_to_xpos(physics, np.random.default_rng(0), hand.pinch_site, (0.1, 0.0, 0.2))
        physics.copy().step(5)

    for _ in range(20):
        use()
    start = peak()
    for _ in range(100):
        use()
    assert peak() - start < 30.0
