"""`Gripper`: which values open it, how far, and where the middle between its pads is, measured on its shapes.

Fingers may slide or turn, two against each other or one jaw against one that stands. All joints of the gripper take one
value, clipped into the limits of each, and those that mimic one follow it. Along lines in the direction in which the
fingers close, the room between the two sides is measured from shut to open: the pads are where it grows and closes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array, Sealed
from jacokin.errors import InvalidInputError, ModelError
from jacokin.model import checks, poses
from jacokin.model.descriptions import bundled
from jacokin.model.descriptions.meshes import convex_hull
from jacokin.model.descriptions.shapes import Shape
from jacokin.model.robot import Robot, checked_robot

STEPS = 41  # values from shut to open at which the room is measured
FIRST = 4  # of these steps tell in which direction the gripper opens
STILL = 1e-6  # [m] that a shape of a palm moves, by rounding
ALIKE = 0.5  # cosine between the directions of two fingers of one gripper, at least
PARALLEL = 1e-9  # of a line to a face of a shape
SPARE = 0.006  # [m] between a pad and an object on each side, of a measured gripper


@poses.giving_copies("pads")
@dataclass(frozen=True, slots=True, eq=False)
class Gripper(Sealed):
    """A gripper whose two sides close along a line.

    Attributes:
        frame: the tool that grasps pose: a frame of the arm.
        pads: T_tool_pads: x is the direction along which the pads close, z points away from the palm, and the origin
            is in the middle of the pads, but for `middles`.
        openings: (n,) values of the joints, from shut to open [rad], or [m] where they slide.
        widths: (n,) room between the pads then [m], growing.
        middles: (n,) where the middle between the pads is along x then [m]; it moves where one jaw stands.
        depth: how far from the middle of the pads their end at the palm is [m].
        ahead: how far from the middle of the pads the tips of the fingers reach [m].
        spare: room to leave between a pad and an object on each side [m].
        palm: how far from the middle of the pads the palm begins, or what else is between the open pads [m]; negative
            where that is ahead of the middle. An object stays before it. Infinite where `depth` says it.

    Raises:
        InvalidInputError: malformed, or openings that do not rise or fall, or widths that do not grow.
    """

    frame: str
    pads: pin.SE3
    openings: Array
    widths: Array
    middles: Array
    depth: float
    ahead: float
    spare: float = SPARE
    palm: float = np.inf

    def __post_init__(self) -> None:
        """Check the numbers, and keep copies of them."""
        checks.word("frame", self.frame)
        object.__setattr__(self, "pads", poses.checked_pose(self.pads, "pads"))
        count = max(2, checks.array("openings", self.openings, "numbers").size)
        for name in ("openings", "widths", "middles"):
            values = checks.vector(name, checks.array(name, getattr(self, name), "numbers"), count, "")
            object.__setattr__(self, name, checks.read_only(values))
        moves = np.diff(self.openings)
        if not ((moves > 0.0).all() or (moves < 0.0).all()):
            raise checks.refusal("openings", "from shut to open, rising or falling", self.openings)
        if not (self.widths[0] >= 0.0 and (np.diff(self.widths) > 0.0).all()):
            raise checks.refusal("widths", "growing from shut to open, and not negative", self.widths, "m")
        for name, check in (("depth", checks.non_negative), ("ahead", checks.number), ("spare", checks.non_negative)):
            object.__setattr__(self, name, check(name, getattr(self, name), "m"))
        if self.palm != np.inf:
            object.__setattr__(self, "palm", checks.number("palm", self.palm, "m"))

    @classmethod
    def of(cls, robot: Robot, frame: str | None = None) -> Gripper:
        """The gripper that an arm carries; that of a Jaco from a table, others measured on the shapes of the arm.

        Args:
            robot: the arm.
            frame: the tool that grasps pose; None for the robot's default frame. It moves with the gripper.

        Raises:
            ModelError: no joint opens a gripper there, or its fingers do not close along one line; `ShapeError` where
                the shapes of the description cannot be loaded.
            UnknownNameError: no such frame.
        """
        arm = checked_robot("robot", robot)
        name = arm.default_frame if frame is None else checks.text("frame", frame)
        arm.frame_id(name)
        if arm.source.bundled in bundled.JACOS and name == JACO.frame:
            return JACO
        return arm.once(_measure, name)

    @property
    def span(self) -> float:
        """How wide an object may be [m]."""
        return float(self.widths[-1]) - 2.0 * self.spare

    def opening_for(self, width: float) -> float:
        """The value of the joints [rad], or [m], at which something so wide [m] has room between the pads.

        Raises:
            InvalidInputError: wider than `span`.
        """
        needed = checks.positive("width", width, "m") + 2.0 * self.spare
        if needed > self.widths[-1]:
            raise InvalidInputError(f"{width:.3g} m is more than the hand spans, {self.span:.3g} m")
        return float(np.interp(needed, self.widths, self.openings))

    def pads_at(self, opening: float) -> pin.SE3:
        """T_tool_pads with the origin in the middle between the pads at an opening [rad], or [m]."""
        rising = np.argsort(self.openings)
        middle = float(np.interp(opening, self.openings[rising], self.middles[rising]))
        return self.pads * pin.SE3(np.eye(3), np.array([middle, 0.0, 0.0]))

    def widest(self, openings: Sequence[float]) -> float:
        """The one of some openings at which there is most room."""
        return max(openings) if self.openings[-1] > self.openings[0] else min(openings)


#: The hand of the Jacos: the room at each angle of the fingers, of the shapes in the descriptions; the knuckles are
#: nearer than the pads, and farther back than `depth` is the palm.
JACO: Gripper = Gripper(
    frame="end_effector",
    pads=pin.SE3.Identity(),
    openings=np.array([1.35, 1.2, 1.0, 0.8, 0.6, 0.4, 0.15]),
    widths=2.0 * np.array([0.003, 0.011, 0.021, 0.031, 0.041, 0.050, 0.060]),
    middles=np.zeros(7),
    depth=0.017,
    ahead=0.0,  # tips that bend around an object do not reach beyond it
    spare=0.019,
)


def opening_range(robot: Robot) -> tuple[float, float]:
    """Values of the joints of an arm's gripper where it is open, and where it is shut [rad], or [m] where they slide.

    Raises:
        ModelError: as `Gripper.of`.
    """
    row = None if robot.source.bundled is None else bundled.finger(robot.source.bundled)
    if row is not None:
        return float(row["lower"]), float(row["upper"])
    hand = Gripper.of(robot)
    return float(hand.openings[-1]), float(hand.openings[0])


class _Hull(NamedTuple):
    """One convex shape of the hand."""

    corners: Array
    """(n, 3) in its own frame [m]."""
    faces: Array
    """(m, 4) normals, and distances of the faces from the origin of its frame, negative within [m]."""
    placements: list[pin.SE3]
    """T_tool_shape at each value."""

    def points(self, step: int) -> Array:
        """(n, 3) of the corners in the tool frame [m]."""
        T = self.placements[step]
        return np.asarray(self.corners @ T.rotation.T + T.translation)

    def middle(self, step: int) -> Array:
        """(3,) mean of the corners in the tool frame [m]."""
        return np.asarray(self.points(step).mean(axis=0))

    def opens(self) -> Array:
        """(3,) how the corner that moves farthest moves as the gripper begins to open, in the tool frame [m].

        The tip of a finger on a hinge, which moves more nearly across the finger than its middle does.
        """
        moves = self.points(FIRST) - self.points(0)
        return np.asarray(moves[int(np.linalg.norm(moves, axis=1).argmax())])

    def distances_in_tool(self, points: Array, step: int) -> Array:
        """(n,) how far points (n, 3) of the tool frame are outside, at least [m]; negative within."""
        T = self.placements[step].inverse()
        placed = points @ T.rotation.T + T.translation
        return np.asarray((placed @ self.faces[:, :3].T + self.faces[:, 3]).max(axis=1))

    def between(self, step: int, points: Array, direction: Array) -> tuple[Array, Array]:
        """Where lines through points (n, 3) of the tool frame enter and leave it [m]; infinite and minus for never."""
        T = self.placements[step].inverse()
        start = points @ T.rotation.T + T.translation
        slope = self.faces[:, :3] @ (T.rotation @ direction)
        offset = start @ self.faces[:, :3].T + self.faces[:, 3]
        with np.errstate(divide="ignore", invalid="ignore"):
            at = -offset / slope
        enter = np.where(slope < -PARALLEL, at, -np.inf).max(axis=1)
        leave = np.where(slope > PARALLEL, at, np.inf).min(axis=1)
        missed = (enter > leave) | ((np.abs(slope) <= PARALLEL) & (offset > 0.0)).any(axis=1)
        return np.where(missed, np.inf, enter), np.where(missed, -np.inf, leave)


def _measure(robot: Robot, frame: str) -> Gripper:
    """The gripper on the link of a frame, from the shapes of the description."""
    joint = int(robot.pin_model.frames[robot.frame_id(frame)].parentJoint)
    values = np.linspace(*_range(robot, joint), STEPS)
    hulls = _hulls(robot, frame, joint, values)
    moving = [hull for hull in hulls if _travel(hull) > STILL]
    still = [hull for hull in hulls if _travel(hull) <= STILL]
    if not moving:
        raise ModelError(
            f"the gripper of {robot.name} cannot be measured: its fingers have no collision shapes; "
            "give their links <collision> in the file, or jacokin.model.Gripper(...) with numbers of your own"
        )
    if _is_shut_last(moving, still):
        values = values[::-1]
        hulls, moving, still = (
            [hull._replace(placements=hull.placements[::-1]) for hull in each] for each in (hulls, moving, still)
        )
    right, left = _sides(robot, moving, still)
    if not left:
        raise ModelError(
            f"the gripper of {robot.name} cannot be measured: nothing faces its only finger, as its link has no "
            "collision shapes"
        )
    axes = _axes(robot, frame, joint, right, left, moving)
    return _between(robot, frame, axes, values, right, left, hulls)


def _range(robot: Robot, joint: int) -> tuple[float, float]:
    """Least and largest value of the joints that open the gripper behind a joint of the arm.

    A joint without limits beside others turns a wheel of the drive, or nothing.

    Raises:
        ModelError: there are none, or none has limits.
    """
    from jacokin.model.descriptions import mjcf
    from jacokin.model.mujoco_twin import passive_joints, with_shapes

    source, model = with_shapes(robot).model, robot.pin_model
    following = {follower for follower, *_ in robot.source.followers} | {name for name, _ in robot.source.locked}
    following |= passive_joints(robot)
    ranges, endless = list[Array](), ""
    for index in range(source.njnt):
        name, link = mjcf.joint_name(source, index), mjcf.body_name(source, int(source.jnt_bodyid[index]))
        if name in robot.joint_names or name in following or source.jnt_type[index] not in mjcf.SCALAR_JOINTS:
            continue
        if link not in robot.frames or model.frames[robot.frame_id(link)].parentJoint != joint:
            continue
        # No finger moves farther than 300 degrees.
        if source.jnt_limited[index] and np.ptp(source.jnt_range[index]) <= 5.2:
            ranges.append(source.jnt_range[index])
        else:
            endless = name
    if endless and not ranges:
        raise ModelError(
            f"the gripper of {robot.name} cannot be measured: its joint {endless!r} has no limits, or a whole turn; "
            "write those of the fingers into the file, or give jacokin.model.Gripper(...) with numbers of your own"
        )
    if not ranges:
        raise ModelError(f"{robot.name} has no gripper: no joint moves fingers on the link of its tool")
    low, high = np.array(ranges).T
    return float(low.min()), float(high.max())


def _hulls(robot: Robot, frame: str, joint: int, values: Array) -> list[_Hull]:
    """The shapes of the hand, and where they are at each value."""
    from jacokin.model.mujoco_twin import shapes_of_description

    T_tool_link = robot.pin_model.frames[robot.frame_id(frame)].placement.inverse()
    at_each = [
        [shape for shape in shapes_of_description(robot, float(value)).shapes if shape.joint == joint]
        for value in values
    ]
    found = []
    for index, shape in enumerate(at_each[0]):
        corners = _corners(shape)
        hull = convex_hull(corners)
        if hull is not None:  # nothing is grasped with what is flat
            placements = [T_tool_link * shapes[index].placement for shapes in at_each]
            found.append(_Hull(corners, hull.equations, placements))
    return found


def _corners(shape: Shape) -> Array:
    """(n, 3) points whose convex hull is the shape, or has corners on it where it is round [m]."""
    if shape.kind == "mesh":
        return shape.vertices
    signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
    if shape.kind == "box":
        return np.asarray(signs * shape.size)
    turns = np.arange(16) * np.pi / 8.0
    ring = np.column_stack([np.cos(turns), np.sin(turns), np.zeros(len(turns))])
    if shape.kind == "cylinder":
        return np.vstack([ring * shape.size[0] + [0.0, 0.0, side * shape.size[1]] for side in (-1.0, 1.0)])
    lines = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9)
    ball = np.vstack([ring * np.cos(line) + [0.0, 0.0, np.sin(line)] for line in lines])
    if shape.kind == "capsule":
        return np.vstack([ball * shape.size[0] + [0.0, 0.0, side * shape.size[1]] for side in (-1.0, 1.0)])
    return np.asarray(ball * (shape.size if shape.kind == "ellipsoid" else shape.size[0]))


def _travel(hull: _Hull) -> float:
    """How far a shape moves from one value to another, at most [m]."""
    first = hull.points(0)
    return max(float(np.abs(hull.points(step) - first).max()) for step in range(len(hull.placements)))


def _sides(robot: Robot, moving: list[_Hull], still: list[_Hull]) -> tuple[list[_Hull], list[_Hull]]:
    """The shapes that move with the one that moves farthest as the gripper opens, and those that they close against.

    Raises:
        ModelError: the fingers move in more than one direction and its opposite.
    """
    bodies = _bodies(moving)
    moves = np.array([max((hull.opens() for hull in body), key=lambda move: float(move @ move)) for body in bodies])
    lengths = np.linalg.norm(moves, axis=1)
    farthest = moves[lengths.argmax()]
    against = moves[np.linalg.norm(moves - farthest, axis=1).argmax()]
    common = np.zeros(3)  # what both sides do, as pads on arcs that go forwards while they close
    if np.linalg.norm(against - farthest) > ALIKE * lengths.max():
        common = 0.5 * (farthest + against)
    along = (farthest - common) / np.linalg.norm(farthest - common)
    right, left = list[_Hull](), list[_Hull]()
    for body, move, length in zip(bodies, moves - common, lengths, strict=True):
        cosine = float(move @ along) / max(float(np.linalg.norm(move)), STILL)
        if length > ALIKE * lengths.max() and abs(cosine) < ALIKE:
            raise ModelError(
                f"the gripper of {robot.name} cannot be measured: its fingers do not close along one line; give "
                "jacokin.model.Gripper(...) with numbers of your own"
            )
        (right if cosine > 0.0 else left).extend(body)
    return right, left or still


def _bodies(hulls: list[_Hull]) -> list[list[_Hull]]:
    """The shapes by what moves them: those of one body stay where they are to each other."""
    found = list[list[_Hull]]()
    for hull in hulls:
        for body in found:
            between = [body[0].placements[k].actInv(hull.placements[k]) for k in (0, STEPS // 2, STEPS - 1)]
            if all(between[0].isApprox(other, STILL) for other in between[1:]):
                body.append(hull)
                break
        else:
            found.append([hull])
    return found


def _is_shut_last(moving: list[_Hull], still: list[_Hull]) -> bool:
    """Whether what moves is nearer to what it may close against at the last value than at the first one."""
    bodies = _bodies(moving)

    def apart(step: int) -> float:
        found = [0.0]
        for body in bodies:
            others = [hull for other in bodies if other is not body for hull in other] or still
            for points in (hull.points(step) for hull in body):
                each = [other.distances_in_tool(points, step) for other in others]
                found.append(float(np.maximum(np.min(each, axis=0), 0.0).mean()) if each else 0.0)
        return float(np.mean(found))

    return apart(STEPS - 1) < apart(0)


def _axes(robot: Robot, frame: str, joint: int, right: list[_Hull], left: list[_Hull], moving: list[_Hull]) -> Array:
    """R_tool_pads: x along which the gripper opens, z away from the palm; snapped to the axes of the tool."""
    opening = np.mean([hull.opens() for hull in right], axis=0) - np.mean([hull.opens() for hull in left], axis=0)
    along = _snapped(opening / np.linalg.norm(opening))
    origin = robot.pin_model.frames[robot.frame_id(frame)].placement.inverse().translation  # of the joint, in the tool
    away = np.mean([hull.middle(0) for hull in moving], axis=0) - origin
    away = away - (away @ along) * along
    if np.linalg.norm(away) <= STILL:
        raise ModelError(
            f"the gripper of {robot.name} cannot be measured: joint {robot.joint_names[joint - 1]!r} is between its "
            "pads, so that nothing tells where its palm is"
        )
    away = _snapped(away / np.linalg.norm(away))
    away = away - (away @ along) * along
    away = away / np.linalg.norm(away)
    return np.column_stack([along, np.cross(away, along), away])


def _snapped(direction: Array) -> Array:
    """The axis of the tool that a direction is about, or the direction itself."""
    most = int(np.abs(direction).argmax())
    if abs(direction[most]) < np.cos(0.6):  # 34 degrees: the tip of a jaw moves that far aslant
        return direction
    return np.asarray(np.sign(direction[most]) * np.eye(3)[most])


def _between(
    robot: Robot, frame: str, axes: Array, values: Array, right: list[_Hull], left: list[_Hull], hulls: list[_Hull]
) -> Gripper:
    """The room between the sides at each value, and where it is."""
    corners = np.vstack([hull.points(0) for hull in right]) @ axes
    (low_y, low_z), (high_y, high_z) = corners[:, 1:].min(axis=0), corners[:, 1:].max(axis=0)
    inside = (np.arange(25) + 0.5) / 25.0
    y, z = np.meshgrid(low_y + inside * (high_y - low_y), low_z + inside * (high_z - low_z))
    lines = np.column_stack([np.zeros(y.size), y.ravel(), z.ravel()])
    points, along = lines @ axes.T, axes[:, 0]
    near = np.array([np.min([h.between(k, points, along)[0] for h in right], axis=0) for k in range(STEPS)])
    far = np.array([np.max([h.between(k, points, along)[1] for h in left], axis=0) for k in range(STEPS)])
    met = np.isfinite(near) & np.isfinite(far)
    with np.errstate(invalid="ignore"):
        room = np.where(met, near - far, np.nan)
        growth, shut = room[FIRST] - room[0], np.maximum(room[0], 0.0)
        known = np.isfinite(growth)
        if not known.any() or float(np.nanmax(growth)) <= STILL:
            raise ModelError(
                f"the gripper of {robot.name} cannot be measured: its shapes do not face each other along the line "
                "on which it closes; give jacokin.model.Gripper(...) with numbers of your own"
            )
        pads = known & (growth >= 0.6 * np.nanmax(growth))  # slower lines run near a hinge
        # [m] more room between shut fingers than at the narrowest line is behind the pads.
        pads &= shut <= np.nanmin(np.where(pads, shut, np.nan)) + 0.005
    found = list[tuple[float, float, float]]()
    for step in range(STEPS):
        both = pads & met[step]
        if both.sum() < 0.5 * pads.sum():  # a jaw that turned so far faces something else
            break
        ends = float(far[step, both].max()), float(near[step, both].min())
        found.append((float(values[step]), ends[1] - ends[0], 0.5 * (ends[0] + ends[1])))
    rows = np.array(found)
    rows = rows[: int(rows[:, 1].argmax()) + 1]
    rows = rows[np.flatnonzero(np.append(rows[1:, 1] > 0.0, True))[0] :]
    rows = rows[np.append(True, np.diff(np.maximum.accumulate(rows[:, 1])) > 0.0)]
    if len(rows) < 2:
        cure = "give jacokin.model.Gripper(...) with numbers of your own"
        if not robot.source.decompose:
            cure = "load the robot with decompose=True, if they are hulls of hollow meshes"
        raise ModelError(f"the gripper of {robot.name} cannot be measured: there is no room between its shapes; {cure}")
    ends_z = float(lines[pads, 2].min()), float(lines[pads, 2].max())
    low_y, high_y = float(lines[pads, 1].min()), float(lines[pads, 1].max())
    middle = np.array([0.0, 0.5 * (low_y + high_y), 0.5 * sum(ends_z)])
    opened, wide = int(np.flatnonzero(values == rows[-1, 0])[0]), 0.5 * rows[-1, 1] - SPARE
    inside = np.linspace(-1.0, 1.0, 5)
    tips = max(float((hull.points(0) @ axes)[:, 2].max()) for hull in hulls)
    x, y = np.meshgrid(rows[-1, 2] + max(wide, 0.0) * inside, middle[1] + 0.5 * (high_y - low_y) * inside)
    between = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, tips)]) @ axes.T
    return Gripper(
        frame=frame,
        pads=pin.SE3(axes, axes @ middle),
        openings=rows[:, 0],
        widths=np.maximum(rows[:, 1], 0.0),
        middles=rows[:, 2],
        depth=0.5 * (ends_z[1] - ends_z[0]),
        ahead=tips - float(middle[2]),
        palm=_room_behind(hulls, opened, between, axes[:, 2]) - (tips - float(middle[2])),
    )


def _room_behind(hulls: list[_Hull], step: int, points: Array, away: Array) -> float:
    """How far lines from points (n, 3) of the tool frame towards the palm are free, at least [m]."""
    found = np.inf
    for hull in hulls:
        enter, leave = hull.between(step, points, -away)
        found = min(found, float(np.maximum(enter, 0.0)[leave > 0.0].min(initial=np.inf)))
    return found
