"""The messages of the action FollowJointTrajectory."""

from actionlib_msgs.msg import GoalID, GoalStatus
from making import make
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NAME = "FollowJointTrajectory"
CODES = [  # part of the checksum
    f"int32 {name} = {-code}\n"
    for code, name in enumerate(
        (
            "SUCCESSFUL",
            "INVALID_GOAL",
            "INVALID_JOINTS",
            "OLD_HEADER_TIMESTAMP",
            "PATH_TOLERANCE_VIOLATED",
            "GOAL_TOLERANCE_VIOLATED",
        )
    )
]
HEAD = "Header header\nactionlib_msgs/GoalStatus status\n"
FIELDS = {
    "JointTolerance": "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n",
    f"{NAME}Goal": (
        "trajectory_msgs/JointTrajectory trajectory\nJointTolerance[] path_tolerance\n"
        "JointTolerance[] goal_tolerance\nduration goal_time_tolerance\n"
    ),
    f"{NAME}Result": "int32 error_code\n" + "".join(CODES) + "string error_string\n",
    f"{NAME}Feedback": (
        "Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint desired\n"
        "trajectory_msgs/JointTrajectoryPoint actual\ntrajectory_msgs/JointTrajectoryPoint error\n"
    ),
    f"{NAME}ActionGoal": f"Header header\nactionlib_msgs/GoalID goal_id\n{NAME}Goal goal\n",
    f"{NAME}ActionResult": f"{HEAD}{NAME}Result result\n",
    f"{NAME}ActionFeedback": f"{HEAD}{NAME}Feedback feedback\n",
    f"{NAME}Action": (
        f"{NAME}ActionGoal action_goal\n{NAME}ActionResult action_result\n{NAME}ActionFeedback action_feedback\n"
    ),
}
globals().update(make("control_msgs", FIELDS, (GoalID, GoalStatus, Header, JointTrajectory, JointTrajectoryPoint)))
