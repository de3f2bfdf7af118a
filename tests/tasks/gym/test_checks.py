"""Gymnasium's checks, and copies in the middle of an episode, of every task, and of every option in each family."""

from __future__ import annotations

import contextlib
from pathlib import Path

import gymnasium
import pytest

from jacokin.tasks.registry import TASKS
from tests.programs import python, run_drawing
from tests.tasks.families_sample import ONE_OF_EACH_FAMILY, slow_but
from tests.tasks.gym.checking import FEATURE_OPTIONS, check, check_copies

QUICK = "stack_2_of_3_bricks_random_order"  # with all that a task may have
OTHERS = [task for task in TASKS if task != QUICK]
EVERY = 5  # of the other tasks, which render in one process
ROOT = Path(__file__).resolve().parents[3]
# The folder of the tests comes last: the installed package is what gets tested.
PROGRAM = """
import runpy, sys
sys.path.append(sys.argv.pop(1))
runpy.run_module("tests.tasks.gym.render_program", run_name="__main__")
"""


NAMED = "jacokin.tasks:jacokin/ReachSite-v0"


def test_an_environment_is_made_by_the_name_of_its_module() -> None:
    with contextlib.closing(gymnasium.make(NAMED, control="tool_velocity")) as env:
        assert env.action_space.shape == (7,)


@pytest.mark.slow
def test_a_process_that_has_registered_nothing_makes_an_environment() -> None:
    """As the workers of other libraries are, which get no more than the function that makes it."""
    program = f"import gymnasium; gymnasium.make({NAMED!r}, goal=True).reset(seed=0)"
    python("-c", program)


@pytest.mark.parametrize("task", slow_but(OTHERS, ["reach_site"]))
def test_gymnasium_accepts_every_task(task: str) -> None:
    check(task, {})
    check_copies(task, {})


@pytest.mark.one_quick("name")
@pytest.mark.parametrize("name", FEATURE_OPTIONS)
@pytest.mark.parametrize("task", slow_but(ONE_OF_EACH_FAMILY, [QUICK]))
def test_gymnasium_accepts_every_option(task: str, name: str) -> None:
    check(task, FEATURE_OPTIONS[name])
    check_copies(task, FEATURE_OPTIONS[name])


@pytest.mark.slow
@pytest.mark.parametrize("tasks", [[QUICK], OTHERS[::EVERY]])  # of the same code
def test_gymnasium_accepts_pictures_of_tasks(tasks: list[str]) -> None:
    found = run_drawing("-c", PROGRAM, ROOT, *tasks)
    assert int(found) == sum(1 + ("vision" in TASKS[task].observations) for task in tasks)
