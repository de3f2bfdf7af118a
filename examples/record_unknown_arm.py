"""Write the recording that docs/logs.md reads: an arm that nobody knows stands in twelve places, and is looked at.

Each joint of it is a millimetre and 5 mrad off. It moves for a second to the next place and stands there for two, while
a tracker says where the hand is. The recording is one of ROS 2, as `ros2 bag record /joint_states /tracker/hand` makes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import jacokin
from jacokin.model import MeasuredArm, MeasuredJoint, Robot, quat_wxyz
from jacokin.model.measured_arm import joints_fingerprint

STOPS = 12
STANDING, LEG = 2.0, 3.0  # [s] standing, and that with the way to the next place
PERIOD = 0.05  # [s] between messages
NOISE = 3e-4, 1e-3  # [m], [rad] of the tracker
STATES, POSES = "sensor_msgs/msg/JointState", "geometry_msgs/msg/PoseStamped"


def hide(robot: Robot, rng: np.random.Generator) -> Robot:
    """An arm like this one, with errors that only its measurements show."""

    def drawn() -> MeasuredJoint:
        x, y, z = rng.normal(0.0, 0.001, 3).tolist()
        return MeasuredJoint((x, y, z), offset=rng.normal(0.0, 0.005))

    joints = tuple((name, drawn()) for name in robot.joint_names)
    digest = joints_fingerprint(robot.pin_model, robot.base)
    return jacokin.load_robot(calibration=MeasuredArm(robot.name, digest, joints))


def move(robot: Robot, rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times (n,) [s] and joint angles (n, dof) [rad]: from place to place, with standstills."""
    stops = robot.sample(rng, STOPS)
    times = np.arange(0.0, LEG * STOPS - 1.0, PERIOD)
    leg, within = np.divmod(times, LEG)
    part = np.clip(within - STANDING, 0.0, 1.0)[:, None]
    here = leg.astype(int)
    return times, (1.0 - part) * stops[here] + part * stops[np.minimum(here + 1, STOPS - 1)]


def record(robot: Robot, rng: np.random.Generator, folder: str | Path) -> Robot:
    """Write the recording into a new folder; returns the arm that it is of."""
    hidden, store = hide(robot, rng), get_typestore(Stores.ROS2_HUMBLE)

    def make(kind: str, **fields: Any) -> Any:  # Any: of messages, whose classes rosbags makes
        package, name = kind.split("/")
        return store.types[f"{package}/msg/{name}"](**fields)

    stamp = make("builtin_interfaces/Time", sec=0, nanosec=0)  # no clock in headers
    head = make("std_msgs/Header", stamp=stamp, frame_id="tracker")
    names, none = [f"{robot.name}_{name}" for name in robot.joint_names], np.zeros(0)
    with Writer(Path(folder), version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        joint_topic = writer.add_connection("/joint_states", STATES, typestore=store)
        hand_topic = writer.add_connection("/tracker/hand", POSES, typestore=store)
        for time, q in zip(*move(robot, rng), strict=True):
            now = round(1e9 * (time + 1.0))
            said = make("sensor_msgs/JointState", header=head, name=names, position=q, velocity=none, effort=none)
            writer.write(joint_topic, now, store.serialize_cdr(said, STATES))
            T = hidden.forward_kinematics(q)
            x, y, z = T.translation + rng.normal(0.0, NOISE[0], 3)
            w, i, j, k = quat_wxyz(T.rotation @ pin.exp3(rng.normal(0.0, NOISE[1], 3)))
            place = make("geometry_msgs/Point", x=x, y=y, z=z)
            pose = make(
                "geometry_msgs/Pose", position=place, orientation=make("geometry_msgs/Quaternion", x=i, y=j, z=k, w=w)
            )
            writer.write(
                hand_topic, now, store.serialize_cdr(make("geometry_msgs/PoseStamped", header=head, pose=pose), POSES)
            )
    return hidden


if __name__ == "__main__":
    record(jacokin.load_robot(), np.random.default_rng(7), "run")
