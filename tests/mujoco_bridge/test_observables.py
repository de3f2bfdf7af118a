"""Observables and their options, on entities without a simulation."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, cast

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.mujoco_bridge import Entity
from jacokin.mujoco_bridge.observables import AGGREGATORS, Observable, Observables, observable
from jacokin.mujoco_bridge.updater import observables_of

DEFAULTS = {
    "update_interval": 1,
    "buffer_size": None,
    "delay": None,
    "aggregator": None,
    "corruptor": None,
    "enabled": False,
}
PHYSICS: Any = None  # these observables do not look at it


class Doors(Observables):
    made = 0

    @observable
    def width(self) -> Observable:
        Doors.made += 1
        return Observable(lambda physics: [0.8, 0.9])

    @observable
    def angle(self) -> Observable:
        return Observable(lambda physics: 0.5)


class House(Entity):
    """An entity that says itself what its prefix is and what is attached to it."""

    def _build(self, prefix: str, *rooms: House) -> None:
        self._mjcf_root = mujoco.MjSpec()
        self._prefix, self._rooms = prefix, rooms

    def _build_observables(self) -> Doors:
        return Doors(self)

    @property
    def prefix(self) -> str:
        return self._prefix

    def iter_entities(self, exclude_self: bool = False) -> Iterator[Entity]:
        yield self
        for room in self._rooms:
            yield from room.iter_entities()


def values(each: Observable) -> dict[str, Any]:
    options = {name: getattr(each, name) for name in DEFAULTS}
    assert each.options == options
    return options


def test_starts_disabled_and_plain() -> None:
    assert values(Observable(lambda physics: 1.0)) == DEFAULTS
    assert all(values(each) == DEFAULTS for each in House("").observables.as_dict().values())


def test_calling_reads_then_corrupts_and_returns_a_new_array() -> None:
    state = np.array([1.0, 2.0])
    rng = np.random.default_rng(3)
    each = Observable(lambda physics: state)
    value = each(PHYSICS)
    state[:] = 5.0
    np.testing.assert_array_equal(value, [1.0, 2.0])

    def noise(value: NDArray[Any], random_state: np.random.Generator) -> NDArray[Any]:
        value += random_state.normal(size=2)
        return value

    each.corruptor = noise
    np.testing.assert_array_equal(each(PHYSICS, rng), 5.0 + np.random.default_rng(3).normal(size=2))
    np.testing.assert_array_equal(state, [5.0, 5.0])


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("update_interval", 0),
        ("update_interval", 1.5),
        ("update_interval", None),
        ("update_interval", True),
        ("buffer_size", 0),
        ("buffer_size", lambda random_state: 1),
        ("delay", -1),
        ("delay", "long"),
        ("aggregator", "mode"),
        ("aggregator", 3),
        ("corruptor", "noise"),
        ("enabled", 1),
        ("enabled", None),
    ],
)
def test_wrong_option_values_are_refused_and_change_nothing(option: str, value: Any) -> None:
    each = Observable(lambda physics: 1.0)
    with pytest.raises(InvalidInputError, match=option):
        setattr(each, option, value)
    with pytest.raises(InvalidInputError, match=option):
        each.configure(**{"update_interval": 7, option: value})
    with pytest.raises(InvalidInputError, match=option):
        Observable(lambda physics: 1.0, **{option: value})
    assert values(each) == DEFAULTS


def test_options_accept_numpy_numbers_and_callables() -> None:
    each = Observable(lambda physics: 1.0, update_interval=cast(int, np.int64(3)), enabled=cast(bool, np.True_))
    assert (each.update_interval, type(each.update_interval), each.enabled) == (3, int, True)
    each.configure(delay=lambda random_state: 2, aggregator=np.ptp, buffer_size=4)
    assert callable(each.delay)
    assert each.aggregator is np.ptp


def test_unknown_names_are_key_errors_that_list_the_names() -> None:
    each = Observable(lambda physics: 1.0)
    with pytest.raises(KeyError, match="update_interval, buffer_size, delay") as caught:
        each.configure(intervall=2)
    assert isinstance(caught.value, UnknownNameError)
    assert str(caught.value).startswith("unknown option 'intervall'.")
    with pytest.raises(KeyError, match=", ".join(AGGREGATORS)):
        each.aggregator = "mode"
    house = House("house/")
    with pytest.raises(KeyError, match="Valid: angle, width"):
        house.observables.set_options({"windows": {"enabled": True}})
    with pytest.raises(KeyError, match="Valid: angle, width"):
        house.observables.get_observable("windows")


def test_raw_must_be_callable() -> None:
    with pytest.raises(InvalidInputError, match="raw must be a callable"):
        Observable(cast(Any, 3.0))


def test_declared_observables_are_made_once_and_are_attributes() -> None:
    Doors.made = 0
    house = House("house/")
    assert Doors.made == 1
    assert house.observables.width is house.observables.get_observable("width")
    assert Doors.made == 1
    np.testing.assert_array_equal(house.observables.width(PHYSICS), [0.8, 0.9])


def test_as_dict_has_the_declared_ones_first_and_full_names() -> None:
    house = House("street/house/")
    house.observables.add_observable("bell", Observable(lambda physics: 0.0))
    assert list(house.observables.as_dict()) == [
        "street/house/angle",
        "street/house/width",
        "street/house/bell",
    ]
    assert list(house.observables.as_dict(fully_qualified=False)) == ["angle", "width", "bell"]
    house.observables.as_dict(fully_qualified=False).clear()
    assert len(house.observables.as_dict()) == 3


def test_observables_of_a_tree() -> None:
    tree = House("", House("b/"), House("a/", House("a/c/")))
    assert list(observables_of(tree)) == [
        "angle",
        "width",
        "b/angle",
        "b/width",
        "a/angle",
        "a/width",
        "a/c/angle",
        "a/c/width",
    ]


def test_enable_and_disable() -> None:
    doors = House("").observables
    doors.enable_all()
    assert list(doors.enabled_observables) == ["angle", "width"]
    doors.angle.enabled = False
    assert list(doors.enabled_observables) == ["width"]
    doors.disable_all()
    assert doors.enabled_observables == {}


def test_set_options_nested_and_for_all() -> None:
    doors = House("").observables
    doors.set_options({"width": {"enabled": True, "buffer_size": 3}})
    assert values(doors.width) == {**DEFAULTS, "enabled": True, "buffer_size": 3}
    assert values(doors.angle) == DEFAULTS
    doors.set_options({"delay": 2, "aggregator": "mean"})
    assert values(doors.width) == {
        **DEFAULTS,
        "enabled": True,
        "buffer_size": 3,
        "delay": 2,
        "aggregator": "mean",
    }
    assert values(doors.angle) == {**DEFAULTS, "delay": 2, "aggregator": "mean"}
    doors.set_options(None)
    doors.set_options({})
    assert doors.angle.delay == 2


@pytest.mark.parametrize(
    "options",
    [
        {"width": {"enabled": True}, "windows": {"enabled": True}},
        {"width": {"enabled": True}, "angle": {"colour": "red"}},
        {"width": {"enabled": True}, "angle": {"delay": -1}},
        {"width": {"enabled": True}, "angle": True},
        {"enabled": True, "delay": -1},
        {"enabled": True, "colour": "red"},
        ["width"],
    ],
)
def test_set_options_is_all_or_nothing(options: Any) -> None:
    doors = House("").observables
    with pytest.raises(InvalidInputError):
        doors.set_options(options)
    assert values(doors.width) == values(doors.angle) == DEFAULTS


def test_add_observable() -> None:
    doors = House("").observables
    bell = Observable(lambda physics: 1.0)
    doors.add_observable("bell", bell)
    assert bell.enabled
    assert doors.bell is doors.get_observable("bell") is bell
    with pytest.raises(AttributeError, match=r"unknown observable 'knocker'\. Valid: angle, bell, width"):
        _ = doors.knocker
    doors.add_observable("knocker", Observable(lambda physics: 1.0), enabled=False)
    assert list(doors.enabled_observables) == ["bell"]
    for name in ("bell", "width", "set_options", "two words", ""):
        with pytest.raises(InvalidInputError, match="name"):
            doors.add_observable(name, Observable(lambda physics: 1.0))
    with pytest.raises(InvalidInputError, match="must be an Observable"):
        doors.add_observable("lock", cast(Any, 3.0))
