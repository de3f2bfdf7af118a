"""`show`, by which results open the viewer, which lies far above them and is found by its name; and displays."""

from __future__ import annotations

import importlib
import os
import sys
from typing import Protocol, Self


def has_display() -> bool:
    """Whether windows can be opened; elsewhere than on Linux they always can, as far as can be known."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


class Shown(Protocol):
    """What runs then: a `jacokin.viewer.Viewer`."""

    @property
    def url(self) -> str:
        """Address of the page, with the token that lets it in."""

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until the viewer is closed, or so long [s]; returns whether it is."""

    def close(self) -> None:
        """Stop serving."""

    def __enter__(self) -> Self:
        """The viewer itself."""

    def __exit__(self, *raised: object) -> None:
        """Close."""


def show(shown: object, of: object, options: dict[str, object]) -> Shown:
    """Open the viewer with a result, see `jacokin.viewer.show`."""
    viewer: Shown = importlib.import_module("jacokin.viewer").show(shown, of, **options)
    return viewer
