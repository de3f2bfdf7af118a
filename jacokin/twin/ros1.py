"""`Ros1Node`: a `KinovaDriver` as a node of ROS 1, with the names, units and rates of kinova-ros' own.

ROS is imported when the node is made; the messages of kinova_msgs are made here, see `ros1_messages`.
"""

from __future__ import annotations

import contextlib
import functools
import importlib
import socket
import time
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, needed
from jacokin.model.poses import pose_from_kinova, pose_to_kinova
from jacokin.twin.arm import ArmState, GoalStatus, TwinGoal
from jacokin.twin.faults import TICK
from jacokin.twin.kinova import PERIOD, TURNS, KinovaDriver
from jacokin.twin.nodes import Ticker

if TYPE_CHECKING:
    from collections.abc import Mapping

    from jacokin.twin.nodes import Camera

INSTALL = (
    "apt-get install python3-rospy python3-rosmaster python3-actionlib python3-sensor-msgs python3-trajectory-msgs "
    "python3-geometry-msgs (Debian 12), and start jacokin with the Python that has them"
)
ANSWER = 10.0  # [s] that a master may take
SINGULAR = 0.05  # of the largest singular value: weaker directions of a wrench are not told


class Ros1Action:
    """An action of one goal at a time, whose goals a driver ends."""

    def __init__(
        self,
        name: str,
        kind: Any,
        start: Callable[[Any], TwinGoal],
        cancel: Callable[[TwinGoal], None],
        result: Callable[[TwinGoal], Any],
        refuse: Callable[[Any], str],
    ) -> None:
        """Serve it.

        Args:
            name: of the action.
            kind: class of its messages.
            start: makes a goal of a message.
            cancel: cancels a goal.
            result: the message of a goal that has ended.
            refuse: why a message is rejected; empty where it is not.
        """
        self._start, self._cancel, self._result, self._refuse = start, cancel, result, refuse
        self._active: tuple[Any, TwinGoal] | None = None
        server = importlib.import_module("actionlib").ActionServer
        self._server = server(name, kind, self._accept, self._withdraw, auto_start=False)
        self._lock = self._server.lock  # a second one would be taken in the other order when a goal ends as one comes
        self._server.start()

    def _accept(self, handle: Any) -> None:
        with self._lock:
            message = handle.get_goal()
            why = self._refuse(message)
            if why:
                handle.set_rejected(text=why)
                return
            if self._active is not None:
                self._cancel(self._active[1])
                self.look()
            handle.set_accepted()
            self._active = handle, self._start(message)

    def _withdraw(self, handle: Any) -> None:
        with self._lock:
            if self._active is not None and self._active[0] == handle:
                self._cancel(self._active[1])
                self.look()

    def look(self) -> None:
        """Tell the client when its goal has ended."""
        with self._lock:
            if self._active is None or not self._active[1].has_ended:
                return
            (handle, goal), self._active = self._active, None
            tell = {
                GoalStatus.SUCCEEDED: handle.set_succeeded,
                GoalStatus.ABORTED: handle.set_aborted,
                GoalStatus.CANCELLED: handle.set_canceled,
            }[goal.status]
            tell(self._result(goal), goal.text)


