"""Forward velocities from `jacokin run` to an arm in ROS 1 or 2, and what the arm measures back.

    python3 forwarder.py --ros 1 --robot j2n6s300

It takes ROS, Python 3.8 or later, and nothing else: copy it to the machine with the driver. `jacokin run` starts it,
there or by `ssh` or `docker exec -i`, and speaks to it in lines of JSON, by its standard input and output:

    in:   {"joints": [names]} first; {"v": [rad/s]} 100 times a second; {"fingers": 0 open to 1 closed}
    out:  {"listens": whether the driver does, "velocities": topic, "states": topic} when that changes, and ten times a
          second, with {"missing": [names], "heard": [names]} while joint states come that lack joints; {"error": why};
          {"q": [rad], "v": [rad/s], "torques": [N m]}

When velocities stop coming for 50 ms, it sends zeros; when its input ends, it sends zeros and leaves.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import os
import signal
import socket
import sys
import threading
import time
from typing import Any, Callable, Sequence  # noqa: UP035 (Python 3.8)

PERIOD = 0.01  # [s] of the driver
WATCHDOG = 0.05  # [s] without velocities, after which zeros are sent
ZEROS = 5  # messages that end a motion
ANSWER = 10.0  # [s] that a ROS master may take
STRANGERS = 20  # names of other joints that are told of a message
TURNS = 6800.0  # of a finger's motor from open to closed (kinova-ros)
OPEN, CLOSED = 0.15, 1.35  # [rad] of fingers in ROS 2
JOINT_VELOCITY = "".join(f"float32 joint{k + 1}\n" for k in range(7))
RULE = "=" * 80 + "\n"
FINGERS_GOAL = RULE.join(
    (
        "Header header\nactionlib_msgs/GoalID goal_id\nSetFingersPositionGoal goal\n",
        "MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n",
        "MSG: actionlib_msgs/GoalID\ntime stamp\nstring id\n",
        "MSG: kinova_msgs/SetFingersPositionGoal\nFingerPosition fingers\n",
        "MSG: kinova_msgs/FingerPosition\nfloat32 finger1\nfloat32 finger2\nfloat32 finger3\n",
    )
)


class Ros1:
    """The driver of kinova-ros."""

    def __init__(self, options: argparse.Namespace, take: Callable[[Any], None]) -> None:
        """Become a node, and hear joint states."""
        rospy = self._rospy = importlib.import_module("rospy")  # type: Any
        sensors = importlib.import_module("sensor_msgs.msg")  # type: Any
        check_master()
        rospy.init_node("jacokin_run", anonymous=True, disable_signals=True)
        node = f"/{options.robot}_driver"
        self._kind = message("kinova_msgs/JointVelocity", JOINT_VELOCITY)
        self.velocities = options.velocities or node + "/in/joint_velocity"
        self._velocities = rospy.Publisher(self.velocities, self._kind, queue_size=1)
        self._goal = message("kinova_msgs/SetFingersPositionActionGoal", FINGERS_GOAL)
        self._fingers = rospy.Publisher(node + "/fingers_action/finger_positions/goal", self._goal, queue_size=1)
        self.states = options.states or node + "/out/joint_state"
        rospy.Subscriber(self.states, sensors.JointState, take, queue_size=1, tcp_nodelay=True)

    def listens(self) -> bool:
        """Whether the driver does."""
        return bool(self._velocities.get_num_connections())

    def hears_fingers(self) -> bool:
        """Whether it takes goals of the fingers."""
        return bool(self._fingers.get_num_connections())

    def turn(self, v: list[float]) -> None:
        """Send velocities [rad/s]."""
        self._velocities.publish(*[math.degrees(value) for value in v], *[0.0] * (7 - len(v)))

    def move_fingers(self, share: float) -> None:
        """Send a goal of the fingers, 0 open to 1 closed."""
        goal = self._goal()
        goal.goal_id.stamp = goal.header.stamp = self._rospy.Time.now()
        goal.goal_id.id = f"jacokin_run-{time.monotonic_ns()}"
        fingers = goal.goal.fingers
        fingers.finger1 = fingers.finger2 = fingers.finger3 = share * TURNS
        self._fingers.publish(goal)

    def close(self) -> None:
        """Leave ROS."""
        self._rospy.signal_shutdown("done")


class Ros2:
    """A velocity controller of ros2_control."""

    def __init__(self, options: argparse.Namespace, take: Callable[[Any], None]) -> None:
        """Become a node, and hear joint states."""
        rclpy = self._rclpy = importlib.import_module("rclpy")  # type: Any
        signals = importlib.import_module("rclpy.signals")  # type: Any
        qos = importlib.import_module("rclpy.qos")  # type: Any
        sensors = importlib.import_module("sensor_msgs.msg")  # type: Any
        self._numbers = importlib.import_module("std_msgs.msg")  # type: Any
        rclpy.init(args=[], signal_handler_options=signals.SignalHandlerOptions.NO)
        node = self._node = rclpy.create_node("jacokin_run")
        kind = self._numbers.Float64MultiArray
        self.velocities = options.velocities or "/forward_velocity_controller/commands"
        self._velocities = node.create_publisher(kind, self.velocities, 1)
        self._fingers = node.create_publisher(kind, "/finger_controller/commands", 1)
        # Best effort: it hears reliable publishers, too.
        self.states = options.states or "/joint_states"
        node.create_subscription(sensors.JointState, self.states, take, qos.qos_profile_sensor_data)
        threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()

    def listens(self) -> bool:
        """Whether a controller does."""
        return bool(self._velocities.get_subscription_count())

    def hears_fingers(self) -> bool:
        """Whether one of the fingers does."""
        return bool(self._fingers.get_subscription_count())

    def turn(self, v: list[float]) -> None:
        """Send velocities [rad/s]."""
        self._velocities.publish(self._numbers.Float64MultiArray(data=v))

    def move_fingers(self, share: float) -> None:
        """Send angles of the fingers, 0 open to 1 closed."""
        self._fingers.publish(self._numbers.Float64MultiArray(data=[OPEN + share * (CLOSED - OPEN)] * 3))

    def close(self) -> None:
        """Leave ROS, once what was sent is under way."""
        time.sleep(5 * PERIOD)


class Forwarder:
    """What comes in, and what goes out."""

    def __init__(self, say: Callable[[dict[str, Any]], None]) -> None:
        """Say by a function."""
        self._say, self._lock = say, threading.Lock()
        self._joints = []  # type: list[str]
        self._known = {}  # type: dict[str, tuple[float, float | None, float | None]]
        self._strangers = {}  # type: dict[str, None]  # names of other joints, in order
        self._arm = None  # type: Ros1 | Ros2 | None
        self._last, self._zeros = -math.inf, ZEROS
        self._share = None  # type: float | None  # of the fingers, until it is sent

    def attach(self, arm: Ros1 | Ros2) -> None:
        """Forward to an arm."""
        self._arm = arm

    def take(self, message: Any) -> None:
        """Joint states came, of some joints, and of others perhaps."""
        count = len(message.name)
        v = list(message.velocity) if len(message.velocity) == count else [None] * count
        torques = list(message.effort) if len(message.effort) == count else [None] * count
        with self._lock:
            ours = [j for j, name in enumerate(message.name) if name in self._joints]
            for j in ours:
                self._known[message.name[j]] = (message.position[j], v[j], torques[j])
            whole = [self._known.get(name) for name in self._joints]
            if None in whole:
                self._strangers.update(dict.fromkeys(set_aside(message.name, self._joints)))
            if not ours or None in whole:
                return
        q, v, torques = (list(column) for column in zip(*whole))  # noqa: B905 (Python 3.8)
        self._say({"q": q, "v": None if None in v else v, "torques": None if None in torques else torques})

    def hear(self, line: str) -> None:
        """A line came in."""
        fields = json.loads(line)
        with self._lock:
            if "joints" in fields:
                self._joints = list(fields["joints"])
            if self._arm is None:
                return
            if "fingers" in fields:
                share = float(fields["fingers"])
                if not 0.0 <= share <= 1.0:
                    raise ValueError(f"fingers must be from 0 to 1, got {share:g}")
                self._share = share
                self._move_fingers(self._arm)
            if "v" in fields:
                v = [float(value) for value in fields["v"]]
                if len(v) != len(self._joints) or not all(map(math.isfinite, v)):
                    raise ValueError(f"v must be {len(self._joints)} finite numbers")
                self._arm.turn(v)
                self._last, self._zeros = time.monotonic(), 0

    def lacking(self) -> dict[str, list[str]]:
        """The joints that no state has had yet, and the other names that states have; nothing where all is well."""
        with self._lock:
            missing = [name for name in self._joints if name not in self._known]
            return {"missing": missing, "heard": list(self._strangers)} if missing and self._strangers else {}

    def watch(self) -> None:
        """Send zeros where velocities have stopped coming, and what had to wait; to be called each 10 ms."""
        with self._lock:
            if self._arm is not None:
                self._move_fingers(self._arm)
            if time.monotonic() - self._last > WATCHDOG and self._zeros < ZEROS:
                self._turn_nothing()

    def end(self) -> None:
        """Stop the arm."""
        for _ in range(ZEROS):
            with self._lock:
                self._turn_nothing()
            time.sleep(PERIOD)
        if self._share is not None:
            sys.stderr.write("forwarder: nobody listens to the fingers, which were not moved\n")

    def _move_fingers(self, arm: Ros1 | Ros2) -> None:
        """Tell the fingers where to go, once they listen: what is published before is lost."""
        if self._share is not None and arm.hears_fingers():
            arm.move_fingers(self._share)
            self._share = None

    def _turn_nothing(self) -> None:
        if self._arm is not None:
            self._arm.turn([0.0] * len(self._joints))
        self._zeros += 1


def set_aside(names: Sequence[str], joints: Sequence[str]) -> list[str]:
    """The first names that are not of these joints."""
    return [name for name in names if name not in joints][:STRANGERS]


def check_master() -> None:
    """Refuse to wait for a master for ever, as rospy does."""
    rosgraph = importlib.import_module("rosgraph")  # type: Any
    socket.setdefaulttimeout(ANSWER)
    try:
        is_there = rosgraph.is_master_online()
    finally:
        socket.setdefaulttimeout(None)
    if not is_there:
        raise OSError(f"no ROS master at {rosgraph.get_master_uri()}: start roscore, or set ROS_MASTER_URI")


def message(name: str, text: str) -> Any:
    """A class of messages: that of the installed kinova_msgs, else one made of the text."""
    try:
        return getattr(importlib.import_module("kinova_msgs.msg"), name.rpartition("/")[2])
    except (ImportError, AttributeError):
        return importlib.import_module("genpy.dynamic").generate_dynamic(name, text)[name]


def main() -> int:
    """Forward until the input ends."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ros", type=int, choices=(1, 2), required=True, help="version of ROS")
    parser.add_argument("--robot", default="j2n6s300", help="name that kinova-ros was started with")
    parser.add_argument("--states", help="topic of joint states")
    parser.add_argument("--velocities", help="topic of velocities")
    options = parser.parse_args()
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # what ROS prints is not for the runner
    saying = threading.Lock()

    def say(fields: dict[str, Any]) -> None:
        with saying:
            try:
                out.write(json.dumps(fields) + "\n")
            except OSError:
                ended.set()

    ended = threading.Event()
    forwarder = Forwarder(say)

    def read() -> None:
        try:
            for line in sys.stdin:
                forwarder.hear(line)
        except (ValueError, TypeError, KeyError) as why:
            say({"error": f"the forwarder understands no line of its input: {why}"})
        ended.set()

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: ended.set())
    try:
        arm = (Ros1 if options.ros == 1 else Ros2)(options, forwarder.take)  # type: Ros1 | Ros2
    except ImportError as why:
        advice = "source its setup.bash, and start the forwarder with the Python that has it (--python)"
        say({"error": f"{sys.executable} has no ROS {options.ros} ({why}): {advice}"})
        return 1
    except OSError as why:
        say({"error": f"ROS {options.ros}: {why}"})
        return 1
    forwarder.attach(arm)
    threading.Thread(target=read, daemon=True).start()
    said, listened = -math.inf, False
    while not ended.wait(PERIOD):
        forwarder.watch()
        listens = arm.listens()
        if listens != listened or time.monotonic() - said > 0.1:  # [s] it is said again
            said, listened = time.monotonic(), listens
            topics = {"velocities": arm.velocities, "states": arm.states}
            say({"listens": listens, **topics, **forwarder.lacking()})
    forwarder.end()
    arm.close()
    return 0


if __name__ == "__main__":
    status = main()
    sys.stderr.flush()
    os._exit(status)  # threads of ROS would keep it
