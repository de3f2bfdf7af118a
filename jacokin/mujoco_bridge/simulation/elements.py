"""Elements of a `mujoco.MjSpec`: what kind they are, and where they are in the model compiled from it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError, UnknownNameError, shown
from jacokin.model import checks

RowFinder = Callable[[mujoco.MjModel, int], NDArray[np.intp]]

# Numbers in qpos and qvel of a free, ball, slide and hinge joint, in the order of MuJoCo's mjtJoint.
_QPOS_SIZE = (7, 4, 1, 1)
_QVEL_SIZE = (6, 3, 1, 1)
# The only arrays of the model without a prefix that have rows for the joints.
_QPOS_FIELDS = ("qpos0", "qpos_spring")
_FORCES = " ".join(name for name in dir(mujoco.MjData) if name.startswith("qfrc_") and name != "qfrc_applied")


@dataclass(frozen=True, slots=True)
class Field:
    """One array of MuJoCo.

    Attributes:
        in_model: an array of the model, not of the data.
        array: its name there.
        rows: gives the rows of an element with a given id.
        derived: whether MuJoCo computes it in a forward pass.
    """

    in_model: bool
    array: str
    rows: RowFinder
    derived: bool = False


def _span(start: int, length: int) -> NDArray[np.intp]:
    return np.arange(start, start + length, dtype=np.intp)


def _by_id(model: mujoco.MjModel, index: int) -> NDArray[np.intp]:
    return _span(index, 1)


def qpos_rows(model: mujoco.MjModel, joint: int) -> NDArray[np.intp]:
    """Where in qpos a joint is."""
    return _span(model.jnt_qposadr[joint], _QPOS_SIZE[model.jnt_type[joint]])


def _by_dof(model: mujoco.MjModel, joint: int) -> NDArray[np.intp]:
    return _span(model.jnt_dofadr[joint], _QVEL_SIZE[model.jnt_type[joint]])


def _by_activation(model: mujoco.MjModel, actuator: int) -> NDArray[np.intp]:
    return _span(max(model.actuator_actadr[actuator], 0), model.actuator_actnum[actuator])


def _by_reading(model: mujoco.MjModel, sensor: int) -> NDArray[np.intp]:
    return _span(model.sensor_adr[sensor], model.sensor_dim[sensor])


def _by_mocap(model: mujoco.MjModel, body: int) -> NDArray[np.intp]:
    return _span(max(model.body_mocapid[body], 0), int(model.body_mocapid[body] >= 0))


@dataclass(frozen=True, slots=True, eq=False)
class Kind:
    """A kind of element.

    Attributes:
        name: its name in messages, and the method of `mujoco.MjSpec` that looks one up.
        plural: the attribute of `mujoco.MjSpec` that lists all.
        count: the attribute of `mujoco.MjModel` that counts them.
        prefixes: of its arrays in the model; the first wins where a field has two.
        inputs: arrays of the data that the simulation takes in: names by what finds their rows.
        derived: arrays of the data that a forward pass computes, likewise.
    """

    name: str
    plural: str
    count: str
    prefixes: Mapping[str, RowFinder]
    inputs: Mapping[RowFinder, str] = field(default_factory=dict)
    derived: Mapping[RowFinder, str] = field(default_factory=dict)

    @property
    def object_type(self) -> mujoco.mjtObj:
        """MuJoCo's number for the kind."""
        return getattr(mujoco.mjtObj, f"mjOBJ_{self.name.upper()}")


# The classes of MjSpec's elements. mypy does not follow mujoco, hence the plain `type`.
KINDS: dict[type, Kind] = {
    mujoco.MjsBody: Kind(
        "body",
        "bodies",
        "nbody",
        {"body_": _by_id},
        {_by_id: "xfrc_applied", _by_mocap: "mocap_pos mocap_quat"},
        {
            _by_id: "xpos xquat xmat xipos ximat cvel cacc cfrc_int cfrc_ext cinert subtree_com subtree_linvel "
            "subtree_angmom"
        },
    ),
    mujoco.MjsJoint: Kind(
        "joint",
        "joints",
        "njnt",
        {"jnt_": _by_id, "dof_": _by_dof, "": qpos_rows},
        {qpos_rows: "qpos", _by_dof: "qvel qfrc_applied qacc_warmstart"},
        {_by_dof: f"qacc qacc_smooth {_FORCES}", _by_id: "xanchor xaxis"},
    ),
    mujoco.MjsGeom: Kind("geom", "geoms", "ngeom", {"geom_": _by_id}, {}, {_by_id: "geom_xpos geom_xmat"}),
    mujoco.MjsSite: Kind("site", "sites", "nsite", {"site_": _by_id}, {}, {_by_id: "site_xpos site_xmat"}),
    mujoco.MjsCamera: Kind("camera", "cameras", "ncam", {"cam_": _by_id}, {}, {_by_id: "cam_xpos cam_xmat"}),
    mujoco.MjsLight: Kind("light", "lights", "nlight", {"light_": _by_id}, {}, {_by_id: "light_xpos light_xdir"}),
    mujoco.MjsActuator: Kind(
        "actuator",
        "actuators",
        "nu",
        {"actuator_": _by_id},
        {_by_id: "ctrl", _by_activation: "act"},
        {_by_id: "actuator_length actuator_velocity actuator_force", _by_activation: "act_dot"},
    ),
    mujoco.MjsSensor: Kind("sensor", "sensors", "nsensor", {"sensor_": _by_id}, {}, {_by_reading: "sensordata"}),
    mujoco.MjsTendon: Kind(
        "tendon", "tendons", "ntendon", {"tendon_": _by_id}, {}, {_by_id: "ten_length ten_velocity"}
    ),
    mujoco.MjsEquality: Kind("equality", "equalities", "neq", {"eq_": _by_id}, {_by_id: "eq_active"}),
    mujoco.MjsMaterial: Kind("material", "materials", "nmat", {"mat_": _by_id}),
}


