"""`register`, which makes the tasks known to Gymnasium under their `IDS`."""

from __future__ import annotations

from typing import Any

import gymnasium
from gymnasium import VectorizeMode

_NAMES = {
    "reach_site": "ReachSite",
    "reach_duplo": "ReachBrick",
    "lift_brick": "LiftBrick",
    "lift_large_box": "LiftBox",
    "place_brick": "PlaceBrick",
    "place_cradle": "PlaceCradle",
    "stack_2_bricks": "Stack2",
    "stack_2_bricks_moveable_base": "Stack2MoveableBase",
    "stack_3_bricks": "Stack3",
    "stack_3_bricks_random_order": "Stack3RandomOrder",
    "stack_2_of_3_bricks_random_order": "Stack2Of3RandomOrder",
    "reassemble_3_bricks_fixed_order": "Reassemble3",
    "reassemble_5_bricks_random_order": "Reassemble5RandomOrder",
    "reach_top_left": "ReachTopLeft",
    "reach_top_right": "ReachTopRight",
    "reach_bottom_left": "ReachBottomLeft",
    "reach_bottom_right": "ReachBottomRight",
}

IDS = {task: f"jacokin/{name}-v0" for task, name in _NAMES.items()}
"""The id of each task."""

EPISODE_STEPS = 250  # those of the time limit, which cannot be asked for without loading MuJoCo

_OWN_VECTORS = VectorizeMode.VECTOR_ENTRY_POINT


class _Kwargs(dict[str, Any]):
    """The arguments of an environment, among which ``gymnasium.make_vec`` looks for those of the vector.

    It refuses ``vector_kwargs`` where a specification has its own kind of vectors, as ours do. But it takes them out of
    these arguments first, with `pop`, which therefore keeps those of our vectors as arguments of the environment.
    """

    _own_vectors = False

    def pop(self, key: str, *default: Any) -> Any:
        """Take an argument out; ``make_vec`` asks for the mode before it asks for the arguments."""
        found = super().pop(key, *default)
        if key == "vectorization_mode":
            self._own_vectors = found in (None, _OWN_VECTORS, _OWN_VECTORS.value)
        if key != "vector_kwargs" or not self._own_vectors:
            return found
        self.update(found)
        return {}


def register() -> None:
    """Make our tasks known to ``gymnasium.make``; again has no effect."""
    for task, name in IDS.items():
        if name not in gymnasium.registry:
            register_one(task, name, EPISODE_STEPS)


def register_one(task: str, name: str, steps: int | None = None) -> None:
    """Make a task known to ``gymnasium.make`` by an id.

    Args:
        task: its name.
        name: the id.
        steps: of an episode; None where only the task itself knows, which truncates episodes in any case.
    """
    gymnasium.registry.pop(name, None)
    gymnasium.register(
        name,
        entry_point="jacokin.tasks.gym.environment:make_environment",
        vector_entry_point="jacokin.tasks.gym.vector:VectorTaskEnv",
        max_episode_steps=steps,
        kwargs=_Kwargs(task=task),
    )
