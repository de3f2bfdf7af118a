"""Reads the tables into one tree of bodies per robot: what both writers work from."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jacokin.model.descriptions.bundled import TABLES, in_hand, parse_angle, read_tables, section
from urdf.checks import check

FOLDER = Path(__file__).resolve().parent
# Below this a sine or cosine of a multiple of pi/6 is rounding and written as 0.
ROUNDING = 1e-15

Vector = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Placement:
    """Where a child frame stands in its parent frame, its rotation in the notation of either format."""

    xyz: Vector  # [m]
    rpy: Vector  # [rad], R = Rz(yaw) Ry(pitch) Rx(roll)
    quat_wxyz: Vector  # unit norm


@dataclass(frozen=True, slots=True)
class Joint:
    """A hinge about +z of the child frame; ``limits`` is None for a continuous joint."""

    name: str
    limits: tuple[float, float] | None  # [rad]
    velocity: float  # [rad/s]
    effort: float  # [N m], the URDF's
    group: str


@dataclass(frozen=True, slots=True)
class Inertial:
    """Mass properties about the centre of mass, in the axes of the body."""

    mass: float  # [kg]
    com: Vector  # [m]
    inertia: Vector  # [kg m^2], ixx iyy izz ixy ixz iyz


@dataclass(frozen=True, slots=True)
class Shape:
    """A primitive. ``size``: box half sides; cylinder radius, half length; sphere radius [m]."""

    name: str
    kind: str
    size: Vector
    placement: Placement
    look: str


@dataclass(frozen=True, slots=True)
class Body:
    """A link of the URDF, a body of the MJCF. The root has no parent; a rigid child has no joint."""

    name: str
    parent: str | None
    placement: Placement
    joint: Joint | None
    inertial: Inertial | None
    shapes: tuple[Shape, ...]


@dataclass(frozen=True, slots=True)
class Frame:
    """A named frame without mass: a link of the URDF, a site of the MJCF."""

    name: str
    parent: str
    placement: Placement


@dataclass(frozen=True, slots=True)
class Description:
    """One robot: bodies in an order in which parents come first, frames, pairs that must not collide."""

    name: str
    family: str
    bodies: tuple[Body, ...]
    frames: tuple[Frame, ...]
    excluded: tuple[tuple[str, str], ...]

    def hand_bodies(self) -> tuple[Body, ...]:
        """The hand and everything on it; nothing where there is none."""
        names = [body.name for body in self.bodies]
        return self.bodies[names.index("hand") :] if "hand" in names else ()

    def arm_bodies(self) -> tuple[Body, ...]:
        """Everything up to the hand."""
        return self.bodies[: len(self.bodies) - len(self.hand_bodies())]


def read_table() -> dict[str, Any]:
    """All files as one dictionary; the shapes are under ``"shapes"``.

    Raises:
        ModelError: a robot is not complete; see `checks.check`.
    """
    table = read_tables(FOLDER, *TABLES)
    table["shapes"] = read_tables(FOLDER, "shapes.toml")
    check(table)
    return table


def describe(table: Mapping[str, Any], name: str) -> Description:
    """Assemble the arm and hand called ``name`` from the table."""
    variant = table["variants"][name]
    masses = section(table["masses"], name)
    shapes = section(table["shapes"], variant["arm"])
    hand = in_hand(table, variant["hand"])
    if hand:
        shapes |= section(table["shapes"], variant["hand"])

    def body(name: str, parent: str | None, row: Mapping[str, Any], joint: Joint | None, kind: str = "") -> Body:
        kind = kind or name
        return Body(
            name=name,
            parent=parent,
            placement=placement(row),
            joint=joint,
            inertial=_inertial(section(masses, kind)) if kind in masses else None,
            shapes=tuple(_shape(row) for row in section(shapes, kind)["parts"]),
        )

    bodies = [body("link_base", None, {}, None)]
    rows = section(table["arms"], variant["arm"])
    for joint_name in (key for key in rows if key.startswith("joint_")):
        row = rows[joint_name]
        bodies.append(body(row["child"], row["parent"], row, _joint(joint_name, row)))
    last_link = bodies[-1].name
    if hand:
        bodies.append(body("hand", last_link, {}, None))
    for finger in hand.get("fingers", ()):
        link, tip = f"link_{finger}", f"link_{finger.replace('finger', 'finger_tip')}"
        bodies.append(body(link, "hand", hand[finger], _joint(finger, hand["finger"]), "link_finger"))
        bodies.append(body(tip, link, hand["finger_tip"], None, "link_finger_tip"))

    of_hand = hand.get("sites", ())
    sites = {s: row for s, row in rows.get("sites", table["sites"]).items() if row["parent"] != "hand" or s in of_hand}
    return Description(
        name=name,
        family=variant["family"],
        bodies=tuple(bodies),
        frames=tuple(
            Frame(s, last_link if row["parent"] == "last_link" else row["parent"], placement(row))
            for s, row in sites.items()
        ),
        excluded=_excluded(table["contacts"], hand.get("fingers", ())),
    )


def placement(row: Mapping[str, Any]) -> Placement:
    """The pose in a section: ``xyz`` and one of ``rpy``, ``quat_wxyz``; what is missing is zero."""
    xyz = tuple(float(x) for x in row.get("xyz", (0.0, 0.0, 0.0)))
    if "quat_wxyz" in row:
        norm = math.hypot(*row["quat_wxyz"])
        quat_wxyz = tuple(x / norm for x in row["quat_wxyz"])
        return Placement(xyz, _rpy_from_quat(quat_wxyz), quat_wxyz)
    rpy = tuple(parse_angle(x) for x in row.get("rpy", (0.0, 0.0, 0.0)))
    return Placement(xyz, rpy, _quat_from_rpy(rpy))


def _quat_from_rpy(rpy: Vector) -> Vector:
    (cr, cp, cy), (sr, sp, sy) = ([f(a / 2) for a in rpy] for f in (math.cos, math.sin))
    quat = (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
    return tuple(0.0 if abs(x) < ROUNDING else x for x in quat)


def _rpy_from_quat(quat_wxyz: Vector) -> Vector:
    w, x, y, z = quat_wxyz
    return (
        math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        math.asin(2 * (w * y - z * x)),
        math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    )


def _joint(name: str, row: Mapping[str, Any]) -> Joint:
    limits = None
    if "lower_deg" in row:
        limits = (math.radians(row["lower_deg"]), math.radians(row["upper_deg"]))
    elif "lower" in row:
        limits = (row["lower"], row["upper"])
    velocity = math.radians(row["velocity_deg"]) if "velocity_deg" in row else row["velocity"]
    return Joint(name, limits, velocity, row["effort"], row["group"])


def _inertial(row: Mapping[str, Any]) -> Inertial:
    return Inertial(row["mass"], tuple(row["com"]), tuple(row["inertia"]))


def _shape(row: Mapping[str, Any]) -> Shape:
    sizes = (row[field] for field in ("radius", "half_length") if field in row)
    size = tuple(row["half_size"]) if row["kind"] == "box" else tuple(sizes)
    return Shape(row["name"], row["kind"], size, placement(row), row["look"])


def _excluded(contacts: Mapping[str, Any], fingers: Sequence[str]) -> tuple[tuple[str, str], ...]:
    pairs = [(a, b) for a, b in contacts["exclude_arm"]]
    if contacts["exclude_hand_finger"]:
        pairs += [("hand", f"link_{finger}") for finger in fingers]
    if contacts["exclude_tip_tip"]:
        tips = [f"link_{finger.replace('finger', 'finger_tip')}" for finger in fingers]
        pairs += [(a, b) for i, a in enumerate(tips) for b in tips[i + 1 :]]
    return tuple(pairs)