class Ros1Node:
    """The node `NAME_driver`, and the action of the node beside it, `NAME/follow_joint_trajectory`."""

    def __init__(self, driver: KinovaDriver, name: str, *, ticker: Ticker, cameras: Sequence[Camera] = ()) -> None:
        """Become a node.

        Args:
            driver: to serve.
            name: of the robot, `kinova_robotName` of kinova_robot.launch.
            ticker: lets simulated time pass; at any speed but 1 the node gives the time, on /clock.
            cameras: whose pictures it publishes.

        Raises:
            MissingExtraError: ROS 1 is not installed.
            InvalidInputError: no master answers.
        """
        with needed("rospy", command=INSTALL):
            self._rospy: Any = importlib.import_module("rospy")
            self._sensors: Any = importlib.import_module("sensor_msgs.msg")
            self._geometry: Any = importlib.import_module("geometry_msgs.msg")
            self._clocks: Any = importlib.import_module("rosgraph_msgs.msg")
            for used in ("actionlib", "genpy.dynamic", "trajectory_msgs.msg"):
                importlib.import_module(used)
            from jacokin.twin import ros1_messages
        self._messages, control = ros1_messages.kinova_msgs(), ros1_messages.control_msgs()
        self._driver, self._name, self._ticker = driver, name, ticker
        _check_master()
        rospy, node = self._rospy, f"/{name}_driver"
        self._is_clock = ticker.speed != 1.0
        if self._is_clock:
            rospy.set_param("/use_sim_time", True)
        rospy.init_node(node.strip("/"), disable_signals=True)
        self._clock = rospy.Publisher("/clock", self._clocks.Clock, queue_size=1) if self._is_clock else None
        rospy.set_param(f"{node}/robot_name", name)
        rospy.set_param(f"{node}/robot_type", driver.arm.robot.source.bundled or name)
        speeds = [rospy.get_param(f"{node}/jointSpeedLimitParameter{part}", 20.0) for part in (1, 2)]  # [deg/s]
        dof = driver.arm.robot.dof
        driver.set_joint_speed(np.radians([speeds[joint > 2] for joint in range(dof)]))
        compensated = f"{node}/torque_parameters/publish_torque_with_gravity_compensation"
        self._is_compensated = bool(rospy.get_param(compensated, False))
        self._period = float(rospy.get_param(f"{node}/status_interval_seconds", PERIOD))
        self._joint_names = [f"{name}_joint_{joint + 1}" for joint in range(dof)]
        self._fingers = range(1, len(driver.arm.state.fingers) + 1)
        self._state_names = [
            *self._joint_names,
            *(f"{name}_joint_finger_{finger}" for finger in self._fingers),
            *(f"{name}_joint_finger_tip_{finger}" for finger in self._fingers),
        ]
        self._publishers = {
            topic: rospy.Publisher(f"{node}/out/{topic}", kind, queue_size=2) for topic, kind in self._outputs().items()
        }
        image = self._sensors.Image
        self._pictures = [
            camera.job(rospy.Publisher(camera.topic, image, queue_size=1), image, self._now) for camera in cameras
        ]
        self._subscribe(node)
        self._serve(node)
        self._actions = self._act(node, control)

    def _outputs(self) -> Mapping[str, Any]:
        messages = self._messages
        return {
            "joint_angles": messages.JointAngles,
            "joint_command": messages.JointAngles,
            "joint_torques": messages.JointAngles,
            "joint_state": self._sensors.JointState,
            "tool_pose": self._geometry.PoseStamped,
            "cartesian_command": messages.KinovaPose,
            "tool_wrench": self._geometry.WrenchStamped,
            "finger_position": messages.FingerPosition,
        }

    def _subscribe(self, node: str) -> None:
        """Take velocities; of those that come while one is taken, the newest is kept, as the driver does."""
        messages, driver = self._messages, self._driver
        joints = range(1, len(self._joint_names) + 1)
        for topic, kind, take in (
            (
                "joint_velocity",
                messages.JointVelocity,
                lambda message: driver.joint_velocity(np.radians(_numbers(message, "joint", joints))),
            ),
            ("cartesian_velocity", messages.PoseVelocity, self._move_tool),
            ("cartesian_velocity_with_fingers", messages.PoseVelocityWithFingers, self._take_closure),
            (
                "cartesian_velocity_with_finger_velocity",
                messages.PoseVelocityWithFingerVelocity,
                lambda message: self._move_tool(message, _numbers(message, "finger", self._fingers)),
            ),
            (
                "joint_torque",
                messages.JointTorque,
                lambda message: driver.joint_torque(_numbers(message, "joint", joints)),
            ),
            (
                "cartesian_force",
                messages.CartesianForce,
                lambda message: driver.tool_force(
                    np.append(_numbers(message, "force_", "xyz"), _numbers(message, "torque_", "xyz"))
                ),
            ),
        ):
            callback = functools.partial(_unless_refused, take)
            self._rospy.Subscriber(f"{node}/in/{topic}", kind, callback, queue_size=1)

    def _take_closure(self, message: Any) -> None:
        turns = self._driver.finger_turns(self._driver.state.fingers)
        error = message.fingers_closure_percentage / 100.0 * TURNS - turns[0]
        # [1/s], up to 20 turns: kinova_arm.cpp, cartesianVelocityWithFingersCallback.
        speed = 2.0 * error if abs(error) > 20.0 else 0.0
        self._move_tool(message, np.full(len(turns), speed))

    def _move_tool(self, message: Any, turns: Array | None = None) -> None:
        """Move the tool with the twist of a message, and fingers (k,) with turns of their motors in a second."""
        twist = np.append(_numbers(message, "twist_linear_", "xyz"), _numbers(message, "twist_angular_", "xyz"))
        driver = self._driver
        speeds = None if turns is None else driver.finger_angles(turns) - driver.finger_angles(0.0 * turns)
        driver.tool_velocity(twist, speeds)

    def _serve(self, node: str) -> None:
        """Serve what the driver serves; what has no effect on a simulated arm is answered all the same."""
        driver = self._driver

        def home(_: Any) -> str:
            goal = driver.home()
            while not goal.has_ended and not self._rospy.is_shutdown():
                time.sleep(TICK)
            return "KINOVA ARM HAS BEEN RETURNED HOME"

        def add_pose(request: Any) -> None:
            position, angles = [request.X, request.Y, request.Z], [request.ThetaX, request.ThetaY, request.ThetaZ]
            driver.add_pose(pose_from_kinova(1e3 * np.array(position), np.degrees(angles)))

        def move_tool(request: Any) -> None:
            at = request.offset
            driver.set_end_effector_offset([at.x, at.y, at.z] if request.status else None)

        def set_torque_parameters(_: Any) -> str:
            name = f"{node}/torque_parameters/safety_factor"
            driver.torque_control.safety_factor = float(self._rospy.get_param(name, 1.0))
            return ""

        def estimate_masses(_: Any) -> str:
            raise self._rospy.ServiceException("the twin does not simulate how the arm estimates its centres of mass")

        for name, kind, act, answer in (
            ("stop", "Stop", driver.stop, "Arm stopped"),
            ("start", "Start", driver.start, "Arm started"),
            ("clear_trajectories", "ClearTrajectories", driver.clear_trajectories, ""),
            ("start_force_control", "Start", None, "Start force control requested."),
            ("stop_force_control", "Stop", None, "Stop force control requested."),
            ("set_zero_torques", "ZeroTorques", None, ""),
        ):
            self._service(f"{node}/in/{name}", kind, functools.partial(_done, act, answer))
        for name, kind, serve in (
            ("home_arm", "HomeArm", home),
            ("add_pose_to_Cartesian_trajectory", "AddPoseToCartesianTrajectory", add_pose),
            ("set_end_effector_offset", "SetEndEffectorOffset", move_tool),
            ("set_torque_control_parameters", "SetTorqueControlParameters", set_torque_parameters),
            (
                "set_torque_control_mode",
                "SetTorqueControlMode",
                lambda request: driver.set_torque_control(on=bool(request.state)),
            ),
            ("run_COM_parameters_estimation", "RunCOMParametersEstimation", estimate_masses),
            ("set_force_control_params", "SetForceControlParams", lambda _: None),
            ("set_null_space_mode_state", "SetNullSpaceModeState", lambda _: None),
        ):
            self._service(f"{node}/in/{name}", kind, serve)

    def _service(self, name: str, kind: str, serve: Callable[[Any], str | None]) -> None:
        """Serve a service, whose answer is a text, or empty."""
        answer = getattr(self._messages, f"{kind}Response")

        def answered(request: Any) -> Any:
            try:
                text = serve(request)
            except InvalidInputError as why:
                raise self._rospy.ServiceException(str(why)) from why
            return answer() if text is None else answer(text)

        self._rospy.Service(name, getattr(self._messages, kind), answered)

    def _act(self, node: str, control: Any) -> list[Ros1Action]:
        driver, messages = self._driver, self._messages
        joints = range(1, len(self._joint_names) + 1)

        def angles(goal: Any) -> TwinGoal:
            return driver.go_to_angles(np.radians(_numbers(goal.angles, "joint", joints)))

        def is_no_pose(goal: Any) -> str:
            at, turned = goal.pose.pose.position, goal.pose.pose.orientation
            numbers = np.array([at.x, at.y, at.z, turned.x, turned.y, turned.z, turned.w])
            is_fine = goal.pose.header.frame_id == self._base and np.isfinite(numbers).all() and numbers[3:].any()
            return "" if is_fine else f"poses are in {self._base} here, with a quaternion"

        def pose(goal: Any) -> TwinGoal:
            why = is_no_pose(goal)
            if why:
                ended = TwinGoal()
                ended.end(GoalStatus.ABORTED, why)
                return ended
            at, turned = goal.pose.pose.position, goal.pose.pose.orientation
            quaternion = np.array([turned.x, turned.y, turned.z, turned.w])
            rotation = pin.Quaternion(quaternion / np.linalg.norm(quaternion)).toRotationMatrix()
            return driver.go_to_pose(pin.SE3(rotation, np.array([at.x, at.y, at.z])))

        def close(goal: Any) -> TwinGoal:
            return driver.move_fingers(_numbers(goal.fingers, "finger", self._fingers).clip(0.0, TURNS))

        def is_of_others(goal: Any) -> str:
            if sorted(goal.trajectory.joint_names) != sorted(self._joint_names):
                return "Joints on incoming goal don't match our joints"
            is_finite = all(np.isfinite(point.velocities).all() for point in goal.trajectory.points)
            return "" if is_finite else "velocities must be finite"

        def is_no_number(message: Any) -> str:
            numbers = [getattr(message, name) for name in message.__slots__]
            return "" if np.isfinite(numbers).all() else "numbers must be finite"

        def follow(goal: Any) -> TwinGoal:
            trajectory = goal.trajectory
            times = [point.time_from_start.to_sec() for point in trajectory.points]
            # In the order in which they come, whatever their names, as kinova_joint_trajectory_controller.cpp does.
            velocities = [point.velocities for point in trajectory.points]
            if any(len(row) != len(joints) for row in velocities):
                return driver.follow([], np.empty((0, len(joints))))  # it reads what is not there
            return driver.follow(times, np.array(velocities))

        return [
            Ros1Action(name, kind, begin, driver.cancel, result, refuse)
            for name, kind, begin, result, refuse in (
                (
                    f"{node}/joints_action/joint_angles",
                    messages.ArmJointAnglesAction,
                    angles,
                    lambda _: messages.ArmJointAnglesResult(self._angles(np.degrees(driver.state.q))),
                    lambda goal: is_no_number(goal.angles),
                ),
                (
                    f"{node}/pose_action/tool_pose",
                    messages.ArmPoseAction,
                    pose,
                    lambda _: messages.ArmPoseResult(self._pose(driver.state)),
                    lambda _: "",
                ),
                (
                    f"{node}/fingers_action/finger_positions",
                    messages.SetFingersPositionAction,
                    close,
                    lambda _: messages.SetFingersPositionResult(self._finger_position(driver.state)),
                    lambda goal: is_no_number(goal.fingers),
                ),
                (
                    f"/{self._name}/follow_joint_trajectory",
                    control.FollowJointTrajectoryAction,
                    follow,
                    lambda goal: control.FollowJointTrajectoryResult(goal.code, goal.text),
                    is_of_others,
                ),
            )
        ]

    @property
    def _base(self) -> str:
        return f"{self._name}_link_base"

    def run(self, watch: Callable[[], None], goes_on: Callable[[], bool]) -> None:
        """Simulate and publish until it is enough, or the driver has died and the arm stands.

        Args:
            watch: called every simulated 40 ms.
            goes_on: whether to go on.
        """
        died: list[float] = []

        def lives() -> bool:
            if self._driver.died and not died:
                died.append(self._driver.arm.state.time + 0.5)  # [s], in which the base goes on
            is_over = bool(died) and self._driver.arm.state.time > died[0]
            return goes_on() and not is_over and not self._rospy.is_shutdown()

        jobs: list[tuple[float, Callable[[], None]]] = [
            (TICK, self._tell_time),
            (self._period, self._publish),
            (0.04, watch),
            (PERIOD, self._look),
            *self._pictures,
        ]
        self._ticker.run(self._driver.tick, jobs, lives)

    def close(self) -> None:
        """Leave ROS."""
        if self._is_clock:
            with contextlib.suppress(KeyError, OSError):  # it is gone already, or the master is
                self._rospy.delete_param("/use_sim_time")
        self._rospy.signal_shutdown("the twin ends")

    def _look(self) -> None:
        for each in self._actions:
            each.look()

    def _tell_time(self) -> None:
        if self._clock is not None:
            self._clock.publish(self._now())

    def _now(self) -> Any:
        if self._is_clock:
            return self._rospy.Time.from_sec(self._driver.arm.state.time)
        return self._rospy.Time.now()

    def _publish(self) -> None:
        """Publish what the driver knows, as its status timer does."""
        state = self._driver.tell()
        if state is None:
            return
        now, publish = self._now(), {topic: each.publish for topic, each in self._publishers.items()}
        publish["joint_angles"](self._angles(np.degrees(state.q)))
        publish["joint_command"](self._angles(np.degrees(state.command)))
        publish["joint_torques"](self._angles(self._torques(state)))
        publish["joint_state"](self._joint_state(state, now))
        publish["finger_position"](self._finger_position(state))
        publish["tool_pose"](self._pose(state, now))
        position, angles = pose_to_kinova(self._driver.tool_pose(state.command))
        publish["cartesian_command"](self._messages.KinovaPose(*(1e-3 * position), *np.radians(angles)))
        publish["tool_wrench"](self._wrench(state, now))

    def _angles(self, values: Array) -> Any:
        return self._messages.JointAngles(*values.tolist(), *[0.0] * (7 - len(values)))

    def _finger_position(self, state: ArmState) -> Any:
        turns = self._driver.finger_turns(state.fingers).tolist()
        return self._messages.FingerPosition(*turns, *[0.0] * (3 - len(turns)))

    def _joint_state(self, state: ArmState, now: Any) -> Any:
        # The driver shows turns of fingers as angles by a rough factor.
        fingers = np.radians(self._driver.finger_turns(state.fingers) * 80.0 / TURNS).tolist()
        rest = [0.0] * (2 * len(fingers))
        message = self._sensors.JointState(
            name=self._state_names,
            position=[*state.q.tolist(), *fingers, *[0.0] * len(fingers)],  # of the tips the driver says so
            velocity=[*state.v.tolist(), *rest],
            effort=[*self._torques(state).tolist(), *rest],
        )
        message.header.stamp = now
        return message

    def _pose(self, state: ArmState, now: Any = None) -> Any:
        T = self._driver.tool_pose(state.q)
        message = self._geometry.PoseStamped()
        message.header.stamp = self._now() if now is None else now
        message.header.frame_id = self._base
        at, turned = message.pose.position, message.pose.orientation
        at.x, at.y, at.z = T.translation.tolist()
        turned.x, turned.y, turned.z, turned.w = pin.Quaternion(T.rotation).coeffs().tolist()
        return message

    def _torques(self, state: ArmState) -> Array:
        """The torques (dof,) that are published, with what holds the arm up unless a parameter says no [N m]."""
        if not self._is_compensated:
            return state.torques
        return state.torques - self._driver.arm.robot.gravity(state.q)

    def _wrench(self, state: ArmState, now: Any) -> Any:
        """What pushes the tool, in base axes, by what the torques leave unexplained at rest."""
        robot = self._driver.arm.robot
        external = robot.gravity(state.q) - state.torques
        force = np.linalg.pinv(robot.jacobian(state.q, frame="end_effector").T, rcond=SINGULAR) @ external
        message = self._geometry.WrenchStamped()
        message.header.stamp, message.header.frame_id = now, self._base
        pushes, turns = message.wrench.force, message.wrench.torque
        pushes.x, pushes.y, pushes.z = force[:3].tolist()
        # publishToolWrench of kinova_arm.cpp converts torques as if they were velocities.
        turns.x, turns.y, turns.z = np.radians(force[3:]).tolist()
        return message


def _numbers(message: Any, name: str, ends: Iterable[object]) -> Array:
    """What a message says in fields whose names begin alike, in its unit."""
    return np.array([getattr(message, f"{name}{end}") for end in ends], dtype=np.float64)


def _unless_refused(take: Callable[[Any], None], message: Any) -> None:
    """Take a message; nothing happens where its numbers are not finite."""
    with contextlib.suppress(InvalidInputError):
        take(message)


def _done(act: Callable[[], None] | None, answer: str, _: Any) -> str:
    """Do something, if there is anything to do; returns the answer of its service."""
    if act is not None:
        act()
    return answer


def _check_master() -> None:
    """Refuse to wait for a master for ever, as rospy does.

    Raises:
        InvalidInputError: none answers.
    """
    rosgraph: Any = importlib.import_module("rosgraph")
    before = socket.getdefaulttimeout()
    socket.setdefaulttimeout(ANSWER)
    try:
        is_there = rosgraph.is_master_online()
    finally:
        socket.setdefaulttimeout(before)
    if not is_there:
        raise InvalidInputError(f"no ROS master at {rosgraph.get_master_uri()}: start roscore, or set ROS_MASTER_URI")
