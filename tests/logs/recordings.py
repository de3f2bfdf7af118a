"""Recordings of ROS, written by rosbags: what a driver and an instrument publish."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from jacokin import Robot
from jacokin.logs.bag import TEXTS
from jacokin.model import quat_wxyz

Array = NDArray[np.float64]
KINDS = (".bag", ".mcap", ".db3")
BEGIN = 1_700_000_000_000_000_000  # [ns]
STATE = "control_msgs/msg/JointTrajectoryControllerState"
FIELDS = {  # of ROS 1 and Foxy, and of Jazzy
    "desired": "".join(f"trajectory_msgs/JointTrajectoryPoint {name}\n" for name in ("desired", "actual", "error")),
    "reference": "".join(
        f"trajectory_msgs/JointTrajectoryPoint {name}\n" for name in ("reference", "feedback", "error", "output")
    )
    + "string[] multi_dof_joint_names\ntrajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_reference\n",
}


class Said(NamedTuple):
    """A message to be recorded."""

    topic: str
    kind: str
    time: float
    """[s] from the beginning."""
    make: Any
    """What makes the message, of the types of a store and a header."""


def store_for(ending: str, state: str = "desired") -> Typestore:
    """Types of ROS 1 or 2, and those of drivers."""
    store = get_typestore(Stores.ROS1_NOETIC if ending == ".bag" else Stores.ROS2_HUMBLE)
    texts = {name: text for name, text in TEXTS.items() if ending == ".bag" or name.startswith("kinova_msgs")}
    texts[STATE] = f"std_msgs/Header header\nstring[] joint_names\n{FIELDS[state]}"
    for name, text in texts.items():
        store.register(get_types_from_msg(text, name))
    return store


def write(folder: Path, ending: str, said: Sequence[Said], *, state: str = "desired", stamped: bool = True) -> Path:
    """A recording of some messages; with `stamped`, headers say their times."""
    store = store_for(ending, state)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"log{ending}"
    if ending == ".bag":
        writer: Any = Writer1(path)
    else:
        plugin = StoragePlugin.MCAP if ending == ".mcap" else StoragePlugin.SQLITE3
        writer = Writer2(folder / "log", version=9, storage_plugin=plugin)
    with writer:
        connections = {
            each.topic: writer.add_connection(each.topic, each.kind, typestore=store)
            for each in {each.topic: each for each in said}.values()
        }
        for each in sorted(said, key=lambda message: message.time):
            now = BEGIN + round(1e9 * each.time)
            message = each.make(Maker(store, now if stamped else 0))
            data = store.serialize_ros1 if ending == ".bag" else store.serialize_cdr
            writer.write(connections[each.topic], now, data(message, each.kind))
    return path if ending == ".bag" else next((folder / "log").glob(f"*{ending}"))


class Maker:
    """Messages of a store, with one time in their headers."""

    def __init__(self, store: Typestore, stamp: int) -> None:
        self._store, self._stamp = store, stamp

    def make(self, kind: str, **fields: Any) -> Any:
        package, name = kind.split("/")
        return self._store.types[f"{package}/msg/{name}"](**fields)

    def time(self, nanoseconds: int, kind: str = "Time") -> Any:
        sec, nanosec = divmod(nanoseconds, 1_000_000_000)
        return self.make(f"builtin_interfaces/{kind}", sec=sec, nanosec=nanosec)

    def header(self, frame: str = "world") -> Any:
        fields: dict[str, Any] = {"stamp": self.time(self._stamp), "frame_id": frame}
        if any(name == "seq" for name, _ in self._store.fielddefs["std_msgs/msg/Header"][1]):
            fields["seq"] = 0
        return self.make("std_msgs/Header", **fields)

    def point(self, positions: Sequence[float] | Array, after: float = 0.0) -> Any:
        return self.make(
            "trajectory_msgs/JointTrajectoryPoint",
            positions=np.array(positions, dtype=np.float64),
            velocities=np.zeros(0),
            accelerations=np.zeros(0),
            effort=np.zeros(0),
            time_from_start=self.time(round(1e9 * after), "Duration"),
        )


def joint_state(
    topic: str, time: float, names: Sequence[str], q: Sequence[float] | Array, v: Any = (), effort: Any = ()
) -> Said:
    def make(maker: Maker) -> Any:
        numbers = {"position": q, "velocity": v, "effort": effort}
        arrays = {name: np.array(value, dtype=np.float64) for name, value in numbers.items()}
        return maker.make("sensor_msgs/JointState", header=maker.header(), name=list(names), **arrays)

    return Said(topic, "sensor_msgs/msg/JointState", time, make)


def joint_angles(topic: str, time: float, q: Array) -> Said:
    """Angles [rad], as kinova-ros publishes them, in degrees."""
    degrees = np.degrees(np.pad(q, (0, 7 - len(q))))
    fields = {f"joint{joint + 1}": float(angle) for joint, angle in enumerate(degrees)}
    return Said(
        topic, "kinova_msgs/msg/JointAngles", time, lambda maker: maker.make("kinova_msgs/JointAngles", **fields)
    )


def pose(topic: str, time: float, T: Array, frame: str = "world") -> Said:
    def make(maker: Maker) -> Any:
        w, x, y, z = quat_wxyz(T[:3, :3]).tolist()
        place = maker.make("geometry_msgs/Point", x=T[0, 3], y=T[1, 3], z=T[2, 3])
        turn = maker.make("geometry_msgs/Quaternion", x=x, y=y, z=z, w=w)
        inside = maker.make("geometry_msgs/Pose", position=place, orientation=turn)
        return maker.make("geometry_msgs/PoseStamped", header=maker.header(frame), pose=inside)

    return Said(topic, "geometry_msgs/msg/PoseStamped", time, make)


def trajectory(topic: str, time: float, names: Sequence[str], points: Sequence[tuple[float, Array]]) -> Said:
    def make(maker: Maker) -> Any:
        rows = [maker.point(q, after) for after, q in points]
        return maker.make(
            "trajectory_msgs/JointTrajectory", header=maker.header(), joint_names=list(names), points=rows
        )

    return Said(topic, "trajectory_msgs/msg/JointTrajectory", time, make)


def controller_state(topic: str, time: float, names: Sequence[str], desired: Array, actual: Array, state: str) -> Said:
    def make(maker: Maker) -> Any:
        fields = {"header": maker.header(), "joint_names": list(names)}
        point, there, none = maker.point(desired), maker.point(actual), maker.point(())
        if state == "desired":
            fields |= {"desired": point, "actual": there, "error": none}
        else:
            more = maker.make(
                "trajectory_msgs/MultiDOFJointTrajectoryPoint",
                transforms=[],
                velocities=[],
                accelerations=[],
                time_from_start=maker.time(0, "Duration"),
            )
            fields |= {"reference": point, "feedback": there, "error": none, "output": none}
            fields |= {"multi_dof_joint_names": [], "multi_dof_reference": more}
        return maker.make("control_msgs/JointTrajectoryControllerState", **fields)

    return Said(topic, STATE, time, make)


def visits(stops: Array, *, stand: float = 2.0, move: float = 1.0, rate: float = 50.0) -> tuple[Array, Array]:
    """Times (n,) [s] and angles (n, dof) [rad] of an arm that stands at each of some configurations, one after another.

    Between them it moves smoothly.
    """
    times = np.arange(0.0, len(stops) * (stand + move) - move, 1.0 / rate)
    leg, within = np.divmod(times, stand + move)
    part = np.clip((within - stand) / move, 0.0, 1.0)[:, None]
    part = part * part * (3.0 - 2.0 * part)
    here = leg.astype(int)
    there = np.minimum(here + 1, len(stops) - 1)
    return times, (1.0 - part) * stops[here] + part * stops[there]


def measured_hand(arm: Robot, times: Array, q: Array, rate: float, noise: float, seed: int) -> list[Said]:
    """Poses of an arm's hand, as an instrument sees them from its base, with noise [m] and as much / 0.3 m [rad]."""
    import pinocchio as pin

    rng = np.random.default_rng(seed)
    found = []
    for at in np.arange(times[0], times[-1], 1.0 / rate):
        row = np.array([np.interp(at, times, column) for column in q.T])
        T = arm.forward_kinematics(row).homogeneous.copy()
        T[:3, 3] += rng.normal(0.0, noise, 3)
        T[:3, :3] = T[:3, :3] @ pin.exp3(rng.normal(0.0, noise / 0.3, 3))
        found.append(pose("/tracker/hand", float(at), T))
    return found


def names_of(robot: Robot, prefix: str = "j2n6s300_") -> SimpleNamespace:
    """Names as drivers have them: of the arm, and of its fingers behind."""
    arm = [prefix + name for name in robot.joint_names]
    fingers = [f"{prefix}joint_finger_{finger}" for finger in range(1, 4)]
    return SimpleNamespace(arm=arm, fingers=fingers, all=[*arm, *fingers])
