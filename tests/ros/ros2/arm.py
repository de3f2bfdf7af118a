"""An ideal arm at the end of ROS 2, as joint_trajectory_controller moves it.

It prints a line when it is ready, one when it begins to move, and at its end, on SIGTERM, a line of JSON: what it did.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import signal
import threading
import time
from typing import Any

import rclpy
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

NAMES = [f"j2n6s300_joint_{j + 1}" for j in range(6)]


def seconds(duration: Any) -> float:
    return float(duration.sec + 1e-9 * duration.nanosec)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--angles", type=float, nargs=6, required=True, help="[deg]")
    parser.add_argument("--die-after", type=float, default=math.inf, help="[s] into a goal")
    parser.add_argument("--best-effort", action="store_true", help="joint states are not sent again when they are lost")
    parser.add_argument("--gripper", action="store_true", help="a gripper gives states of its own")
    parser.add_argument("--reject", action="store_true", help="no goal is taken")
    options = parser.parse_args()
    record: dict[str, Any] = {"angles": options.angles, "goals": 0, "cancelled": 0, "largest_step": 0.0}
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node, group = rclpy.create_node("arm_controller"), ReentrantCallbackGroup()
    states = node.create_publisher(JointState, "/joint_states", qos_profile_sensor_data if options.best_effort else 10)

    def tell() -> None:
        states.publish(JointState(name=NAMES, position=[math.radians(angle) for angle in record["angles"]]))
        if options.gripper:
            for _ in range(3):
                states.publish(JointState(name=["finger_joint"], position=[0.4]))

    def move(angles: list[float]) -> None:
        step = max(abs(angle - record["angles"][j]) for j, angle in enumerate(angles))
        record.update(angles=angles, largest_step=max(step, record["largest_step"]))

    def execute(handle: Any) -> Any:
        points, start = handle.request.trajectory.points, time.monotonic()
        times = [seconds(point.time_from_start) for point in points]
        print("moving", flush=True)
        record["goals"] += 1
        reached = 0
        while True:
            now = time.monotonic() - start
            if now > options.die_after:
                os._exit(0)
            if handle.is_cancel_requested:
                record["cancelled"] += 1
                print("stopped", flush=True)
                handle.canceled()
                return FollowJointTrajectory.Result()
            k = next((i for i, at in enumerate(times) if at > now), len(times) - 1)
            for point in points[reached : k + 1]:  # all of them, however late this process is
                move([math.degrees(position) for position in point.positions])
            reached = k
            if now >= times[-1]:
                handle.succeed()
                return FollowJointTrajectory.Result()
            time.sleep(0.005)

    def accept(_: Any) -> Any:
        return GoalResponse.REJECT if options.reject else GoalResponse.ACCEPT

    node.create_timer(0.02, tell, callback_group=group)
    ActionServer(
        node,
        FollowJointTrajectory,
        "/arm_controller/follow_joint_trajectory",
        execute,
        goal_callback=accept,
        cancel_callback=lambda _: CancelResponse.ACCEPT,
        callback_group=group,
    )
    stopped = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stopped.set())
    executor = MultiThreadedExecutor(4)
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    print("ready", flush=True)
    stopped.wait()
    print(json.dumps(record), flush=True)
    os._exit(0)


if __name__ == "__main__":
    main()
