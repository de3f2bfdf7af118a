"""A client of kinova-ros' driver that does what those of kinova_demo do; prints JSON about it.

With the word `pushes` it does what they do with torques and forces, and what lines up poses and moves the tool.

They go to where they are told from what the driver says that it leads the arm to: `joint_command` [deg],
`cartesian_command` [m, and Euler angles in rad, R = Rx Ry Rz], `finger_position` [turns].
"""

from __future__ import annotations

import itertools
import json
import math
import os
import statistics
import sys
import time
from typing import Any

import actionlib
import rospy
from geometry_msgs.msg import PoseStamped, Vector3, WrenchStamped
from sensor_msgs.msg import JointState

from jacokin.twin.ros1_messages import kinova_msgs

DRIVER = "/j2n6s300_driver"
messages = kinova_msgs()
rospy.init_node("client", disable_signals=True)
record: dict[str, Any] = {"states": {}}


def hear(topic: str, kind: Any) -> Any:
    return rospy.wait_for_message(f"{DRIVER}/out/{topic}", kind, timeout=10.0)


def call(name: str, kind: Any, *words: Any, **named: Any) -> Any:
    rospy.wait_for_service(f"{DRIVER}/in/{name}", timeout=10.0)
    return rospy.ServiceProxy(f"{DRIVER}/in/{name}", kind)(*words, **named)


def stream(topic: str, kind: Any, *values: float) -> None:
    """A second of a command at 100 Hz, and half a second to stand."""
    publisher = rospy.Publisher(f"{DRIVER}/in/{topic}", kind, queue_size=1)
    while not publisher.get_num_connections():
        time.sleep(0.01)
    rate = rospy.Rate(100)
    for _ in range(100):
        publisher.publish(*values)
        rate.sleep()
    time.sleep(0.5)


def ask(action: str, kind: Any, goal: Any, seconds: float = 20.0) -> int:
    client = actionlib.SimpleActionClient(f"{DRIVER}/{action}", kind)
    assert client.wait_for_server(rospy.Duration(10.0))
    client.send_goal(goal)
    assert client.wait_for_result(rospy.Duration(seconds))
    return int(client.get_state())


def angles() -> list[float]:
    message = hear("joint_angles", messages.JointAngles)
    return [getattr(message, f"joint{j + 1}") for j in range(6)]


def quaternion_xyzw(x: float, y: float, z: float) -> tuple[float, ...]:
    """Of R = Rx Ry Rz [rad]."""
    half = [(math.sin(angle / 2.0), math.cos(angle / 2.0)) for angle in (x, y, z)]
    (sx, cx), (sy, cy), (sz, cz) = half
    return (
        sx * cy * cz + cx * sy * sz,
        cx * sy * cz - sx * cy * sz,
        cx * cy * sz + sx * sy * cz,
        cx * cy * cz - sx * sy * sz,
    )


def apart(one: Any, other: Any) -> tuple[float, float]:
    """Between two poses [m, rad]."""
    at, there = one.pose.position, other.pose.position
    p, q = one.pose.orientation, other.pose.orientation
    cosine = abs(p.x * q.x + p.y * q.y + p.z * q.z + p.w * q.w)
    return math.dist((at.x, at.y, at.z), (there.x, there.y, there.z)), 2.0 * math.acos(min(1.0, cosine))


def push(record: dict[str, Any]) -> None:
    """What robot_control_modules.py does with torques and forces."""
    wrench = hear("tool_wrench", WrenchStamped).wrench
    record["force"] = math.hypot(wrench.force.x, wrench.force.y, wrench.force.z)
    call("set_zero_torques", messages.ZeroTorques)
    call("set_torque_control_parameters", messages.SetTorqueControlParameters)
    before = angles()
    for mode, name in ((0, "held"), (1, "pushed")):
        call("set_torque_control_mode", messages.SetTorqueControlMode, mode)
        stream("joint_torque", messages.JointTorque, 0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0)
        record[name] = [after - angle for after, angle in zip(angles(), before, strict=True)]
    before = hear("tool_pose", PoseStamped)
    stream("cartesian_force", messages.CartesianForce, 0.0, 0.0, -20.0, 0.0, 0.0, 0.0)
    call("set_torque_control_mode", messages.SetTorqueControlMode, 0)
    record["sunk"] = hear("tool_pose", PoseStamped).pose.position.z - before.pose.position.z
    try:
        call("run_COM_parameters_estimation", messages.RunCOMParametersEstimation)
    except rospy.ServiceException as why:
        record["masses"] = str(why)


