"""An ideal arm at the end of ROS 1: the driver of kinova-ros, or a controller of positions.

It prints a line when it is ready, one when it begins to move, and at its end, on SIGTERM, a line of JSON: what it did.
"""

from __future__ import annotations

import argparse
import collections
import json
import math
import os
import signal
import threading
import time
from typing import Any

import actionlib
import rospy
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryResult
from kinova_msgs.msg import JointAngles, JointVelocity
from sensor_msgs.msg import JointState

TICK = 0.01  # [s] of the arm's own loop
QUEUE = 2000  # velocities that it keeps


class Arm:
    """Angles [deg], and what moves them."""

    def __init__(self, angles: list[float]) -> None:
        self.angles, self.lock, self.alive = list(angles), threading.Lock(), True
        self.queue: collections.deque[list[float]] = collections.deque(maxlen=QUEUE)
        self.heard: list[list[float]] = []
        self.largest_step, self.goals, self.cancelled = 0.0, 0, 0

    def push(self, velocities: list[float]) -> None:
        """Do these [deg/s] for a tick, after what is waiting."""
        with self.lock:
            self.queue.append(velocities)

    def run(self) -> None:
        due, before = time.monotonic(), list(self.angles)
        while self.alive:
            due += TICK
            time.sleep(max(0.0, due - time.monotonic()))
            with self.lock:
                if self.queue:
                    row = self.queue.popleft()
                    self.angles = [angle + TICK * row[j] for j, angle in enumerate(self.angles)]
                step = max(abs(angle - before[j]) for j, angle in enumerate(self.angles))
                self.largest_step, before = max(self.largest_step, step), list(self.angles)


def play_open_loop(arm: Arm, server: Any) -> Any:
    """Play the velocity of a point each 10 ms, as kinova-ros does; its driver dies of what is cancelled."""

    def execute(goal: Any) -> object:
        points, start, k = goal.trajectory.points, time.monotonic(), 0
        print("moving", flush=True)
        arm.goals += 1
        due = start
        while k < len(points):
            due += TICK
            time.sleep(max(0.0, due - time.monotonic()))
            if server().is_preempt_requested():
                arm.cancelled += 1
                arm.alive = False
                return server().set_preempted()
            arm.push([math.degrees(velocity) for velocity in points[k].velocities])
            if time.monotonic() - start >= points[k].time_from_start.to_sec():
                k += 1
        return server().set_succeeded(FollowJointTrajectoryResult())

    return execute


def follow_positions(arm: Arm, server: Any, options: argparse.Namespace) -> Any:
    """Be where the points say, on straight lines between them."""

    def execute(goal: Any) -> object:
        points, start = goal.trajectory.points, time.monotonic()
        times = [point.time_from_start.to_sec() for point in points]
        print("moving", flush=True)
        arm.goals += 1
        while True:
            now = time.monotonic() - start
            if now > options.die_after:
                os._exit(0)
            if server().is_preempt_requested():
                arm.cancelled += 1
                print("stopped", flush=True)
                return server().set_preempted()
            k = next((i for i, at in enumerate(times) if at > now), len(times) - 1)
            share = min(1.0, (now - times[k - 1]) / (times[k] - times[k - 1])) if k else 1.0
            before = points[max(0, k - 1)].positions
            with arm.lock:
                arm.angles = [
                    math.degrees((1.0 - share) * early + share * late) + options.short
                    for early, late in zip(before, points[k].positions, strict=True)
                ]
            if now >= times[-1] and not options.hang:
                return server().set_succeeded(FollowJointTrajectoryResult())
            time.sleep(0.005)

    return execute


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument(
        "--kinova", action="store_true", help="the driver of kinova-ros, else a controller of positions"
    )
    parser.add_argument("--angles", type=float, nargs=6, required=True, help="[deg]")
    parser.add_argument("--die-after", type=float, default=math.inf, help="[s] into a goal")
    parser.add_argument("--hang", action="store_true", help="no goal ends")
    parser.add_argument("--short", type=float, default=0.0, help="[deg] by which all joints miss a goal")
    parser.add_argument("--gripper", action="store_true", help="a gripper gives states of its own")
    options = parser.parse_args()
    robot = "j2n6s300"
    rospy.init_node(f"{robot}_driver", disable_signals=True)
    arm = Arm(options.angles)
    topic = f"/{robot}_driver/out/joint_state" if options.kinova else "/joint_states"
    states = rospy.Publisher(topic, JointState, queue_size=2)
    angles = rospy.Publisher(f"/{robot}_driver/out/joint_angles", JointAngles, queue_size=2)
    action = f"/{robot}/follow_joint_trajectory" if options.kinova else "/arm_controller/follow_joint_trajectory"
    held: list[Any] = []
    execute = (
        play_open_loop(arm, lambda: held[0]) if options.kinova else follow_positions(arm, lambda: held[0], options)
    )
    held.append(actionlib.SimpleActionServer(action, FollowJointTrajectoryAction, execute, auto_start=False))
    held[0].start()

    def take(message: Any) -> None:
        row = [getattr(message, f"joint{j + 1}") for j in range(6)]
        if not arm.heard:
            print("moving", flush=True)
        arm.heard.append(row)
        arm.push(row)

    if options.kinova:
        rospy.Subscriber(f"/{robot}_driver/in/joint_velocity", JointVelocity, take, queue_size=1)
    names = [f"{robot}_joint_{j + 1}" for j in range(6)]
    stopped = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stopped.set())
    threading.Thread(target=arm.run, daemon=True).start()
    print("ready", flush=True)
    while not stopped.wait(0.1 if options.kinova else 0.02):
        if arm.alive:
            now = list(arm.angles)
            angles.publish(*now, 0.0)
            states.publish(JointState(name=names, position=[math.radians(angle) for angle in now]))
            if options.gripper:
                for _ in range(3):
                    states.publish(JointState(name=["finger_joint"], position=[0.4]))
    record = {name: getattr(arm, name) for name in ("angles", "largest_step", "goals", "cancelled", "heard")}
    print(json.dumps(record | {"waiting": len(arm.queue)}), flush=True)
    os._exit(0)


if __name__ == "__main__":
    main()
