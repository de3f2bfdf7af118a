"""The pages of the API name everything that is public."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from types import ModuleType

import pytest

PAGES = Path(__file__).parents[2] / "docs" / "api"
DIRECTIVE = re.compile(r"^::: (\S+)((?:\n +.*)*)", re.MULTILINE)
MEMBERS = re.compile(r"members: \[(.*?)\]")
ROOMS = ("calibration", "ik", "model", "mujoco_bridge", "mujoco_bridge.props", "reachability", "tasks", "viewer")


def shown() -> set[str]:
    """Names that the directives of the pages show: of modules all public ones, or those that are listed."""
    names: set[str] = set()
    for page in PAGES.glob("*.md"):
        for path, options in DIRECTIVE.findall(page.read_text(encoding="utf-8")):
            listed = MEMBERS.search(options)
            try:
                module = importlib.import_module(path)
            except ImportError:
                names.add(path.rpartition(".")[2])
            else:
                names.update(listed[1].split(", ") if listed else vars(module))
    return names


@pytest.mark.parametrize("package", ["jacokin", *(f"jacokin.{room}" for room in ROOMS)])
def test_every_public_name_is_on_a_page(package: str) -> None:
    module = importlib.import_module(package)
    names = {name for name in module.__all__ if not isinstance(getattr(module, name), ModuleType)}
    assert names - {"__version__"} <= shown()
