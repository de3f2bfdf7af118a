"""Options that several planners have: of one name, type and default, wherever they stand."""

from __future__ import annotations

from collections import defaultdict
from inspect import Parameter, signature

import pytest

from jacokin.motion import Tracker, move_joints, plan_motion, plan_path, plan_pick, plan_place, track_path

FREE = (plan_motion, plan_pick, plan_place, move_joints)
ALONG = (plan_path, track_path)
KEPT = (track_path, Tracker)


@pytest.mark.parametrize("functions", [FREE, ALONG, KEPT])
def test_shared_options_have_one_type_and_one_default(functions: tuple[object, ...]) -> None:
    found = defaultdict[str, set[tuple[str, str]]](set)
    for function in functions:
        assert callable(function)
        for each in signature(function).parameters.values():
            if each.kind is Parameter.KEYWORD_ONLY and each.name not in ("start", "dt"):
                found[each.name].add((str(each.annotation), repr(each.default)))
    assert {name: kinds for name, kinds in found.items() if len(kinds) > 1} == {}
