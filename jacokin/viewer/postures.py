"""What is true of a configuration, whatever the target: where the parts of the arm are, its margins, its contacts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik.solver import IKSolver
from jacokin.viewer.view import Places


class Postures:
    """Measures configurations of one robot. One thread at a time.

    Attributes:
        solver: the solver; another one of the same robot may take its place.
        robot: its robot.
    """

    def __init__(self, solver: IKSolver) -> None:
        """Prepare working memory."""
        self.solver = solver
        self.robot = solver.robot
        self._data = self.robot.pin_model.createData()

    def pose_of(self, q: Array) -> pin.SE3:
        """T_base_tool at joint values (dof,)."""
        pose = self.robot.forward_kinematics(q, self.solver.frame)
        tool = self.solver.tool
        return pose if tool is None else pose * tool

    def errors(self, q: Array, target: pin.SE3) -> tuple[float, float]:
        """How far the tool is from a target at `q`: position [m], angle [rad]."""
        reached = self.pose_of(q)
        angle = float(np.linalg.norm(pin.log3(reached.rotation.T @ target.rotation)))
        return float(np.linalg.norm(target.translation - reached.translation)), angle

    def ellipsoid(self, q: Array) -> tuple[Array, Array]:
        """The ellipsoid of manipulability: how fast the tool moves each way when the joint rates have length 1.

        Returns:
            Its semi-axes (3,) [m/s for rad/s], longest first, and their directions as the columns of a rotation (3, 3).
        """
        jacobian = self.robot.jacobian(q, self.solver.frame)
        linear = jacobian[:3]
        if self.solver.tool is not None:
            arm = self.robot.forward_kinematics(q, self.solver.frame).rotation @ self.solver.tool.translation
            linear = linear - pin.skew(arm) @ jacobian[3:]
        directions, lengths, _ = np.linalg.svd(linear, full_matrices=True)
        if np.linalg.det(directions) < 0.0:
            directions[:, 2] *= -1.0
        return np.pad(lengths, (0, 3 - len(lengths))), directions

    def places(self, configurations: Sequence[Array] | Array) -> Places:
        """Where the base and the part of each joint are, for k configurations (k, dof)."""
        count, parts = len(configurations), self.robot.dof + 1
        table = np.empty((count, parts, 7))
        model, data = self.robot.pin_model, self._data
        for row, q in enumerate(configurations):
            pin.forwardKinematics(model, data, np.ascontiguousarray(q))
            for part, placement in enumerate(data.oMi):
                table[row, part] = pin.SE3ToXYZQUAT(placement)
        return Places(table[:, :, :3].astype(np.float32), table[:, :, [6, 3, 4, 5]].astype(np.float32))

    def excess(self, q: Array) -> list[tuple[str, float]]:
        """The joints that are outside their limits at `q`, each with by how much [rad]."""
        over = np.maximum(np.maximum(self.robot.lower - q, q - self.robot.upper), 0.0)
        return [(self.robot.joint_names[joint], float(over[joint])) for joint in np.flatnonzero(over > 0.0)]

    def margin(self, q: Array) -> Array:
        """(dof,) distance to the nearer limit [rad]: negative outside, inf where there are none."""
        return np.minimum(q - self.robot.lower, self.robot.upper - q)

    def touching(self, q: Array) -> tuple[tuple[str, str], ...]:
        """Pairs of shapes that touch at `q`; none when the solver does not look."""
        return tuple(self.solver.verifier.touching(q))
