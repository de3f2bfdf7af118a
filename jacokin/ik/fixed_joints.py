"""`FixedJoints`: every branch of an arm of more than six joints, the others held at given values.

An arm whose extra joints stand still is an arm of six joints: its chain is written anew without them, and the closed
form of six joints solves it. Seven joints of any structure are searched so, one value of a joint at a time.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.closed_form import ClosedForm
from jacokin.ik.solutions.points import Points
from jacokin.ik.solutions.solution_set import Touching
from jacokin.ik.verification import Verifier
from jacokin.model import angles, checks
from jacokin.model.robot import Robot

SIX = 6  # joints that the closed form solves for


class FixedJoints:
    """An arm of which all joints but six are held; immutable.

    Attributes:
        values: (dof,) values of the joints that are held [rad or m], NaN for the six others.
    """

    __slots__ = ("_form", "_verifier", "values")

    def __init__(self, verifier: Verifier, values: tuple[float | None, ...]) -> None:
        """Write the chain without the joints that are held, and prepare its closed form: a tenth of a second.

        Args:
            verifier: the arm, frame and tool.
            values: as `checked_values` returns them.

        Raises:
            StructureError: the six others are not turning joints that move the frame in six independent ways.
        """
        robot, snap = verifier.robot, verifier.options.limit_snap
        self._verifier, self.values = verifier, checks.sealed(np.array(values, dtype=np.float64))
        free = np.isnan(self.values)
        model, frame_id = hold(robot.pin_model, verifier.frame_id, self.values)
        self._form = ClosedForm(model, frame_id, verifier.tool, robot.lower[free], robot.upper[free], limit_snap=snap)

    def solve_all(self, T: Array, seed: Array) -> PointsOfFixed:
        """Every branch with those values, nearest to the seed first.

        Args:
            T: (4, 4) target T_base_tool.
            seed: (dof,) [rad or m].
        """
        robot, free = self._verifier.robot, np.isnan(self.values)
        away = angles.circular_distance(np.where(free, seed, self.values), seed, robot.unlimited)
        found = self._form.solve_all(T, seed[free])
        return PointsOfFixed(found.rows, found.dropped, seed, self._verifier, self.values, float(away))


class PointsOfFixed(Points):
    """Points of an arm of more than six joints, those joints that are held in their places."""

    __slots__ = ("_held", "_values")

    def __init__(
        self,
        rows: Array,
        dropped: bool,
        seed: Array,
        verifier: Verifier,
        values: Array,
        held: float,
        touching: Touching | None = None,
    ) -> None:
        """Take the rows (k, 17) of the other joints.

        Args:
            rows: those.
            dropped: as `Points` takes it.
            seed: (dof,) [rad or m].
            verifier: of the whole arm.
            values: (dof,) values of the joints that are held [rad or m], NaN for the others.
            held: how far those are from the seed [rad or m].
            touching: as `Points` takes it.
        """
        super().__init__(rows, dropped, seed, verifier, touching)
        self._values, self._held = values, held

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Rebuild from the arrays, which stay read-only."""
        shared = self.rows, self.dropped, self._seed, self._verifier
        return type(self), (*shared, self._values, self._held, self.touching)

    @property
    def q(self) -> Array:
        """(k, dof) joint values [rad or m]: unlimited joints nearest to the seed, the held ones as they were given."""
        return self._placed(self._values, super().q)

    @property
    def margin(self) -> Array:
        """(k, dof) distance to the nearer limit [rad or m]: negative outside, inf for an unlimited joint."""
        robot = self._known().robot
        return self._placed(np.minimum(self._values - robot.lower, robot.upper - self._values), super().margin)

    @property
    def distance(self) -> Array:
        """(k,) distance to the seed [rad], Euclidean over all joints, circular on unlimited ones."""
        return checks.sealed(np.hypot(super().distance, self._held))

    def _placed(self, held: Array, others: Array) -> Array:
        """(k, dof): values of the joints that are held, and those of the others (k, 6)."""
        rows = np.tile(held, (len(others), 1))
        rows[:, np.isnan(self._values)] = others
        return checks.sealed(rows)


def checked_values(robot: Robot, fixed: Mapping[str, float]) -> tuple[float | None, ...]:
    """Check which joints are held where; (dof,) values [rad or m], None for the six others.

    Raises:
        UnknownNameError: no such joint.
        InvalidInputError: a value that is not a number within the joint's limits, or not all joints but six.
    """
    values: list[float | None] = [None] * robot.dof
    for name, value in checks.mapping("fixed", fixed, "a dict of joint names and values").items():
        index = robot.joint_index(name)
        values[index] = held = checks.number(f"fixed[{name!r}]", value, "m" if robot.sliding[index] else "rad")
        if not robot.lower[index] <= held <= robot.upper[index]:
            raise InvalidInputError(
                f"fixed[{name!r}] = {held:g} is outside the limits {robot.lower[index]:g} to "
                f"{robot.upper[index]:g} of that joint"
            )
    if values.count(None) != SIX or robot.dof == SIX:
        raise InvalidInputError(
            f"fixed must hold all joints but six: {max(robot.dof - SIX, 0)} of {robot.name}'s {robot.dof}, "
            f"not {len(fixed)}"
        )
    return tuple(values)


def hold(model: pin.Model, frame_id: int, values: Array) -> tuple[pin.Model, int]:
    """A model whose joints with values [rad or m] stand still, NaN for those that move; and the frame's id in it."""
    held = pin.Model()
    held.name = model.name
    # Of each joint: what carries it in the new model, and its own placement there.
    carried: list[tuple[int, pin.SE3]] = [(0, pin.SE3.Identity())]
    for index in range(1, model.njoints):
        parent, T_parent = carried[model.parents[index]]
        placement, joint = T_parent * model.jointPlacements[index], model.joints[index]
        if np.isnan(values[joint.idx_v]):
            carried.append((held.addJoint(parent, joint, placement, model.names[index]), pin.SE3.Identity()))
            continue
        motion = joint.createData()
        joint.calc(motion, values)
        carried.append((parent, placement * motion.M))
    frame = model.frames[frame_id]
    carrier, T_carrier = carried[frame.parentJoint]
    return held, held.addFrame(pin.Frame(frame.name, carrier, 0, T_carrier * frame.placement, frame.type), False)