@cache
def fields_of(element_class: type) -> Mapping[str, Field]:
    """All fields of a class of elements by every name they go by."""
    kind = KINDS[element_class]
    found: dict[str, Field] = {}
    for derived, table in ((False, kind.inputs), (True, kind.derived)):
        for rows, arrays in table.items():
            for array in arrays.split():
                found[array] = each = Field(False, array, rows, derived)
                for prefix in ("geom_", "site_", "cam_", "light_", "actuator_", "ten_", "eq_", "mat_"):
                    found.setdefault(array.removeprefix(prefix), each)
    for array in dir(mujoco.MjModel):
        for prefix, rows in kind.prefixes.items():
            if array.startswith(prefix) if prefix else array in _QPOS_FIELDS:
                each = Field(True, array, rows)
                found.setdefault(array.removeprefix(prefix), each)
                found.setdefault(array, each)
    return found


Element: TypeAlias = Any
"""An element of a `mujoco.MjSpec` that can be bound: of one of the classes of `KINDS`, which mypy does not know."""


class ElementIds:
    """The ids that elements have in one compiled model.

    They are recorded when the model is compiled: the spec may be changed and compiled again later, which gives its
    elements other ids.
    """

    def __init__(self, model: mujoco.MjModel, spec: mujoco.MjSpec | None) -> None:
        """Record the ids.

        Args:
            model: the compiled model.
            spec: what it was just compiled from; None to look elements up by their names alone.

        Raises:
            InvalidInputError: the spec has other elements than the model.
        """
        self._model = model
        self._ids: dict[Element, int] | None = None
        if spec is not None:
            checks.instance("spec", spec, mujoco.MjSpec, "a mujoco.MjSpec or None")
            self._ids = {}
            for kind in KINDS.values():
                elements, count = getattr(spec, kind.plural), getattr(model, kind.count)
                if len(elements) != count:
                    raise InvalidInputError(
                        f"spec has {len(elements)} {kind.plural} and the model {count}: it is not what the model was "
                        "compiled from, or was changed since; compile it again"
                    )
                self._ids.update((element, i) for i, element in enumerate(elements))

    def find(self, elements: Sequence[Element | str]) -> tuple[type | None, list[int]]:
        """The class that elements have in common, None of no elements, and their ids.

        Args:
            elements: elements or full names. A name that elements of several kinds have means the first kind of `KINDS`
                that has all names given.

        Raises:
            InvalidInputError: not elements of one kind, or not part of the model.
            UnknownNameError: there is no element of a name.
        """
        if not elements:
            return None, []
        names = [element for element in elements if isinstance(element, str)]
        classes = {type(element) for element in elements if not isinstance(element, str)}
        for element in elements:
            if not isinstance(element, str) and type(element) not in KINDS:
                raise InvalidInputError(f"{shown(element)} is not an element of an MjSpec that can be bound")
        if len(classes) > 1:
            kinds = sorted(KINDS[each].name for each in classes)
            raise InvalidInputError(f"elements must be of one kind, got {' and '.join(kinds)}")
        found = classes.pop() if classes else self._class_of(names)
        kind = KINDS[found]
        return found, [self._named(kind, each) if isinstance(each, str) else self._id(kind, each) for each in elements]

    def _class_of(self, names: list[str]) -> type:
        for candidate, kind in KINDS.items():
            if all(self._index(kind, name) >= 0 for name in names):
                return candidate
        known = {name: None for kind in KINDS.values() for name in self._names(kind)}
        for name in names:
            if name not in known:
                raise UnknownNameError("element", name, known)
        raise InvalidInputError(f"elements must be of one kind; no kind has all of {', '.join(names)}")

    def _names(self, kind: Kind) -> list[str]:
        count = getattr(self._model, kind.count)
        return [name for i in range(count) if (name := mujoco.mj_id2name(self._model, kind.object_type, i))]

    def _named(self, kind: Kind, name: str) -> int:
        index = self._index(kind, name)
        if index < 0:
            raise UnknownNameError(kind.name, name, self._names(kind))
        return index

    def _index(self, kind: Kind, name: str) -> int:
        try:
            return int(mujoco.mj_name2id(self._model, kind.object_type, name))
        except TypeError:  # not a text in UTF-8, which no name in a model is
            return -1

    def _id(self, kind: Kind, element: Element) -> int:
        if self._ids is not None:
            found = self._ids.get(element, -1)
        else:
            found = self._index(kind, element.name) if element.name else -1
        if found < 0:
            raise InvalidInputError(
                f"{kind.name} {element.name!r} is not part of this physics: it belongs to another model, "
                "or was attached or added after this one was compiled"
            )
        return int(found)
