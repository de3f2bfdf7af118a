"""Draw every branch of one pose within the limits side by side: one pose of the hand, eight of the arm.

MUJOCO_GL=egl python -m examples.draw_branches docs/images/branches.png
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import jacokin
from jacokin.cli.picture import render, write_png

TARGET = jacokin.pose([0.2, -0.2, 0.5], rpy=[math.pi / 2, 0.0, 0.6])
COLUMNS = 4
CROP = (slice(100, 660), slice(250, 730))  # rows, columns of the picture around the arm [pixel]
SHRINK = 2
GAP = 4  # white, between the panels [pixel]


def main(path: Path) -> None:
    branches = jacokin.IKSolver(jacokin.load_robot()).solve_all(TARGET)
    panels = [_framed(_small(render(q)[0][CROP])) for q in branches.q_within_limits]
    panels += [np.full_like(panels[0], 255)] * (-len(panels) % COLUMNS)
    rows = [np.concatenate(panels[first : first + COLUMNS], axis=1) for first in range(0, len(panels), COLUMNS)]
    write_png(path, np.concatenate(rows, axis=0))


def _small(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A picture (height, width, 3) shrunk by averaging."""
    height, width, _ = picture.shape
    blocks = picture.reshape(height // SHRINK, SHRINK, width // SHRINK, SHRINK, 3)
    small: NDArray[np.uint8] = blocks.mean(axis=(1, 3)).astype(np.uint8)
    return small


def _framed(panel: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A panel with a white border of half a gap."""
    return np.pad(panel, ((GAP // 2, GAP // 2), (GAP // 2, GAP // 2), (0, 0)), constant_values=255)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
