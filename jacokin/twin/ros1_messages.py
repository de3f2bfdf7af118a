"""The messages and services of kinova_msgs and control_msgs (ROS 1) that the twin needs, made at run time.

Debian packages neither. Their fields are facts of the interface: with the same ones a message has the same checksum,
and clients that have the packages talk to nodes that have not. See kinova_msgs of kinova-ros (commit 924781d) and
control_msgs 1.5.
"""

from __future__ import annotations

import functools
import importlib
from types import SimpleNamespace
from typing import Any

JOINTS = "".join(f"float32 joint{j}\n" for j in range(1, 8))
TWIST = "".join(f"float32 twist_{part}_{axis}\n" for part in ("linear", "angular") for axis in "xyz")
FINGERS = "".join(f"float32 finger{j}\n" for j in range(1, 4))
POSE = "geometry_msgs/PoseStamped pose\n"
POSE_PARTS = "".join(f"float32 {name}\n" for name in ("X", "Y", "Z", "ThetaX", "ThetaY", "ThetaZ"))
FORCE_PARTS = "".join(
    f"geometry_msgs/Vector3 {what}_{part}\n"
    for what in ("inertia", "damping", "force_min", "force_max")
    for part in ("linear", "angular")
)
KINOVA = {
    "JointAngles": JOINTS,
    "JointVelocity": JOINTS,
    "JointTorque": JOINTS,
    "FingerPosition": FINGERS,
    "CartesianForce": "".join(f"float32 {part}_{axis}\n" for part in ("force", "torque") for axis in "xyz"),
    "KinovaPose": POSE_PARTS,
    "PoseVelocity": TWIST,
    "PoseVelocityWithFingers": f"{TWIST}float32 fingers_closure_percentage\n",
    "PoseVelocityWithFingerVelocity": f"{TWIST}{FINGERS}",
}
KINOVA_ACTIONS = {  # what goal, result and feedback are alike
    "ArmJointAngles": "JointAngles angles\n",
    "ArmPose": POSE,
    "SetFingersPosition": "FingerPosition fingers\n",
}
KINOVA_SERVICES = {  # the fields of the question, and of the answer
    "Stop": ("", "string stop_result\n"),
    "Start": ("", "string start_result\n"),
    "HomeArm": ("", "string homearm_result\n"),
    "ClearTrajectories": ("", "string result\n"),
    "AddPoseToCartesianTrajectory": (POSE_PARTS, ""),
    "SetEndEffectorOffset": ("uint16 status\ngeometry_msgs/Vector3 offset\n", ""),
    "SetForceControlParams": (FORCE_PARTS, ""),
    "SetNullSpaceModeState": ("uint16 state\n", ""),
    "SetTorqueControlMode": ("uint16 state\n", ""),
    "SetTorqueControlParameters": ("", "string result\n"),
    "ZeroTorques": ("", "string result\n"),
    "RunCOMParametersEstimation": ("", "string result\n"),
}
CODES = {
    "SUCCESSFUL": 0,
    "INVALID_GOAL": -1,
    "INVALID_JOINTS": -2,
    "OLD_HEADER_TIMESTAMP": -3,
    "PATH_TOLERANCE_VIOLATED": -4,
    "GOAL_TOLERANCE_VIOLATED": -5,
}
TOLERANCE = "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n"
FOLLOW = (
    "trajectory_msgs/JointTrajectory trajectory\nJointTolerance[] path_tolerance\nJointTolerance[] goal_tolerance\n"
    "duration goal_time_tolerance\n",
    "int32 error_code\n"
    + "".join(f"int32 {name} = {code}\n" for name, code in CODES.items())
    + "string error_string\n",
    "Header header\nstring[] joint_names\n"
    + "".join(f"trajectory_msgs/JointTrajectoryPoint {name}\n" for name in ("desired", "actual", "error")),
)
RULE = "=" * 80


def action(name: str, goal: str, result: str, feedback: str) -> dict[str, str]:
    """The messages of an action: their texts by their names."""
    head = "Header header\nactionlib_msgs/GoalStatus status\n"
    return {
        f"{name}Goal": goal,
        f"{name}Result": result,
        f"{name}Feedback": feedback,
        f"{name}ActionGoal": f"Header header\nactionlib_msgs/GoalID goal_id\n{name}Goal goal\n",
        f"{name}ActionResult": f"{head}{name}Result result\n",
        f"{name}ActionFeedback": f"{head}{name}Feedback feedback\n",
        f"{name}Action": (
            f"{name}ActionGoal action_goal\n{name}ActionResult action_result\n{name}ActionFeedback action_feedback\n"
        ),
    }


@functools.cache
def kinova_msgs() -> SimpleNamespace:
    """The messages and services of kinova_msgs by their names."""
    texts = dict(KINOVA)
    for name, text in KINOVA_ACTIONS.items():
        texts |= action(name, text, text, text)
    for name, (question, answer) in KINOVA_SERVICES.items():
        texts |= {f"{name}Request": question, f"{name}Response": answer}
    made = _make("kinova_msgs", texts)
    for name, (question, answer) in KINOVA_SERVICES.items():
        made[name] = _service(name, made[f"{name}Request"], made[f"{name}Response"], f"{question}---\n{answer}")
    return SimpleNamespace(**made)


@functools.cache
def control_msgs() -> SimpleNamespace:
    """The messages of FollowJointTrajectory by their names."""
    texts = {"JointTolerance": TOLERANCE, **action("FollowJointTrajectory", *FOLLOW)}
    return SimpleNamespace(**_make("control_msgs", texts))


def _make(package: str, texts: dict[str, str]) -> dict[str, Any]:
    dynamic = importlib.import_module("genpy.dynamic")
    used = [
        getattr(importlib.import_module(f"{other}.msg"), name)
        for other, name in (
            ("std_msgs", "Header"),
            ("actionlib_msgs", "GoalID"),
            ("actionlib_msgs", "GoalStatus"),
            ("geometry_msgs", "PoseStamped"),
            ("geometry_msgs", "Pose"),
            ("geometry_msgs", "Point"),
            ("geometry_msgs", "Quaternion"),
            ("geometry_msgs", "Vector3"),
            ("trajectory_msgs", "JointTrajectory"),
            ("trajectory_msgs", "JointTrajectoryPoint"),
        )
    ]
    first, *_ = texts  # with it genpy makes all that follow
    parts = [texts[first], *(f"MSG: {package}/{name}\n{text}" for name, text in texts.items())]
    parts += [f"MSG: {each._type}\n{each._full_text.split(RULE)[0]}" for each in used]
    made = dynamic.generate_dynamic(f"{package}/{first}", f"\n{RULE}\n".join(parts))
    return {name: made[f"{package}/{name}"] for name in texts}


def _service(name: str, request: Any, response: Any, text: str) -> type:
    """The class of a service, as rospy wants it."""
    loader = importlib.import_module("genmsg.msg_loader")
    context = loader.MsgContext.create_default()
    vector = importlib.import_module("geometry_msgs.msg").Vector3
    loader.load_msg_from_string(context, vector._full_text, vector._type)
    spec = loader.load_srv_from_string(context, text, f"kinova_msgs/{name}")
    checksum = importlib.import_module("genmsg.gentools").compute_md5(context, spec)
    fields = {
        "_type": f"kinova_msgs/{name}",
        "_md5sum": checksum,
        "_request_class": request,
        "_response_class": response,
    }
    return type(name, (), fields)
