"""Classes of entities: their names, constructors and elements, and pickling."""

from __future__ import annotations

import copy
import inspect
import pickle
from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np
import pytest

from jacokin.errors import InvalidInputError
from jacokin.mujoco_bridge import Arena, Entity, JacoArm, JacoHand, MJCFFeature, ModelWrapperEntity, Observable, Physics
from jacokin.mujoco_bridge.props import Primitive

EXACT = 1e-12
QUARTER_TURN = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))  # about z, wxyz


class Unnamed(Entity):
    def _build(self) -> None:
        self._mjcf_root = mujoco.MjSpec()


class Empty(Entity):
    def _build(self) -> None:
        pass


def test_names_of_entities() -> None:
    assert Unnamed().name == "unnamed"
    assert Unnamed(name="box").name == "box"
    assert Primitive(name="cube").name == "cube"
    assert ModelWrapperEntity(mujoco.MjSpec()).name == "model_wrapper_entity"
    for name in ("left/arm", ""):
        for make in (lambda: JacoArm(name=name), lambda: JacoHand(name), lambda: Arena(name)):  # noqa: B023 - called here
            with pytest.raises(InvalidInputError, match="must not be empty and must not contain '/'"):
                make()
    with pytest.raises(InvalidInputError, match="_mjcf_root"):
        Empty()
    with pytest.raises(InvalidInputError, match=r"mujoco\.MjSpec"):
        ModelWrapperEntity("arm.xml")
    assert Unnamed().observables.as_dict() == {}


def test_constructors_say_what_they_take() -> None:
    assert list(inspect.signature(JacoArm.__init__).parameters)[:2] == ["self", "name"]
    assert "use_pinch_site_as_tcp" in inspect.signature(JacoHand).parameters
    assert list(inspect.signature(Primitive.__init__).parameters)[-2:] == ["observable_options", "geom_options"]
    assert "name" in (JacoArm.__init__.__doc__ or "")
    with pytest.raises(TypeError, match=r"JacoArm\._build\(\) got an unexpected keyword argument 'nme'"):
        JacoArm(nme="x")


class Fruit(NamedTuple):
    stem: mujoco.MjsSite
    weight: float


class Basket(Entity):
    """Keeps elements in containers of every sort."""

    def _build(self, fruits: int = 2) -> None:
        self._mjcf_root = mujoco.MjSpec()
        body = self._mjcf_root.worldbody.add_body(name="body")
        self.joint = body.add_joint(name="lid")
        body.add_geom(size=(0.1, 0.1, 0.1))
        self.sites = [body.add_site(name=f"site_{i}", pos=(i, 0.0, 0.0)) for i in range(fruits)]
        self.grid = np.empty((1, fruits), dtype=object)
        self.grid[0, :] = self.sites
        self.held = set(self.sites)
        self.by_element = {site: site.name for site in self.sites}
        self.fruit = Fruit(self.sites[0], 0.2)
        self.numbers = np.arange(3)


def test_elements_in_every_container_are_current_after_detaching() -> None:
    arena, basket = Arena(), Basket()
    arena.attach(basket)
    basket.observables.add_observable("lid", MJCFFeature("qpos", basket.joint, buffer_size=3))
    basket.observables.add_observable("time", Observable(lambda physics: physics.time), enabled=False)
    basket.detach()
    arena.attach(basket)
    physics = Physics.from_entity(arena)
    assert physics.bind(basket.grid.ravel()).xpos.shape == (2, 3)
    assert physics.bind(list(basket.held)).xpos.shape == (2, 3)
    assert physics.bind(list(basket.by_element)).xpos.shape == (2, 3)
    assert physics.bind(basket.fruit.stem).xpos.shape == (3,)
    assert basket.fruit.weight == 0.2
    np.testing.assert_array_equal(basket.numbers, (0, 1, 2))
    physics.bind(basket.joint).qpos = 0.75
    np.testing.assert_array_equal(basket.observables.lid(physics), [0.75])
    assert (basket.observables.lid.buffer_size, basket.observables.lid.enabled) == (3, True)
    assert basket.observables.time(physics) == 0.0
    assert not basket.observables.time.enabled


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda entity: pickle.loads(pickle.dumps(entity))])
def test_entities_are_pickled_and_copied_as_they_were_made(duplicate: Callable[[Arena], Arena]) -> None:
    arena, cube = Arena(), Primitive("box", name="cube", mass=0.5)
    arm, hand = JacoArm(name="left", observable_options={"joints_pos": {"enabled": True}}), JacoHand()
    arm.attach(hand, quaternion=QUARTER_TURN)
    arena.attach(arm, position=(0.0, 0.4, 0.0))
    arena.add_free_entity(cube, position=(0.3, 0.0, 0.5))
    twin = duplicate(arena)
    first, second = Physics.from_entity(arena), Physics.from_entity(twin)
    for field in ("body_pos", "body_quat", "body_mass", "jnt_type", "jnt_range", "geom_size", "actuator_gainprm"):
        np.testing.assert_array_equal(getattr(first.model, field), getattr(second.model, field))
    assert [each.prefix for each in twin.iter_entities()] == [each.prefix for each in arena.iter_entities()]
    left = next(each for each in twin.iter_entities() if isinstance(each, JacoArm))
    assert left is not arm
    assert left.observables.joints_pos.enabled
    left.set_home(second)
    assert second.model.joint("cube/freejoint").qposadr[0] == first.model.joint("cube/freejoint").qposadr[0]

    alone = pickle.loads(pickle.dumps(arm))  # without what it is attached to, with what is attached to it
    assert (alone.parent, alone.prefix, alone.root_body.name) == (None, "", "world")
    assert Physics.from_entity(alone).model.nq == 9


def test_what_cannot_be_pickled_is_refused() -> None:
    with pytest.raises(InvalidInputError, match=r"made from a mujoco\.MjSpec"):
        pickle.dumps(ModelWrapperEntity(mujoco.MjSpec()))
    arm, arena = JacoArm(), Arena()
    arena.attach(arm)
    arm.root_body.add_site(name="mark")
    with pytest.raises(InvalidInputError, match=r"by hand \(\+1 sites\)"):
        pickle.dumps(arena)
