"""What controls of the panel have in common: who moved them, and setting them on every page."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

import viser

Post = Callable[[str], None]
Value = TypeVar("Value")


class FromClient(Protocol):
    """What viser tells a callback."""

    @property
    def client(self) -> object:
        """Who moved the control; None when the viewer did."""


def from_client(post: Post, name: str) -> Callable[[FromClient], None]:
    """A callback that posts what clients do, and not what the viewer sets itself."""

    def updated(event: FromClient) -> None:
        if event.client is not None:
            post(name)

    return updated


def set_value(control: viser.GuiInputHandle[Value], value: Value) -> None:
    """Bring a control to a value on every page."""
    control.value = value  # type: ignore[misc]  # viser's setter stands behind another method, where mypy misses it
