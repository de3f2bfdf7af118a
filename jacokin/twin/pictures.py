"""`Camera`: a camera of a simulated scene, whose pictures a node publishes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from jacokin.model import checks
from jacokin.mujoco_bridge import Physics

PERIOD = 0.1  # [s] from picture to picture


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A camera of a scene."""

    physics: Physics
    """The simulation."""
    name: str
    """Its short name, such as "wrist"."""
    full_name: str
    """Its name in MuJoCo's model."""
    size: tuple[int, int]
    """Rows and columns [pixels]."""
    period: float = PERIOD
    """From picture to picture [s]."""

    @classmethod
    def of(cls, physics: Physics, name: str, size: tuple[int, int]) -> Camera:
        """Find a camera by the end of its name.

        Raises:
            UnknownNameError: no such camera.
        """
        model = physics.model
        names = {str(model.camera(number).name).rpartition("/")[2]: number for number in range(model.ncam)}
        number = names[checks.choice("camera", name, names)]
        return cls(physics, name, str(model.camera(number).name), size)

    def take(self) -> NDArray[np.uint8]:
        """A picture, (height, width, 3) red, green, blue."""
        picture: NDArray[np.uint8] = self.physics.render(*self.size, self.full_name)
        return picture
