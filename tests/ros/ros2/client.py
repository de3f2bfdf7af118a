"""A client of ros2_control: looks for what is published, then sends velocities until it is killed; prints JSON."""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import rclpy
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Float64MultiArray

rclpy.init()
node = rclpy.create_node("client")
heard: dict[str, list[Any]] = {"states": [], "pictures": []}
node.create_subscription(JointState, "/joint_states", heard["states"].append, 10)
node.create_subscription(Image, "/camera/wrist/image_raw", heard["pictures"].append, 1)
velocities = node.create_publisher(Float64MultiArray, "/forward_velocity_controller/commands", 1)
fingers = node.create_publisher(Float64MultiArray, "/finger_controller/commands", 1)


def main() -> None:
    wants_picture = "picture" in sys.argv
    while len(heard["states"]) < 200 or (wants_picture and not heard["pictures"]):
        rclpy.spin_once(node, timeout_sec=0.1)
    first, last = heard["states"][0], heard["states"][-1]
    elapsed = (last.header.stamp.sec - first.header.stamp.sec) + 1e-9 * (
        last.header.stamp.nanosec - first.header.stamp.nanosec
    )
    record: dict[str, Any] = {"names": list(last.name), "positions": list(last.position)}
    record["rate"] = (len(heard["states"]) - 1) / elapsed
    if wants_picture:
        picture = heard["pictures"][0]
        record["picture"] = [picture.height, picture.width, picture.encoding, max(picture.data), min(picture.data)]
    print(json.dumps(record), flush=True)
    if "velocities" in sys.argv:
        fingers.publish(Float64MultiArray(data=[1.0, 1.0, 1.0]))
        while True:
            velocities.publish(Float64MultiArray(data=[0.4, 0.0, 0.0, 0.0, 0.0, -0.4]))
            time.sleep(0.01)


main()
