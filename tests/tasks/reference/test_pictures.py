"""Tasks observed by a camera have dm_control's specifications, camera and pictures, but for the shape of the robot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.programs import run_drawing
from tests.tasks.families_sample import one_of_each_family
from tests.tasks.reference.sides import VISION

ROOT = Path(__file__).resolve().parents[3]
# The folder of the tests comes last: the installed package is what gets tested.
PROGRAM = """
import runpy, sys
sys.path.append(sys.argv.pop(1))
runpy.run_module("tests.tasks.reference.picture_program", run_name="__main__")
"""


def comparison(name: str) -> dict[str, Any]:
    """What `picture_program` prints of one task."""
    found: dict[str, Any] = json.loads(run_drawing("-c", PROGRAM, ROOT, name))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", one_of_each_family(VISION))
def test_vision_tasks_are_equal_but_for_the_shape_of_the_robot(name: str) -> None:
    found = comparison(name)
    wanted, ours = found["specifications"]
    assert ours == wanted
    assert next(spec[0] for spec in wanted["observations"]) == "front_close"
    assert found["cameras"][0] == pytest.approx(found["cameras"][1], abs=1e-12)
    assert found["changed without robot"] == 0.0
    assert found["robot"] > 0.05  # it is in the picture
    assert found["changed"] < 0.12  # share of the pixels: the robot's outline, its shadow and its reflection
