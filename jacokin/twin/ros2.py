"""`Ros2Node`: a `TrajectoryController` as a node of ROS 2, with the names that ros2_control gives.

ROS is imported when the node is made.
"""

from __future__ import annotations

import asyncio
import importlib
import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from jacokin.errors import InvalidInputError, needed
from jacokin.twin.arm import GoalStatus
from jacokin.twin.faults import TICK
from jacokin.twin.following import Tolerances, TrajectoryController
from jacokin.twin.nodes import Ticker

if TYPE_CHECKING:
    from jacokin.twin.nodes import Camera

INSTALL = (
    "apt-get install ros-jazzy-ros-base ros-jazzy-control-msgs, source /opt/ros/jazzy/setup.bash, and start jacokin "
    "with the Python 3.12 of that system"
)
ACTION = "/joint_trajectory_controller/follow_joint_trajectory"


class Ros2Node:
    """The nodes of ros2_control that clients see, as one."""

    def __init__(
        self, controller: TrajectoryController, name: str, *, ticker: Ticker, cameras: Sequence[Camera] = ()
    ) -> None:
        """Become a node.

        Args:
            controller: to serve.
            name: of the robot, before the names of its fingers.
            ticker: lets simulated time pass; at any speed but 1 the node gives the time, on /clock.
            cameras: whose pictures it publishes.

        Raises:
            MissingExtraError: ROS 2, or control_msgs, is not installed.
        """
        with needed("rclpy", command=INSTALL):
            self._rclpy: Any = importlib.import_module("rclpy")
            actions: Any = importlib.import_module("rclpy.action")
            executors: Any = importlib.import_module("rclpy.executors")
            signals: Any = importlib.import_module("rclpy.signals")
            self._times: Any = importlib.import_module("rclpy.time")
            self._sensors: Any = importlib.import_module("sensor_msgs.msg")
            self._numbers: Any = importlib.import_module("std_msgs.msg")
            self._follow: Any = importlib.import_module("control_msgs.action").FollowJointTrajectory
            self._goal_response, self._cancel_response = actions.GoalResponse, actions.CancelResponse
        self._controller, self._ticker = controller, ticker
        fingers = range(1, len(controller.arm.state.fingers) + 1)
        self._names = [*controller.names, *(f"{name}_joint_finger_{finger}" for finger in fingers)]
        self._ended = threading.Event()
        self._rclpy.init(signal_handler_options=signals.SignalHandlerOptions.NO)
        node = self._node = self._rclpy.create_node(f"{name}_twin")
        self._states = node.create_publisher(self._sensors.JointState, "/joint_states", 10)
        self._is_clock = ticker.speed != 1.0
        if self._is_clock:
            clocks: Any = importlib.import_module("rosgraph_msgs.msg")
            self._clock_type = clocks.Clock
            self._clock = node.create_publisher(clocks.Clock, "/clock", 10)
        image = self._sensors.Image
        self._pictures = [
            camera.job(node.create_publisher(image, camera.topic, 1), image, self._now) for camera in cameras
        ]
        arrays = self._numbers.Float64MultiArray
        node.create_subscription(arrays, "/forward_velocity_controller/commands", self._take(controller.velocity), 10)
        node.create_subscription(arrays, "/finger_controller/commands", self._take(controller.move_fingers), 10)
        self._server = actions.ActionServer(
            node,
            self._follow,
            ACTION,
            self._execute,
            goal_callback=self._answer,
            cancel_callback=lambda _: self._cancel_response.ACCEPT,
        )
        self._executor = executors.SingleThreadedExecutor()
        self._executor.add_node(node)
        self._thread = threading.Thread(target=self._spin, name="ROS 2", daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        while not self._ended.is_set():
            self._executor.spin_once(timeout_sec=TICK)

    def _take(self, give: Callable[[Any], None]) -> Callable[[Any], None]:
        """Give the numbers of messages to the controller; those that it refuses are logged."""

        def take(message: Any) -> None:
            try:
                give(list(message.data))
            except InvalidInputError as error:
                self._node.get_logger().error(str(error))

        return take

    def _answer(self, goal: Any) -> Any:
        """Reject a goal that the controller would not follow, with the reason in the log, as the real one does."""
        try:
            self._controller.check(*_parts(goal)[:-1])
        except InvalidInputError as error:
            self._node.get_logger().error(f"goal rejected: {error}")
            return self._goal_response.REJECT
        return self._goal_response.ACCEPT

    async def _execute(self, handle: Any) -> Any:
        """Follow a goal until it has ended; the executor goes on here after every message, or tick without one."""
        goal = self._controller.follow(*_parts(handle.request))
        while not goal.has_ended:
            if handle.is_cancel_requested:
                self._controller.cancel(goal)
            await asyncio.sleep(0)
        end = {
            GoalStatus.SUCCEEDED: handle.succeed,
            GoalStatus.CANCELLED: handle.canceled,
        }.get(goal.status, handle.abort)
        end()
        result = self._follow.Result()
        result.error_code, result.error_string = goal.code, goal.text
        return result

    def run(self, watch: Callable[[], None], goes_on: Callable[[], bool]) -> None:
        """Simulate and publish until it is enough.

        Args:
            watch: called every simulated 40 ms.
            goes_on: whether to go on.
        """
        # [s] joint_state_broadcaster publishes at the rate of the controllers.
        jobs = [(0.01, self._publish), (0.04, watch), *self._pictures]
        self._ticker.run(self._controller.tick, jobs, goes_on)

    def close(self) -> None:
        """Leave ROS."""
        self._ended.set()
        self._thread.join()
        self._executor.shutdown()
        self._node.destroy_node()
        self._rclpy.shutdown()

    def _now(self) -> Any:
        if self._is_clock:
            nanoseconds = round(1e9 * self._controller.arm.state.time)
            return self._times.Time(nanoseconds=nanoseconds).to_msg()
        return self._node.get_clock().now().to_msg()

    def _publish(self) -> None:
        """Publish what is measured, and the time, if it is ours."""
        now = self._now()
        if self._is_clock:
            self._clock.publish(self._clock_type(clock=now))
        state = self._controller.tell()
        if state is None:
            return
        fingers = state.fingers.tolist()
        message = self._sensors.JointState(
            name=self._names,
            position=[*state.q.tolist(), *fingers],
            velocity=[*state.v.tolist(), *[0.0] * len(fingers)],
            effort=[*state.torques.tolist(), *[0.0] * len(fingers)],
        )
        message.header.stamp = now
        self._states.publish(message)


def _parts(goal: Any) -> tuple[Any, ...]:
    """What `TrajectoryController.follow` takes, of a goal."""
    trajectory = goal.trajectory
    points = trajectory.points
    return (
        list(trajectory.joint_names),
        [_seconds(point.time_from_start) for point in points],
        [list(point.positions) for point in points],
        [list(point.velocities) for point in points],
        [list(point.accelerations) for point in points],
        Tolerances(
            path={each.name: each.position for each in goal.path_tolerance},
            goal={each.name: each.position for each in goal.goal_tolerance},
            time=_seconds(goal.goal_time_tolerance),
        ),
    )


def _seconds(duration: Any) -> float:
    return float(duration.sec + 1e-9 * duration.nanosec)
