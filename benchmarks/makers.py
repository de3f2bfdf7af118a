"""Arms as their makers ship them: do the real files give the joints and the tool that their makers use?

`makers.toml` has what is expected, by hand. `python -m benchmarks.makers FOLDER` looks for the files of the table below
a folder, by the ends of their paths, loads them as they are and compares. Robots of more than one arm must be refused
with the frame and the base that makers use, and load with these. Nothing is written.
"""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import jacokin
from jacokin import JacokinError, Robot

TABLE = Path(__file__).with_name("makers.toml")


@dataclass(frozen=True, slots=True)
class Arm:
    """One arm, and what is expected of its file."""

    name: str
    file: str
    """The end of its path."""
    source: str
    """Where its joints and its tool are said."""
    joints: tuple[str, ...]
    frame: str
    parts: str
    """A skeleton, as `tests.robot_files.skeleton` takes it."""
    made: str = ""
    """How the file is made, where it is not shipped."""
    base: str | None = None
    """Where makers begin the arm, behind the joints of a torso."""
    refused: bool = False
    """Whether the file has more than one arm; one with a base has, too."""

    def problem(self, path: Path) -> str:
        """What is wrong with how a file of this arm loads; "" for nothing."""
        if self.refused or self.base is not None:
            return self._problem_of_cure(path)
        try:
            return self._misfit(jacokin.load_robot(path))
        except JacokinError as error:
            return f"refused: {error}"

    def _problem_of_cure(self, path: Path) -> str:
        try:
            loaded = jacokin.load_robot(path)
        except JacokinError as error:
            sentence = str(error)
        else:
            return f"not refused: joints {', '.join(loaded.joint_names)}"
        if "tip=..." not in sentence or self.frame not in sentence:
            return f"refused without naming tip={self.frame!r}: {sentence}"
        if self.base is not None and f"base={self.base!r}" not in sentence:
            return f"refused without naming base={self.base!r}: {sentence}"
        return self._misfit(jacokin.load_robot(path, tip=self.frame, base=self.base))

    def _misfit(self, robot: Robot) -> str:
        if robot.joint_names != self.joints:
            return f"joints {', '.join(robot.joint_names)}"
        return "" if robot.default_frame == self.frame else f"frame {robot.default_frame}"


def read_table() -> list[Arm]:
    """The rows of `makers.toml`."""
    rows = tomllib.loads(TABLE.read_text(encoding="utf-8"))["arm"]
    return [Arm(**row | {"joints": tuple(row["joints"])}) for row in rows]


def find(arm: Arm, paths: Sequence[Path]) -> list[Path]:
    """The files of an arm among some: those whose paths end as its own does."""
    end = Path(arm.file).parts
    return [path for path in paths if path.parts[-len(end) :] == end]


def main(arguments: Sequence[str] | None = None) -> None:
    """Compare every file of the table below a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    options = parser.parse_args(arguments)
    paths = [path for suffix in (".urdf", ".xml") for path in sorted(options.folder.rglob(f"*{suffix}"))]
    right, wrong, missing = 0, 0, list[str]()
    for arm in read_table():
        found = find(arm, paths)
        if not found:
            missing.append(arm.name)
        for path in found:
            problem = arm.problem(path)
            right, wrong = right + (not problem), wrong + bool(problem)
            print(f"{arm.name:32} {str(path.relative_to(options.folder))[-70:]:70} {problem or 'as expected'}")
    print(f"\n{right} files as expected, {wrong} not; no file of {', '.join(missing) or 'none'}")


if __name__ == "__main__":
    main()
