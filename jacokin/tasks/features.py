"""`Feature`, something that an agent observes of the arm, the hand or a thing that it handles.

Names, shapes and order are those of dm_control's manipulation tasks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.mujoco_bridge import JacoArm, JacoHand, Physics
from jacokin.mujoco_bridge.entity import Entity
from jacokin.mujoco_bridge.observations import sin_cos, symmetric_log
from jacokin.mujoco_bridge.props import FreeProp

Elements = Any  # an element of a spec or a list of them, whose classes mypy does not know
ElementRows = slice | NDArray[np.intp]
Reader = Callable[["StateView", Array], NDArray[Any]]

PROP_SENSORS = ("angular_velocity", "linear_velocity", "orientation", "position")


@dataclass(frozen=True, slots=True, eq=False)
class StateView:
    """Live arrays of one simulation; of n simulations each has one more axis, (n, ...), in front.

    Attributes:
        qpos: (nq,) positions of the joints.
        qvel: (nv,) velocities of the joints.
        site_xpos: (nsite, 3) positions of the sites [m].
        site_xmat: (nsite, 9) their rotation matrices.
        sensordata: (nsensordata,) readings of the sensors.
        mocap_pos: (nmocap, 3) positions of the mocap bodies [m].
        qfrc_bias: (nv,) forces of gravity and motion.
        qfrc_passive: (nv,) forces of springs and dampers.
    """

    qpos: Array
    qvel: Array
    site_xpos: Array
    site_xmat: Array
    sensordata: Array
    mocap_pos: Array
    qfrc_bias: Array
    qfrc_passive: Array

    @classmethod
    def of(cls, data: Any) -> StateView:  # Any: mujoco.MjData or mujoco.batch.Batch
        """The view of one simulation, or of those of a batch, whose matrices have two axes."""
        site_xmat = data.site_xmat.reshape(*data.site_xpos.shape[:-1], 9)
        return cls(*(site_xmat if name == "site_xmat" else getattr(data, name) for name in cls.__slots__))

    def row(self, index: int) -> StateView:
        """The view of one of n simulations."""
        return StateView(*(getattr(self, name)[index] for name in self.__slots__))


def as_slice(indices: NDArray[np.intp]) -> ElementRows:
    """Indices as a slice if they are consecutive, which reads faster."""
    first = int(indices[0])
    consecutive = np.array_equal(indices, np.arange(first, first + len(indices)))
    return slice(first, first + len(indices)) if consecutive else indices


def ids(physics: Physics, elements: Elements) -> NDArray[np.intp]:
    """The numbers of elements of a scene, (k,)."""
    return np.array(physics.bind(elements).element_ids, dtype=np.intp)


def length(vectors: Array) -> Array:
    """Lengths (...) of vectors (..., 3)."""
    return np.asarray(np.sqrt(np.vecdot(vectors, vectors)))


def take_rows(array: Array, indices: NDArray[np.intp]) -> Array:
    """Rows of (..., m, 3) by indices (..., k): the same for every simulation, or different ones."""
    if array.ndim == 2 or indices.ndim == 1:
        return np.asarray(array[..., indices, :])
    return np.take_along_axis(array, indices[..., None], axis=-2)


@dataclass(frozen=True, slots=True, eq=False)
class Feature:
    """One observation.

    Attributes:
        name: its key.
        shape: of its value.
        read: gives the value (..., *shape) from a view and the goals (..., k) of the episodes.
        is_proprioceptive: whether it is about the arm and the hand; others are left out where a camera is used.
    """

    name: str
    shape: tuple[int, ...]
    read: Reader
    is_proprioceptive: bool = False

    def __post_init__(self) -> None:
        """Check what can be checked before it is read.

        Raises:
            InvalidInputError: a name, a shape or a function that is none.
        """
        if not checks.text("name", self.name):
            raise checks.refusal("name", "a text that is not empty", self.name)
        shape = checks.listed("shape", self.shape, "a tuple of whole numbers")
        object.__setattr__(self, "shape", tuple(checks.whole_number("shape", size, 1) for size in shape))
        checks.function("read", self.read, "a function of a view and goals")

    def value(self, view: StateView, goal: Array) -> Array:
        """What it reads, (..., *shape); may be a view of the simulation.

        Raises:
            InvalidInputError: it reads another shape.
        """
        found = np.asarray(self.read(view, goal))
        if found.shape != view.qpos.shape[:-1] + self.shape:
            raise InvalidInputError(
                f"observation {self.name!r} must read shape {view.qpos.shape[:-1] + self.shape}, got {found.shape}"
            )
        return found


def by_name(features: Sequence[Feature]) -> dict[str, Feature]:
    """Features by their names.

    Raises:
        InvalidInputError: two have the same.
    """
    found: dict[str, Feature] = {}
    for each in features:
        if each.name in found:
            raise InvalidInputError(f"two observations have the name {each.name!r}")
        found[each.name] = each
    return found


def robot_features(physics: Physics, arm: JacoArm, hand: JacoHand) -> list[Feature]:
    """The observations of the arm and the hand.

    Args:
        physics: the compiled scene.
        arm: the arm.
        hand: the hand on the arm.
    """
    model = physics.model
    arm_ids, hand_ids = (ids(physics, each.joints) for each in (arm, hand))
    q, v = as_slice(model.jnt_qposadr[arm_ids]), as_slice(model.jnt_dofadr[arm_ids])
    finger_q, finger_v = as_slice(model.jnt_qposadr[hand_ids]), as_slice(model.jnt_dofadr[hand_ids])
    axis = model.jnt_axis[arm_ids].copy()
    sensors = ids(physics, arm.joint_torque_sensors)
    torque = as_slice(_readings(physics, sensors, 3).ravel())
    site = int(ids(physics, hand.tool_center_point)[0])
    joints, fingers = len(arm_ids), len(hand_ids)

    def joints_torque(view: StateView, goal: Array) -> Array:
        torques = view.sensordata[..., torque]
        return symmetric_log(np.vecdot(torques.reshape(*torques.shape[:-1], joints, 3), axis))

    feature = partial(Feature, is_proprioceptive=True)
    return [
        feature(f"{arm.prefix}joints_pos", (joints, 2), lambda view, goal: sin_cos(view.qpos[..., q])),
        feature(f"{arm.prefix}joints_torque", (joints,), joints_torque),
        feature(f"{arm.prefix}joints_vel", (joints,), lambda view, goal: view.qvel[..., v]),
        feature(f"{hand.prefix}joints_pos", (fingers,), lambda view, goal: view.qpos[..., finger_q]),
        feature(f"{hand.prefix}joints_vel", (fingers,), lambda view, goal: view.qvel[..., finger_v]),
        feature(f"{hand.prefix}pinch_site_pos", (3,), lambda view, goal: view.site_xpos[..., site, :]),
        feature(f"{hand.prefix}pinch_site_rmat", (9,), lambda view, goal: view.site_xmat[..., site, :]),
    ]


def prop_features(physics: Physics, prop: FreeProp) -> list[Feature]:
    """The observations of a prop: pose and velocity in the world."""
    found = []
    for name in PROP_SENSORS:
        sensor = ids(physics, prop.sensors[name])
        size = int(physics.model.sensor_dim[sensor[0]])
        found.append(Feature(prop.prefix + name, (size,), _reading(as_slice(_readings(physics, sensor, size).ravel()))))
    return found


def position_feature(physics: Physics, fixture: Entity) -> Feature:
    """The observation of a thing that stands still: its position in the world."""
    place = int(physics.model.body_mocapid[ids(physics, fixture.root_body)[0]])
    return Feature(f"{fixture.prefix}position", (3,), lambda view, goal: view.mocap_pos[..., place, :])


def role_features(
    physics: Physics, props: Sequence[FreeProp], slot: Callable[[Array, int], NDArray[np.intp]]
) -> list[Feature]:
    """The observations of equal props that play one another's roles.

    Args:
        physics: the compiled scene.
        props: the props; the names of the observations are those of the roles.
        slot: gives the index (...) of the prop that plays role k, from the goals (..., m) of the episodes.
    """
    found = []
    for role, prop in enumerate(props):
        for name in PROP_SENSORS:
            sensors = [int(ids(physics, each.sensors[name])[0]) for each in props]
            size = int(physics.model.sensor_dim[sensors[0]])
            table = _readings(physics, sensors, size)

            def read(view: StateView, goal: Array, table: NDArray[np.intp] = table, role: int = role) -> Array:
                return np.take_along_axis(view.sensordata, table[slot(goal, role)], axis=-1)

            found.append(Feature(prop.prefix + name, (size,), read))
    return found


def _reading(where: ElementRows) -> Reader:
    return lambda view, goal: view.sensordata[..., where]


def _readings(physics: Physics, sensors: Sequence[int] | NDArray[np.intp], size: int) -> NDArray[np.intp]:
    """Where the readings of sensors are, (k, size)."""
    starts = physics.model.sensor_adr[np.asarray(sensors, dtype=np.intp)]
    return np.asarray(starts[:, None] + np.arange(size), dtype=np.intp)
