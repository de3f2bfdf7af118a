"""`Camera`: a camera of a simulated scene, whose pictures a node publishes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

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

    def message(self, kind: Any, stamp: Any) -> Any:  # Any: of a version of ROS
        """A picture of now as a sensor_msgs/Image.

        Args:
            kind: the class of the message.
            stamp: when it is.
        """
        picture: NDArray[np.uint8] = self.physics.render(*self.size, self.full_name)
        message = kind(encoding="rgb8", height=picture.shape[0], width=picture.shape[1])
        message.step, message.data = 3 * picture.shape[1], picture.tobytes()
        message.header.stamp, message.header.frame_id = stamp, self.name
        return message
