"""The robots that come with the package and where their files lie."""

from __future__ import annotations

from pathlib import Path

DEFAULT_ROBOT = "j2n6s300"

NAMES = ("j2n6s300", "j2n6s200", "j2s6s300", "j2s6s200", "m1n6s300", "m1n6s200")


def part_file(robot: str, part: str) -> Path:
    """The MJCF file of the "arm" or the "hand" of a bundled robot."""
    return urdf_folder() / f"{'jaco' if robot == DEFAULT_ROBOT else robot}_{part}.xml"


def urdf_folder() -> Path:
    """Folder of the generated descriptions: inside the installed package, or beside it in a source tree."""
    package = Path(__file__).resolve().parents[2]
    installed = package / "urdf"
    return installed if installed.is_dir() else package.parent / "urdf"
