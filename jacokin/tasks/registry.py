"""`TASKS`, the tasks by name, and `names` of their environments.

A name of an environment is that of a task and what is observed: ``reach_site_features``, ``reach_site_vision``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from jacokin.errors import UnknownNameError
from jacokin.model import checks
from jacokin.tasks.families import bricks, lift, place, reach
from jacokin.tasks.task import Task

FEATURES, VISION, EASY = "features", "vision", "easy"
OBSERVATIONS = (FEATURES, VISION)
TAGS = (FEATURES, VISION, EASY)


@dataclass(frozen=True, slots=True)
class Entry:
    """A task of the list.

    Attributes:
        make: makes the task.
        tags: its tags beside what is observed.
        observations: what may be observed: "features", and "vision" where dm_control has it.
    """

    make: Callable[[], Task]
    tags: tuple[str, ...] = ()
    observations: tuple[str, ...] = OBSERVATIONS


TASKS = {
    "reach_site": Entry(reach.ReachSite, tags=(EASY,)),
    "reach_duplo": Entry(reach.ReachBrick, tags=(EASY,)),
    "lift_brick": Entry(lift.LiftBrick),
    "lift_large_box": Entry(lift.LiftLargeBox),
    "place_brick": Entry(place.PlaceBrick),
    "place_cradle": Entry(place.PlaceCradle),
    "stack_2_bricks": Entry(partial(bricks.Stack, 2)),
    "stack_2_bricks_moveable_base": Entry(partial(bricks.Stack, 2, is_base_fixed=False)),
    "stack_3_bricks": Entry(partial(bricks.Stack, 3)),
    "stack_3_bricks_random_order": Entry(partial(bricks.Stack, 3, order_varies=True), observations=(FEATURES,)),
    "stack_2_of_3_bricks_random_order": Entry(partial(bricks.Stack, 3, 2, order_varies=True)),
    "reassemble_3_bricks_fixed_order": Entry(partial(bricks.Reassemble, 3)),
    "reassemble_5_bricks_random_order": Entry(partial(bricks.Reassemble, 5, order_varies=True)),
    **{f"reach_{corner}": Entry(partial(reach.ReachBrick, at), tags=(EASY,)) for corner, at in reach.CORNERS.items()},
}

_ENVIRONMENTS = {
    f"{name}_{observed}": (name, observed) for name, entry in TASKS.items() for observed in entry.observations
}


def names(tag: str | None = None) -> tuple[str, ...]:
    """The names of the environments that `load` makes.

    Args:
        tag: only those with this tag: "features", "vision" or "easy"; None for all.

    Raises:
        UnknownNameError: no such tag.
    """
    if tag is None:
        return tuple(_ENVIRONMENTS)
    checks.choice("tag", tag, TAGS)
    return tuple(name for name, (task, observed) in _ENVIRONMENTS.items() if tag in (observed, *TASKS[task].tags))


def task_and_observations(name: str) -> tuple[str, str]:
    """The name of the task and what is observed, of the name of an environment.

    A name without ``_features`` or ``_vision`` means features.

    Raises:
        UnknownNameError: no such environment; tells the nearest name and lists all.
    """
    if isinstance(name, str) and name in TASKS:
        return name, FEATURES
    if not isinstance(name, str) or name not in _ENVIRONMENTS:
        raise UnknownNameError("task", name, _ENVIRONMENTS)
    return _ENVIRONMENTS[name]


def make(task: str) -> Task:
    """A task by its name.

    Raises:
        UnknownNameError: no such task.
    """
    return TASKS[checks.choice("task", task, TASKS)].make()
