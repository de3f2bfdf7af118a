"""Makes the tasks known to Gymnasium."""

from __future__ import annotations

from typing import Any

import gymnasium
from gymnasium import VectorizeMode

from jacokin.tasks.ids import IDS

_OWN_VECTORS = VectorizeMode.VECTOR_ENTRY_POINT


class _Kwargs(dict[str, Any]):
    """The arguments of an environment, among which ``gymnasium.make_vec`` looks for those of the vector.

    It refuses ``vector_kwargs`` where a specification has its own kind of vectors, as ours do. But it takes them out of
    these arguments first, with `pop`, which therefore keeps those of our vectors as arguments of the environment.
    """

    _own_vectors = False

    def pop(self, key: str, *default: Any) -> Any:
        """As of a dictionary; ``make_vec`` asks for the mode before it asks for the arguments."""
        found = super().pop(key, *default)
        if key == "vectorization_mode":
            self._own_vectors = found in (None, _OWN_VECTORS, _OWN_VECTORS.value)
        if key != "vector_kwargs" or not self._own_vectors:
            return found
        self.update(found)
        return {}


def register() -> None:
    """Make the tasks known to ``gymnasium.make``; again has no effect."""
    for task, name in IDS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point="jacokin.tasks.gym.make_environment:make_environment",
                vector_entry_point="jacokin.tasks.gym.make_vector:make_vector",
                kwargs=_Kwargs(task=task),
            )
