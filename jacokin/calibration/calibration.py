"""`Calibration`: the arm that was found, to load, to write and to report."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.calibration.arm_model import ArmKinematics
from jacokin.calibration.findings import Findings
from jacokin.calibration.report import write_report
from jacokin.model import checks
from jacokin.model.loading import load_robot
from jacokin.model.robot import Robot
from jacokin.model.written_descriptions import write_mjcf, write_urdf


class Calibration(Findings):
    """What `calibrate` returns: what was found, as an arm and as files. Immutable."""

    @cached_property
    def robot(self) -> Robot:
        """The calibrated arm, loaded as the described one was.

        Raises:
            ModelError: transmissions have a scale or joints give under load, which no chain of joints can hold.
        """
        source = self.described.source
        return load_robot(
            source.bundled or source.path,
            base=source.base,
            tip=source.tip,
            finger_angle=self.described.finger_angle,
            limits={joint: (low, high) for joint, low, high in source.limits} or None,
            package_dirs=source.package_dirs,
            calibration=self.measured_arm,
        )

    def forward_kinematics(self, q: ArrayLike, frame: str | None = None) -> pin.SE3:
        """Pose of a frame in the base at reported angles (dof,) [rad]; transmissions and sag included.

        Raises:
            InvalidInputError: `q` malformed.
            UnknownNameError: no such frame.
        """
        rows = self.described.configuration(q)[np.newaxis]
        chain = ArmKinematics(self.described, frame, sags=bool(self.measured_arm.drives))
        at = chain.at(rows, self.model.joints(self.fit.x))
        return pin.SE3(at.rotation[0], at.position[0])

    def save(self, path: str | Path) -> None:
        """Write the TOML file that `load_robot(calibration=...)` reads.

        Raises:
            InvalidInputError: it cannot be written.
        """
        self.measured_arm.save(path)

    def write_urdf(self, path: str | Path) -> None:
        """As `jacokin.model.write_urdf` of `robot`. Errors as there and as `robot`."""
        write_urdf(self.robot, path)

    def write_mjcf(self, path: str | Path) -> None:
        """As `jacokin.model.write_mjcf` of `robot`. Errors as there and as `robot`."""
        write_mjcf(self.robot, path)

    def report(self, path: str | Path) -> None:
        """Write a page (HTML, one file, with pictures) of what was found and how sure it is.

        Raises:
            InvalidInputError: it cannot be written.
            MissingExtraError: matplotlib is not installed.
        """
        write_report(self, checks.path("path", path))
