"""`ContactBetween`: contact of an arm with another robot while both move.

Contact depends on how the two stand to each other alone. So they are taken as one serial chain, from the tip of the arm
back to its base, on to the base of the other robot and out to its tip, and what is known of motions of one arm
(`Contact`) holds for it: where both move straight, each of its joints does.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.kernels.contact.shapes import CENTRE, LINK, SIZE
from jacokin.model import poses
from jacokin.model.contact import Contact, Pair
from jacokin.model.contact_arrays import ShapeRow, arm_arrays, joints_about_z
from jacokin.model.obstacles import NOTHING_AROUND, Surroundings
from jacokin.model.other_robot import OtherRobot
from jacokin.model.own_shapes import own_shapes
from jacokin.model.robot import Robot
from jacokin.model.surrounded import allowed_pairs, among_nothing, carried_shapes


class ContactBetween:
    """Contact of an arm, and what it holds, with another robot; may be shared between threads.

    Attributes:
        levers: (dof,) how far a point of the arm can be from the axis of each joint, at most [m]; 1 where one slides.
        other_levers: (m,) the same of the other robot.
    """

    def __init__(self, robot: Robot, around: Surroundings, other: OtherRobot, *, clearance: float = 0.0) -> None:
        """Prepare it.

        Args:
            robot: the arm.
            around: its scene, with the other robot in it.
            other: that robot; where its joints stand does not matter.
            clearance: shapes this near to each other count as touching [m].

        Raises:
            InvalidInputError: the scene does not fit the arm.
            UnknownNameError: the scene speaks of a link that is not there.
            ShapeError: shapes cannot be loaded.
        """
        own = carried_shapes(robot, around)
        alone = Surroundings(finger_angle=other.finger_angle)
        theirs = carried_shapes(other.robot, alone)
        (placements, kinds), (more, other_kinds) = map(joints_about_z, (robot.pin_model, other.robot.pin_model))
        dof = len(kinds)
        back = [_pose(each).inverse() for each in placements]  # from link to link towards the base, joints at zero
        across = back[0] * poses.checked_pose(other.base)
        chain = [pin.SE3.Identity(), *back[:0:-1], across * _pose(more[0]), *map(_pose, more[1:])]

        here = pin.SE3.Identity()
        both = [
            (shape.name, _moved(row, here if shape.joint == dof else back[shape.joint], dof - shape.joint))
            for shape, row in own
        ] + [
            (part.name, _moved(row, here if shape.joint else across, dof + shape.joint))
            for (shape, row), part in zip(theirs, other.parts, strict=True)
        ]
        links = [int(row.integers[LINK]) for _, row in both]
        allowed = allowed_pairs(robot, around, own_shapes(robot, around.finger_angle).names)
        pairs = [
            (a, b)
            for a, b in product(range(len(own)), range(len(own), len(both)))
            if links[a] < links[b]  # bases stand where they stand
            and not (allowed and frozenset((both[a][0], both[b][0])) in allowed)
        ]
        joints = np.array([each.homogeneous[:3] for each in chain]), [*kinds[::-1], *other_kinds]
        arrays = arm_arrays(joints, links, [row for _, row in both], pairs)
        shapes = [
            shape._replace(name=name, joint=link)
            for (shape, _), (name, _), link in zip([*own, *theirs], both, links, strict=True)
        ]
        found = among_nothing(shapes, arrays, len(pairs))
        self._contact = Contact(robot, NOTHING_AROUND, clearance=clearance, found=found)
        self._theirs = frozenset(part.name for part in other.parts)
        self.levers = Contact(robot, around._replace(obstacles=(), allow=())).levers
        self.other_levers = Contact(other.robot, alone).levers

    def in_the_way(self, arm: tuple[Array, Array], other: tuple[Array, Array], extra: float = 0.0) -> Pair | None:
        """Shapes that touch while both go straight, each from one configuration to another [rad]; None if none do.

        Nothing is stepped over; shapes that come within 1e-4 m of the clearance may count too. With `extra` [m] the
        clearance is so much larger.
        """
        begin, end = (np.concatenate([-q[::-1], other_q]) for q, other_q in zip(arm, other, strict=True))
        pair = self._contact.in_the_way(begin, end, extra)
        return pair if pair is None or pair[0] in self._theirs else pair[::-1]

    def distances(self, rows: Array, others: Array) -> Array:
        """Smallest distances (n,) [m] at configurations (n, dof) of the arm and (n, m) of the other robot [rad]."""
        return self._contact.distances(np.hstack([-rows[:, ::-1], others]), self_collision=True)


def _pose(placement: Array) -> pin.SE3:
    return pin.SE3(placement[:, :3], placement[:, 3])


def _moved(row: ShapeRow, pose: pin.SE3, link: int) -> ShapeRow:
    """A shape as one of another link, on which the one that it had stands at a pose."""
    numbers, integers = row.numbers.copy(), row.integers.copy()
    numbers[:SIZE] = (pose * _pose(row.numbers[:SIZE].reshape(3, 4))).homogeneous[:3].ravel()
    numbers[CENTRE : CENTRE + 3] = pose.act(row.numbers[CENTRE : CENTRE + 3])
    integers[LINK] = link
    return row._replace(numbers=numbers, integers=integers)
