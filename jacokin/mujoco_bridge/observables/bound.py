"""Elements of a model that are bound once to the physics they are read from."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from jacokin.errors import InvalidInputError, shown
from jacokin.mujoco_bridge.simulation.physics import Physics

if TYPE_CHECKING:
    from jacokin.mujoco_bridge.simulation.binding import Binding


class Bound:
    """Elements whose binding in the last physics is kept."""

    def __init__(self, elements: Any) -> None:
        """Keep one element, or a sequence of elements of one kind."""
        self._elements = elements
        self._physics: Physics | None = None
        self._binding: Binding

    def replace(self, replaced: Callable[[Any], Any]) -> None:
        """Bind what ``replaced`` gives for the elements from now on."""
        self._elements = replaced(self._elements)
        self._physics = None

    def __call__(self, physics: Physics) -> Binding:
        """Return the binding of the elements in this physics.

        Raises:
            InvalidInputError: not a Physics, or one without these elements.
        """
        if physics is None or physics is not self._physics:
            if not isinstance(physics, Physics):
                raise InvalidInputError(f"physics must be a Physics, made by Physics.from_entity, got {shown(physics)}")
            self._binding = physics.bind(self._elements)
            self._physics = physics
        return self._binding
