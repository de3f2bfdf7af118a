"""Draw the pictures of the tutorials again, with the code that stands beside them.

    MUJOCO_GL=egl python -m docs.pictures        # in the root of the repository

Runs the Python blocks of the pages in a scratch folder, and keeps the PNG files that they write.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

from tests.robot_files import ur5_text

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
LARGE = 60_000  # [byte]
COLOURS = 128
PAGES = ("tutorials", "sets_of_solutions", "real_arm")
BLOCK = re.compile(r"^```python\n(.*?)^```", re.M | re.S)


def main() -> None:
    """Run every page; a page that fails ends the program with its error."""
    for page in PAGES:
        text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "examples").symlink_to(ROOT / "examples")
            (folder / "ur5.urdf").write_text(ur5_text(), encoding="utf-8")
            (folder / "page.py").write_text("\n".join(BLOCK.findall(text)), encoding="utf-8")
            environment = {**os.environ, "PYTHONPATH": str(ROOT)}
            subprocess.run([sys.executable, "page.py"], cwd=folder, env=environment, check=True)
            for picture in sorted(folder.glob("*.png")):
                keep(picture, IMAGES / picture.name)


def keep(picture: Path, target: Path) -> None:
    """Copy a picture; a large one with fewer colours."""
    if picture.stat().st_size <= LARGE:
        shutil.copyfile(picture, target)
        return
    with Image.open(picture) as image:
        image.convert("RGB").quantize(COLOURS).save(target, optimize=True)


if __name__ == "__main__":
    main()
