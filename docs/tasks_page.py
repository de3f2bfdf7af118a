"""Write docs/task_list.md: every task with its picture, rewards, observations, and how often its expert solves it.

python -m docs.tasks_page                              # the page; in the root of the repository
MUJOCO_GL=egl python -m docs.tasks_page --pictures     # the pictures and the curves of rewards too

Numbers of the experts are those of docs/tasks_experts.json.
"""

from __future__ import annotations

import inspect
import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import jacokin.tasks
from jacokin.arrays import Array
from jacokin.tasks.episode import STEPS
from jacokin.tasks.experts.expert import SCRIPTS
from jacokin.tasks.families import CORNERS, BrickTask
from jacokin.tasks.gym.registration import IDS
from jacokin.tasks.registry import TASKS
from jacokin.tasks.task import CAMERA, CONTROL_TIMESTEP, Task

FOLDER = Path(__file__).resolve().parent
PAGE = FOLDER / "task_list.md"
IMAGES = FOLDER / "images" / "tasks"
EXPERTS = FOLDER / "tasks_experts.json"
HEIGHT, WIDTH, DRAWN = 240, 300, 2  # pixels, and how many times larger it is drawn before
SEED = 0  # of the episodes that are shown
#: What is observed of a prop, and its shape.
PROP = {"angular_velocity": "(1, 3)", "linear_velocity": "(1, 3)", "orientation": "(1, 4)", "position": "(1, 3)"}
REMARKS = {
    "lift_large_box": (
        "No solution is known, nor a proof that there is none: opposite faces are 0.18 m apart, the ends of the open "
        "fingers 0.1765 m, and the faces at an upright edge push the fingers off. The expert tries an edge, and loses "
        "it."
    ),
    "stack_3_bricks": (
        "The expert mostly needs more than 250 steps: in 600 it solved 18 of the seeds 0 to 19 at least for a moment, "
        "4 of them within 250 (`python -m benchmarks.experts stack_3_bricks --episodes 20 --steps 600`)."
    ),
    "reassemble_3_bricks_fixed_order": (
        "In 600 steps the expert solves 3 of 20 (seeds 0 to 19): the fingers slide off bricks that are to be pulled "
        "off another, and try again."
    ),
    "reassemble_5_bricks_random_order": "There is no expert: that for three bricks mostly fails to pull off two.",
    **{
        f"reach_{name}": f"The brick lies at x = {box.lower[0]:g}, y = {box.lower[1]:g} m."
        for name, box in CORNERS.items()
    },
}


def page() -> str:
    """The whole page as Markdown."""
    records = experts()
    environments = {name: jacokin.tasks.load(name, seed=SEED) for name in TASKS}
    first = next(iter(environments.values()))
    own = [each.name for each in first.task.features if each.is_proprioceptive]
    spec = first.observation_spec()
    parts = [
        "<!-- Written by docs/tasks_page.py from the tasks. Edit those, not this page. -->",
        "# Every task",
        "[Tasks](tasks.md) shows how to use one. An episode has 250 steps of 0.04 s. Names of environments are those "
        f"of the tasks with `_features` or `_vision` ({_only_some()}). Pictures: the start of an episode, and rewards "
        "of the expert, whose numbers `python -m benchmarks.experts` writes.",
        grid(
            ("task", "Gymnasium", "its expert solves", "mean return"),
            ([f"[{name}](#{name})", f"`{IDS[name]}`", *_record(records.get(name))] for name in TASKS),
        ),
        _origin(records.values()),
        "## Observed in every task",
        "Of the arm and the hand: " + "; ".join(_key(spec[key]) for key in own) + ". All are float64.",
        f"Of a prop that moves, in this order: {'; '.join(f'`PROP/{name}` {shape}' for name, shape in PROP.items())}.",
        "With a camera (`_vision`): `front_close`, (1, 84, 84, 3) uint8, then the arm and the hand, and nothing else.",
        "## Starts, rewards and success",
        "Tool: where its centre point is at first [m]; the fingers are anywhere.",
        _measures({name: environment.task for name, environment in environments.items()}),
        *(part for name, environment in environments.items() for part in _section(name, environment, own)),
    ]
    return "\n\n".join(parts) + "\n"


