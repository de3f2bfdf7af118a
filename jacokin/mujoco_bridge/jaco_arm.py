"""The arms of the bundled Jacos and Micos, without their hands, in MuJoCo."""

from __future__ import annotations

import functools
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from jacokin.model import checks
from jacokin.model.descriptions import bundled
from jacokin.model.loading import load_robot
from jacokin.model.measured_arm import MeasuredArm
from jacokin.model.robot import Robot
from jacokin.model.written_descriptions import move_joints
from jacokin.mujoco_bridge.base import BundledPart, RobotArm, RobotHand
from jacokin.mujoco_bridge.observables import Bound, JointsObservables, Observable, observable
from jacokin.mujoco_bridge.observations import sin_cos
from jacokin.mujoco_bridge.simulation.physics import Physics, check_physics


class JacoArm(BundledPart, RobotArm):
    """The arm: its joints, each with an actuator and a 3-axis torque sensor.

    Attributes:
        actuation: what the controls are: "velocity" [rad/s], "torque" [N m] or "position" [rad].
    """

    def _build(
        self,
        name: str | None = None,
        robot: str = bundled.DEFAULT_ROBOT,
        calibration: str | Path | MeasuredArm | None = None,
        actuation: str = "velocity",
    ) -> None:
        """Build the arm.

        Args:
            name: replaces ``jaco_arm`` in the names of its elements.
            robot: the bundled robot whose arm it is.
            calibration: how it differs from that robot, as in `load_robot`.
            actuation: what its actuators take: "velocity", "torque" or "position".

        Raises:
            UnknownNameError: no bundled Jaco has this name, or no actuation; lists the valid ones.
            ModelError: the calibration is damaged or another arm's.
        """
        rows = bundled.arm_joints(checks.choice("robot", robot, bundled.JACOS))
        self.actuation = checks.choice("actuation", actuation, ("velocity", "torque", "position"))
        groups = {joint: row["group"] for joint, row in rows.items()}
        spec = self._read("arm", robot, name, groups, self.actuation)
        self._measured = None if calibration is None else load_robot(robot, calibration=calibration)
        if self._measured is not None:
            move_joints(spec, self._measured)
        self._wrist_site = spec.site("wristsite")
        self._joint_torque_sensors = [_add_torque_sensor(spec, joint) for joint in self._joints]
        self._bound_sensors, self._bound_joints = Bound(self._joint_torque_sensors), Bound(self._joints)

    def _build_observables(self) -> JacoArmObservables:
        return JacoArmObservables(self)

    @property
    def robot(self) -> Robot:
        """The arm for kinematics, with its calibration; its hand is open."""
        return _load_once(self._robot_name) if self._measured is None else self._measured

    @property
    def joint_torque_sensors(self) -> list[mujoco.MjsSensor]:
        """The 3-axis torque sensors, one per joint [N m]."""
        return self._joint_torque_sensors

    @property
    def wrist_site(self) -> mujoco.MjsSite:
        """The site that hands are attached to."""
        return self._wrist_site

    def joint_torques(self, physics: Physics) -> NDArray[np.float64]:
        """Torques about the joint axes, (n,) [N m]: the observable `joints_torque` without the logarithm of `make_arm`.

        What turns the links: of motors, damping and friction, less what the rotors take. At rest they hold the arm up,
        and are those of `Robot.gravity`.

        Raises:
            InvalidInputError: the physics does not hold this arm.
        """
        torques: NDArray[np.float64] = np.vecdot(
            self._bound_sensors(physics).sensordata, self._bound_joints(physics).axis
        )
        return torques

    def set_home(self, physics: Physics) -> None:
        """Set the home configuration at rest, with attached hands open.

        Home is within the limits and free of contact, unlike q = 0, where a simulation starts.

        Raises:
            InvalidInputError: the physics does not hold this arm.
        """
        joints = check_physics(physics).bind(self.joints)
        joints.qpos = bundled.variant(self._robot_name)["home"]
        joints.qvel = 0.0
        physics.bind(self.actuators).ctrl = joints.qpos if self.actuation == "position" else 0.0
        for entity in self.iter_entities(exclude_self=True):
            if isinstance(entity, RobotHand):
                fingers = getattr(entity, "joints", ())
                if len(fingers):
                    physics.bind(fingers).qvel = 0.0
                entity.set_grasp(physics, 0.0)
        physics.after_reset()


@functools.cache
def _load_once(name: str) -> Robot:
    return load_robot(name)


def _add_torque_sensor(spec: mujoco.MjSpec, joint: mujoco.MjsJoint) -> mujoco.MjsSensor:
    """Add a torque sensor at the origin of the joint's body; it measures along the axes of that body."""
    site = joint.parent.add_site(name=f"{joint.name}_site", size=[1e-3] * 3, group=4)  # [m], and not drawn
    return spec.add_sensor(
        name=f"{joint.name}_torque",
        type=mujoco.mjtSensor.mjSENS_TORQUE,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        objname=site.name,
    )


class JacoArmObservables(JointsObservables):
    """Joint positions as (sin, cos), joint velocities, joint torques."""

    @observable
    def joints_pos(self) -> Observable:
        """Joint angles as pairs (sin, cos), (n, 2): bounded, though most joints have no limits.

        ``angles_from_sin_cos`` converts them to angles.
        """
        joints = Bound(self._entity.joints)

        def read(physics: Physics) -> NDArray[np.float64]:
            return sin_cos(joints(physics).qpos)

        return Observable(read)

    @observable
    def joints_torque(self) -> Observable:
        """Torques about the joint axes, (n,) [N m].

        Each 3-axis sensor projected on the axis of its joint. The sensor measures what the child body exerts on its
        parent, so an external torque on the child has the opposite sign here.
        """
        return Observable(self._entity.joint_torques)
