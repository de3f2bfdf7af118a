"""`jacokin demo`: the example targets solved, and the arm drawn at an answer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from jacokin import lazy

if TYPE_CHECKING:
    from jacokin.cli.demo.picture import render as render
    from jacokin.cli.demo.picture import write_png as write_png

__all__, __getattr__, __dir__ = lazy.door(__name__, {"jacokin.cli.demo.picture": ("render", "write_png")})
