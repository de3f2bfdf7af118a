"""`TASKS`, the tasks by name, `names` of their environments, and `register` for tasks of your own.

A name of an environment is that of a task and what is observed: ``reach_site_features``, ``reach_site_vision``. A task
is also named by its id in Gymnasium; the name of a module before that, ``my_tasks:mine/LiftMug-v0``, is imported first.
"""

from __future__ import annotations

import importlib
import importlib.util
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.model import checks
from jacokin.tasks import families
from jacokin.tasks.task import Task

FEATURES, VISION, EASY = "features", "vision", "easy"
OBSERVATIONS = (FEATURES, VISION)


@dataclass(frozen=True, slots=True)
class TaskEntry:
    """A task of the list.

    Attributes:
        make: makes the task.
        tags: its tags beside what is observed.
        observations: what may be observed: "features", and "vision" where dm_control has it.
        expert: script of its expert, see `experts.driver`; None if it has none, or is one of ours.
    """

    make: Callable[[], Task]
    tags: tuple[str, ...] = ()
    observations: tuple[str, ...] = OBSERVATIONS
    expert: Callable[[Any], Any] | None = None


TASKS = {
    "reach_site": TaskEntry(families.ReachSite, tags=(EASY,)),
    "reach_duplo": TaskEntry(families.ReachBrick, tags=(EASY,)),
    "lift_brick": TaskEntry(families.LiftBrick),
    "lift_large_box": TaskEntry(families.LiftLargeBox),
    "place_brick": TaskEntry(families.PlaceBrick),
    "place_cradle": TaskEntry(families.PlaceCradle),
    "stack_2_bricks": TaskEntry(partial(families.Stack, 2)),
    "stack_2_bricks_moveable_base": TaskEntry(partial(families.Stack, 2, is_base_fixed=False)),
    "stack_3_bricks": TaskEntry(partial(families.Stack, 3)),
    "stack_3_bricks_random_order": TaskEntry(partial(families.Stack, 3, order_varies=True), observations=(FEATURES,)),
    "stack_2_of_3_bricks_random_order": TaskEntry(partial(families.Stack, 3, 2, order_varies=True)),
    "reassemble_3_bricks_fixed_order": TaskEntry(partial(families.Reassemble, 3)),
    "reassemble_5_bricks_random_order": TaskEntry(partial(families.Reassemble, 5, order_varies=True)),
    **{
        f"reach_{corner}": TaskEntry(partial(families.ReachBrick, at), tags=(EASY,))
        for corner, at in families.CORNERS.items()
    },
}

OURS = frozenset(TASKS)


def register(
    task: Task | Callable[[], Task],
    id: str,  # noqa: A002 - its name in Gymnasium
    *,
    expert: Callable[[Any], Any] | None = None,
) -> None:
    """Make a task of your own known by an id: to `load`, to ``gymnasium.make``, to the command line.

    Args:
        task: a `Task`, a class of tasks, or a function without arguments that makes one. Each environment has a task of
            its own; a `Task` is made again with the same arguments.
        id: as Gymnasium has them: "mine/LiftMug-v0". The same id again replaces the task, but ours cannot be replaced.
        expert: script of a policy: a generator of actions, given the arm (`jacokin.tasks.experts.driver.ArmDriver`).

    Raises:
        InvalidInputError: task or id are something else, or the id is one of ours.
    """
    if not isinstance(id, str) or not re.fullmatch(r"(?:[\w.-]+/)?[\w.-]+-v\d+", id) or id.startswith("jacokin/"):
        raise checks.refusal("id", 'an id such as "mine/LiftMug-v0", in another namespace than "jacokin"', id)
    if not isinstance(task, Task) and not callable(task):
        raise checks.refusal("task", "a Task, a class of tasks or a function that makes one", task)
    if expert is not None and not callable(expert):
        raise checks.refusal("expert", "a function of an ArmDriver that yields actions", expert)
    add(id, TaskEntry(task.again if isinstance(task, Task) else task, expert=expert))


def add(name: str, entry: TaskEntry) -> None:
    """Put a task of somebody's own into the list, and into Gymnasium's if that is installed."""
    TASKS[name] = entry
    if importlib.util.find_spec("gymnasium") is not None:
        importlib.import_module("jacokin.tasks.gym.registration").register_one(name, name)


def own_entry(name: str) -> TaskEntry | None:
    """What another process must be given to know a task; None for ours."""
    return None if name in OURS else TASKS[name]


def receive(name: str, entry: TaskEntry | None) -> None:
    """Take over what `own_entry` gave in another process."""
    if entry is not None and name not in TASKS:
        add(name, entry)


def _environments() -> dict[str, tuple[str, str]]:
    return {f"{name}_{observed}": (name, observed) for name, entry in TASKS.items() for observed in entry.observations}


def names(tag: str | None = None) -> tuple[str, ...]:
    """The names of the environments that `load` makes: ours, then those of tasks that were registered.

    Args:
        tag: only those with this tag: "features", "vision" or "easy"; None for all.

    Raises:
        UnknownNameError: no such tag.
    """
    found = _environments()
    if tag is None:
        return tuple(found)
    checks.choice("tag", tag, (FEATURES, VISION, EASY))
    return tuple(name for name, (task, observed) in found.items() if tag in (observed, *TASKS[task].tags))


def task_and_observations(name: str) -> tuple[str, str]:
    """The name of the task and what is observed, of the name of an environment.

    A name without ``_features`` or ``_vision`` means features.

    Raises:
        UnknownNameError: no such environment; tells the nearest name and lists all.
        InvalidInputError: the module before a colon cannot be imported.
    """
    plain = imported(name)
    if isinstance(plain, str) and plain in TASKS:
        return plain, FEATURES
    found = _environments()
    if not isinstance(plain, str) or plain not in found:
        raise UnknownNameError("task", plain, found)
    return found[plain]


def imported(name: str) -> str:
    """A name without that of the module before a colon, which is imported; that of the task for an id of ours.

    Raises:
        InvalidInputError: it cannot be imported; or not a name but a task, which has none yet.
    """
    if isinstance(name, Task):
        raise InvalidInputError("task must be a name, got a Task: register(task, id='mine/LiftMug-v0') gives it one")
    if not isinstance(name, str) or ":" not in name:
        return of_id(name)
    module, _, plain = name.partition(":")
    try:
        importlib.import_module(module)
    except (ImportError, TypeError, ValueError) as error:  # a TypeError for a relative name
        raise InvalidInputError(f"the module {module!r} before ':' cannot be imported: {error}") from error
    return of_id(plain)


def of_id(name: str) -> str:
    """The name of the task that has an id of ours in Gymnasium, such as "jacokin/ReachSite-v0"; else what was given."""
    if not isinstance(name, str) or not name.startswith("jacokin/") or importlib.util.find_spec("gymnasium") is None:
        return name
    ids = importlib.import_module("jacokin.tasks.gym.registration").IDS
    return next((task for task, each in ids.items() if each == name), name)


def make(task: str) -> Task:
    """A task by its name.

    Raises:
        UnknownNameError: no such task.
        InvalidInputError: what was registered under this name makes something else than a task.
    """
    made = TASKS[checks.choice("task", task, TASKS)].make()
    if not isinstance(made, Task):
        raise InvalidInputError(f"what was registered as {task!r} must make a Task, and made {checks.shown(made)}")
    return made