def grid(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    return "\n".join("| " + " | ".join(line) + " |" for line in (head, ["---"] * len(head), *rows))


def experts() -> dict[str, dict[str, Any]]:
    """What is recorded of each expert."""
    if not EXPERTS.exists():
        return {}
    return {record["name"]: record for record in json.loads(EXPERTS.read_text(encoding="utf-8"))}


def _record(record: dict[str, Any] | None) -> list[str]:
    if record is None:
        return ["", ""]
    return [f"{record['successes']} of {record['episodes']}", f"{record['mean_return']:.0f}"]


def _origin(records: Iterable[dict[str, Any]]) -> str:
    """Where the numbers of the experts come from."""
    found = {f"seeds {record['seeds'][0]} to {record['seeds'][-1]}, MuJoCo {record['mujoco']}" for record in records}
    return f"Episodes of the experts: {'; '.join(sorted(found))}." if found else "No expert has been measured."


def _only_some() -> str:
    """The tasks that do not have both observations."""
    few = {name: task.observations[0] for name, task in TASKS.items() if len(task.observations) == 1}
    return ", ".join(f"`{name}` has `_{observed}` only" for name, observed in few.items())


def _measures(tasks: dict[str, Task]) -> str:
    """Where the tool starts, the reward and the success of each task; a row for all of which these are the same."""
    rows: dict[tuple[str, str, str], list[str]] = {}
    for name, task in tasks.items():
        lower, upper = ([f"{value:g}" for value in bound] for bound in task.tool_box)
        box = ", ".join(f"{axis} {low}..{high}" for axis, low, high in zip("xyz", lower, upper, strict=True))
        reward = _sentence(task.reward)
        if isinstance(task, BrickTask):
            close = f"weighs {task.close_weight:g} of clicking" if task.close_weight else "counts nothing"
            reward += f" Being close {close}."
        rows.setdefault((box, reward, _sentence(task.success).removeprefix("Whether ")), []).append(name)
    return grid(
        ("task", "tool", "reward", "solved"),
        ([", ".join(f"`{name}`" for name in names), *row] for row, names in rows.items()),
    )


def _section(name: str, environment: jacokin.tasks.Environment, own: Sequence[str]) -> list[str]:
    """One task."""
    task, spec = environment.task, environment.observation_spec()
    keys = list(spec)
    start = keys.index(own[0])
    before, after = keys[:start], keys[start + len(own) :]
    props = [key.removesuffix("/orientation") for key in after if key.endswith("/orientation")]
    other = [key for key in after if key.rpartition("/")[0] not in props]
    observed = [f"{_key(spec[key])}, first" for key in before]
    observed += [f"the prop{'s' if props[1:] else ''} {', '.join(f'`{prop}`' for prop in props)}"] if props else []
    observed += [_key(spec[key]) for key in other]
    pictures = [f"![Start]({_shown(_picture(name))})"]
    if _curve(name).exists():
        pictures.append(f"![Rewards]({_shown(_curve(name))})")
    remark = [REMARKS[name]] if name in REMARKS else []
    return [
        f"## {name}",
        " ".join([_sentence(task), *_bricks(task), *remark]),
        " ".join(pictures),
        f"Observed besides: {'; '.join(observed)}.",
    ]


def _sentence(thing: object) -> str:
    """The first sentence of a docstring."""
    return (inspect.getdoc(thing) or "").splitlines()[0]


def _bricks(task: Task) -> list[str]:
    """What distinguishes tasks with several bricks."""
    if not isinstance(task, BrickTask):
        return []
    base = "the bottom one stands still" if task._is_base_fixed else "all move"
    order = "drawn, and observed" if task._order_varies else "fixed"
    return [f"{task.count} bricks, {task.height} in the stack; {base}; order {order}."]


def _key(spec: Any) -> str:
    """A key of an observation, and its shape; of another type than float64, that too."""
    kind = "" if spec.dtype == np.float64 else f" {np.dtype(spec.dtype).name}"
    return f"`{spec.name}` ({', '.join(map(str, spec.shape))}){kind}"


def _picture(name: str) -> Path:
    return IMAGES / f"{name}.png"


def _curve(name: str) -> Path:
    return IMAGES / f"{name}_rewards.svg"


def _shown(path: Path) -> str:
    return path.relative_to(FOLDER).as_posix()


def draw(name: str) -> None:
    """Draw the start of an episode, and the rewards of the expert's."""
    from PIL import Image

    environment = jacokin.tasks.load(name, seed=SEED)
    step = environment.reset()
    drawn = environment.physics.render(HEIGHT * DRAWN, WIDTH * DRAWN, CAMERA)
    smaller = Image.fromarray(drawn).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)
    smaller.quantize(method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(_picture(name), optimize=True)
    if name in SCRIPTS:
        expert, rewards = jacokin.tasks.expert(name), []
        while not step.last():
            step = environment.step(expert(step.observation))
            rewards.append(step.reward)
        _curve(name).write_text(svg(np.array(rewards)), encoding="utf-8")


def svg(rewards: Array) -> str:
    """Rewards over time as a picture of lines, whose colours suit light and dark pages."""
    left, top, wide, high = 34, 12, WIDTH - 46, HEIGHT - 44
    x = left + wide * (np.arange(len(rewards)) + 1) / STEPS
    y = top + high * (1.0 - rewards)
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" font-family="sans-serif" '
        'font-size="11" fill="#808080">',
        f'<rect x="{left}" y="{top}" width="{wide}" height="{high}" fill="none" stroke="#808080"/>',
        f'<polyline points="{points}" fill="none" stroke="#2f7fc1" stroke-width="2"/>',
    ]
    lines += [
        f'<text x="{left - 5}" y="{top + high * (1 - value) + 4:g}" text-anchor="end">{value:g}</text>'
        for value in (0.0, 0.5, 1.0)
    ]
    for seconds in (0, 5, 10):
        at = left + wide * seconds / (STEPS * CONTROL_TIMESTEP)
        lines.append(f'<text x="{at:g}" y="{top + high + 14}" text-anchor="middle">{seconds}</text>')
    lines.append(f'<text x="{left + wide / 2:g}" y="{HEIGHT - 3}" text-anchor="middle">reward over time [s]</text>')
    return "\n".join([*lines, "</svg>", ""])


if __name__ == "__main__":
    if "--pictures" in sys.argv[1:]:
        IMAGES.mkdir(parents=True, exist_ok=True)
        for task_name in TASKS:
            draw(task_name)
    PAGE.write_text(page(), encoding="utf-8")
