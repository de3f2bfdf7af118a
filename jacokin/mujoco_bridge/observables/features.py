"""Fields of elements as observables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Unpack

from numpy.typing import ArrayLike, NDArray

from jacokin.mujoco_bridge.observables.bound import Bound
from jacokin.mujoco_bridge.observables.observable import Observable
from jacokin.mujoco_bridge.observables.options import Options

if TYPE_CHECKING:
    from jacokin.mujoco_bridge.simulation.physics import Physics


class MJCFFeature(Observable):
    """A field of one or several elements, such as ``MJCFFeature("qpos", arm.joints)``."""

    def __init__(self, kind: str, elements: Any, *, index: Any = None, **options: Unpack[Options]) -> None:
        """Observe ``physics.bind(elements).<kind>``.

        Args:
            kind: name of the field, as ``Physics.bind`` knows it.
            elements: one element or a sequence of elements of one kind.
            index: what to take from the field; None takes all of it.
            options: the options of ``Observable``.

        Raises:
            InvalidInputError: an option has a wrong value.
        """
        self._bound = bound = Bound(elements)

        def read(physics: Physics) -> ArrayLike:
            value: NDArray[Any] = getattr(bound(physics), kind)
            return value if index is None else value[index]

        super().__init__(read, **options)
