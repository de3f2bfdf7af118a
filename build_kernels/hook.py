"""Called by hatchling: compile the kernels before a wheel is packed, and name the wheel for its platform."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

sys.path.insert(0, str(Path(__file__).parents[1]))  # hatchling loads this file alone

from build_kernels import library  # found through the line above


class KernelHook(BuildHookInterface):  # type: ignore[type-arg]  # any configuration
    """Builds the library in the source tree, where an editable installation finds it too."""

    def dependencies(self) -> list[str]:
        """What building needs beside `build-system.requires`: a linker, where the system has none."""
        asked_for = "ziglang" in os.environ.get("CC", "")
        return [library.ZIG_REQUIREMENT] if asked_for or not library.linkers() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the library, and add it to the wheel."""
        (path,) = library.build_or_exit()
        build_data["artifacts"].append(path.relative_to(library.ROOT).as_posix())
        build_data["pure_python"] = False
        build_data["tag"] = library.wheel_tag(path.read_bytes())