def lead(record: dict[str, Any]) -> None:
    """Poses that line up, and a tool that is moved; and what has no effect here."""
    call("clear_trajectories", messages.ClearTrajectories)
    time.sleep(0.5)
    led = hear("cartesian_command", messages.KinovaPose)
    parts = [led.X, led.Y, led.Z + 0.03, led.ThetaX, led.ThetaY, led.ThetaZ]
    call("add_pose_to_Cartesian_trajectory", messages.AddPoseToCartesianTrajectory, *parts)
    time.sleep(2.0)
    at = hear("tool_pose", PoseStamped)
    record["lined_up"] = at.pose.position.z - led.Z
    call("set_end_effector_offset", messages.SetEndEffectorOffset, 1, Vector3(0.0, 0.0, 0.1))
    time.sleep(0.3)
    record["offset"] = apart(at, hear("tool_pose", PoseStamped))
    call("set_end_effector_offset", messages.SetEndEffectorOffset, 0, Vector3())
    time.sleep(0.3)
    record["no_offset"] = apart(at, hear("tool_pose", PoseStamped))
    call("set_null_space_mode_state", messages.SetNullSpaceModeState, 0)
    call("set_force_control_params", messages.SetForceControlParams)
    record["forces"] = [
        call("start_force_control", messages.Start).start_result,
        call("stop_force_control", messages.Stop).stop_result,
    ]


def main() -> None:
    begun = time.monotonic()
    stamps: list[float] = []
    hearing = rospy.Subscriber(
        f"{DRIVER}/out/joint_state", JointState, lambda it: stamps.append(it.header.stamp.to_sec())
    )
    while len(stamps) < 11:
        time.sleep(0.01)
    hearing.unregister()
    record["rate"] = 1.0 / statistics.median(after - before for before, after in itertools.pairwise(stamps))
    state = hear("joint_state", JointState)
    record["state"] = {"name": state.name, "position": state.position, "angles": angles()}
    record["lengths"] = [len(state.position), len(state.velocity), len(state.effort)]
    command = hear("joint_command", messages.JointAngles)
    goal = [getattr(command, f"joint{j + 1}") + 10.0 for j in range(6)]
    target = messages.JointAngles(*goal, 0.0)
    record["joints"] = ask(
        "joints_action/joint_angles", messages.ArmJointAnglesAction, messages.ArmJointAnglesGoal(target)
    )
    time.sleep(1.0)
    record["joints_off"] = max(abs(a - b) for a, b in zip(angles(), goal, strict=True))
    led = hear("cartesian_command", messages.KinovaPose)
    pose = PoseStamped()
    pose.header.frame_id = "j2n6s300_link_base"
    at, turned = pose.pose.position, pose.pose.orientation
    at.x, at.y, at.z = led.X, led.Y, led.Z
    turned.x, turned.y, turned.z, turned.w = quaternion_xyzw(led.ThetaX, led.ThetaY, led.ThetaZ)
    record["led_off"] = apart(pose, hear("tool_pose", PoseStamped))
    at.z -= 0.05
    record["pose"] = ask("pose_action/tool_pose", messages.ArmPoseAction, messages.ArmPoseGoal(pose))
    time.sleep(0.5)
    record["pose_off"] = apart(pose, hear("tool_pose", PoseStamped))
    pose.header.frame_id = "elsewhere"
    record["pose_elsewhere"] = ask("pose_action/tool_pose", messages.ArmPoseAction, messages.ArmPoseGoal(pose))
    now = hear("finger_position", messages.FingerPosition)
    fingers = messages.FingerPosition(*(getattr(now, f"finger{j + 1}") + 4000.0 for j in range(3)))
    goal_of_fingers = messages.SetFingersPositionGoal(fingers)
    record["fingers"] = ask("fingers_action/finger_positions", messages.SetFingersPositionAction, goal_of_fingers)
    record["finger"] = hear("finger_position", messages.FingerPosition).finger2
    publisher = rospy.Publisher(
        f"{DRIVER}/in/cartesian_velocity_with_fingers", messages.PoseVelocityWithFingers, queue_size=1
    )
    while not publisher.get_num_connections():
        time.sleep(0.01)
    before = hear("tool_pose", PoseStamped).pose.position.z
    for _ in range(100):
        publisher.publish(0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 100.0)
        time.sleep(0.01)
    time.sleep(0.5)
    record["rise"] = hear("tool_pose", PoseStamped).pose.position.z - before
    record["closed"] = hear("finger_position", messages.FingerPosition).finger1
    before = angles()
    stream("joint_velocity", messages.JointVelocity, 0.0, 0.0, 0.0, 0.0, 0.0, 20.0, 0.0)
    record["turned"] = [after - angle for after, angle in zip(angles(), before, strict=True)]
    record["stop"] = call("stop", messages.Stop).stop_result
    record["stopped"] = ask(
        "joints_action/joint_angles", messages.ArmJointAnglesAction, messages.ArmJointAnglesGoal(target)
    )
    record["start"] = call("start", messages.Start).start_result
    call("clear_trajectories", messages.ClearTrajectories)
    record["home"] = call("home_arm", messages.HomeArm).homearm_result
    record["angles"] = angles()
    record["seconds"] = time.monotonic() - begun


if sys.argv[1:] == ["pushes"]:
    push(record)
    lead(record)
else:
    main()
print(json.dumps(record), flush=True)
os._exit(0)
