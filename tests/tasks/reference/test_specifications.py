"""Names, shapes, types and limits are those of dm_control; of what needs a picture, see `test_pictures`."""

from __future__ import annotations

import warnings

import pytest

import jacokin.tasks
from tests.optional import make_dm_control_run
from tests.tasks.families_sample import slow_but
from tests.tasks.reference.sides import FEATURES, NAMES, load_reference, specifications


def test_all_names_are_there() -> None:
    make_dm_control_run()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW without a display
        from dm_control import manipulation
    assert sorted(manipulation.ALL) == sorted(NAMES)
    for tag in ("features", "vision", "easy"):
        of_tag = set(jacokin.tasks.names(tag)) & set(NAMES)
        assert of_tag == set(manipulation.get_environments_by_tag(tag))


@pytest.mark.parametrize("name", slow_but(FEATURES, ["place_cradle"]))
def test_specifications_are_equal(name: str) -> None:
    wanted = specifications(load_reference(name))
    assert specifications(jacokin.tasks.load(name)) == wanted
    assert len(wanted["observations"]) >= 7
