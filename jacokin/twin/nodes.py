"""What the nodes of both versions of ROS share: `Ticker`, as time passes, and `Camera`, whose pictures they publish."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jacokin.model import checks
from jacokin.mujoco_bridge import Physics
from jacokin.twin.faults import TICK

BEHIND = 0.1  # [s] what is later than this is not made up for


@dataclass(slots=True)
class Ticker:
    """How simulated time passes."""

    speed: float = 1.0
    """Simulated seconds in a second; inf for as many as there can be."""
    late: int = 0
    """How many ticks were more than 0.1 s late."""

    def run(
        self, tick: Callable[[], None], every: Iterable[tuple[float, Callable[[], None]]], goes_on: Callable[[], bool]
    ) -> None:
        """Tick until it is enough.

        Args:
            tick: lets 10 ms of simulated time pass.
            every: what else is done, and in which simulated time [s].
            goes_on: whether to go on.
        """
        jobs = [(max(1, round(period / TICK)), job) for period, job in every]
        due, count = time.monotonic(), 0
        before = sys.getswitchinterval()
        # [s] after which a thread gives way to a tick: the 5 ms of Python, several times a tick, are more than one.
        sys.setswitchinterval(2e-4)
        try:
            while goes_on():
                tick()
                count += 1
                for ticks, job in jobs:
                    if count % ticks == 0:
                        job()
                if math.isinf(self.speed):
                    continue
                due += TICK / self.speed
                ahead = due - time.monotonic()
                if ahead > 0.0:
                    time.sleep(ahead)
                elif ahead < -BEHIND:
                    self.late, due = self.late + 1, time.monotonic()
        finally:
            sys.setswitchinterval(before)


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
    period: float = 0.1
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

    @property
    def topic(self) -> str:
        """Where its pictures are published."""
        return f"/camera/{self.name}/image_raw"

    def job(self, publisher: Any, kind: Any, now: Callable[[], Any]) -> tuple[float, Callable[[], None]]:  # Any: ROS's
        """How often [s] and what for a ticker to do: publish a picture, as `message`."""
        return self.period, lambda: publisher.publish(self.message(kind, now()))

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
