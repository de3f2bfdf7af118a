"""Called by hatchling: compile the kernels before a wheel is packed, and name the wheel for its platform.

Where $JACOKIN_TARGET names another machine, as `python -m build_kernels --target` does, the wheel is for that one.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

sys.path.insert(0, str(Path(__file__).parents[1]))  # hatchling loads this file alone

from build_kernels import library, linking  # found through the line above
from build_kernels.targets import TARGETS, WHEELS

#: Names another machine.
ELSEWHERE = "JACOKIN_TARGET"


class KernelHook(BuildHookInterface):  # type: ignore[type-arg]  # any configuration
    """Builds the library in the source tree, where an editable installation finds it too."""

    def dependencies(self) -> list[str]:
        """What building needs beside `build-system.requires`: a linker, where the system has none."""
        asked_for = "ziglang" in os.environ.get("CC", "") or os.environ.get(ELSEWHERE)
        return [linking.ZIG_REQUIREMENT] if asked_for or not linking.linkers() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the library, and add it to the wheel."""
        build_data["pure_python"] = False
        if name := os.environ.get(ELSEWHERE):
            if name not in WHEELS:
                raise SystemExit(
                    f"jacokin cannot be built: ${ELSEWHERE} is {name}; there are wheels for {', '.join(WHEELS)}"
                )
            (path,) = library.build_or_exit([name], whole=True)
            build_data["force_include"][str(path)] = f"jacokin/kernels/{path.name}"
            build_data["tag"] = linking.wheel_tag(path.read_bytes(), TARGETS[name])
            return
        (path,) = library.build_or_exit()
        build_data["artifacts"].append(path.relative_to(library.ROOT).as_posix())
        build_data["tag"] = linking.wheel_tag(path.read_bytes())
