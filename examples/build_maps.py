"""Build the coarse maps that come with the package, and draw the workspace for the documentation.

python examples/build_maps.py [FOLDER]      jacokin/reachability/maps of the repository if no folder is given

That of the gen3, whose seven joints have no closed form, takes 40 minutes.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from PIL import Image

import jacokin
from jacokin.errors import StructureError
from jacokin.model import NAMES
from jacokin.reachability import Grid, build

ROOT = Path(__file__).resolve().parents[1]
SPACING = 0.05  # [m]
WIDE = 0.08  # [m] where joint 1 has limits: such a map is a block, that of other arms a slice through its axis
DIRECTIONS = 100


def main() -> None:
    given = len(sys.argv) > 1
    folder = Path(sys.argv[1]) if given else ROOT / "jacokin" / "reachability" / "maps"
    for name in NAMES:
        robot = jacokin.load_robot(name)
        shutil.rmtree(folder / name, ignore_errors=True)
        spacing = SPACING if robot.unlimited[0] else WIDE
        try:
            reach = build(robot, folder=folder / name, grid=Grid.around(robot, spacing), orientations=DIRECTIONS)
        except StructureError:
            print(f"{name}: no closed form, no map")
            continue
        assert reach is not None
        size = sum(path.stat().st_size for path in (folder / name).iterdir())
        print(f"{name}: {reach.counts.size} poses, {size / 1000:.0f} kB")
        if name == "j2n6s300" and not given:
            picture = ROOT / "docs" / "images" / "workspace.png"
            reach.plot(picture)
            Image.open(picture).convert("RGB").quantize(128).save(picture, optimize=True)  # a third of the size


if __name__ == "__main__":
    main()
