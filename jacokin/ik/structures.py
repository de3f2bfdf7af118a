"""`structure`: how the axes of an arm are placed, and by how much; and what an arm of any structure is solved with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import StructureError
from jacokin.ik.geometry import ArmGeometry, Frames, chain_of, frames_at_zero, measure, measure_seven
from jacokin.kernels.closed_form.arm import ARM_CONSTANTS
from jacokin.kernels.library import Call
from jacokin.kernels.six_joints.loop import LABELLINGS, Form, fill_links, joint_of, rotation_about
from jacokin.kernels.six_joints.planar_arm import meeting
from jacokin.kernels.six_joints.ranking import Score, make_rank_work, rank_labellings
from jacokin.kernels.tolerances import DISTINCT, EXACT_MISFIT, EXACT_STRUCTURE, SMALLEST_FREEDOM
from jacokin.model import checks, kinematics, poses
from jacokin.model.robot import Robot, checked_robot

#: Joints of the smallest arm that has sets of points, and the names of such arms.
FEWEST = 3
FEW = "three joints", "four joints", "five joints"
#: Configurations that labellings are tried on, enough to tell those that miss branches: all on the first ones, on the
#: others so many that did best.
RANKED, TRIED_ON_ALL, GOING_ON = 24, 4, 3
#: What one finding counts: a configuration missed, a branch less than another labelling found, a pose in doubt, which
#: needs a neighbour solved, and a place looked at closely. The last two are times, in units of some 60 us.
COSTS = {Score.MISSED: 100.0, Score.BRANCHES_FOUND: -10.0, Score.IN_DOUBT: 1.0, Score.EFFORT: 0.1}


@dataclass(frozen=True, slots=True)
class Residual:
    """By how much an arm misses one property of a structure."""

    name: str
    """The property."""
    position: float
    """How far axes that should meet are apart [m]."""
    angle: float
    """How far axes are from the angle they should enclose [rad]."""

    def __str__(self) -> str:
        """Its name and both deviations, in one line of `jacokin info`."""
        return f"{self.name}: {self.position:.3g} m, {self.angle:.3g} rad"


@dataclass(frozen=True, slots=True)
class Structure:
    """How the axes of an arm are placed, and how its poses are solved."""

    name: str
    """"jaco", "jaco with seven joints", "spherical wrist", "three parallel axes", "general", "five joints",
    "four joints", "three joints" or "none"."""
    method: str
    """What finds the configurations of a pose, in a sentence."""
    residuals: tuple[Residual, ...]
    """By how much the arm misses known structures; they hold where all are rounding."""

    @property
    def gives(self) -> str:
        """What `solve_all` finds for which targets, in a sentence."""
        if "seven" in self.name:
            return "curves of configurations at a pose, and every configuration with one joint fixed (fixed=)"
        return GIVES.get(self.name, "every configuration of a pose, and curves of them about a FreeAxis")


#: What arms of fewer than six joints give, and those that the QP alone solves.
GIVES = {
    "five joints": "every configuration about a FreeAxis, and at poses that the arm can take",
    "four joints": "every configuration at poses that the arm can take",
    "three joints": "every configuration at a position, and at poses that the arm can take",
    "none": "one configuration of a pose, near the seed",
}


def structure(robot: Robot, frame: str | None = None, *, tool: pin.SE3 | ArrayLike | None = None) -> Structure:
    """Name the structure of an arm, with what it misses others by.

    Args:
        robot: the arm.
        frame: the frame to solve for; None for the robot's default frame.
        tool: T_frame_tool, a constant pose after that frame.

    Raises:
        UnknownNameError: unknown frame.
        InvalidInputError: the tool is malformed.
    """
    checked_robot("robot", robot)
    frame_id = robot.frame_id(frame)
    checked = None if tool is None else poses.checked_pose(tool, "tool")
    if _turns_seven(robot, frame_id, checked):
        try:
            measure_seven(robot.pin_model, frame_id, checked)
        except StructureError:
            return Structure("seven joints", "curves in the first or the last joint, through a chain of six", ())
        return Structure("jaco with seven joints", "a closed form for each angle of joint 3: curves", ())
    if FEWEST <= robot.dof < 6 and not robot.sliding.any():
        return Structure(FEW[robot.dof - FEWEST], "every configuration, as a chain of six with virtual joints", ())
    try:
        chain = chain_of(robot.pin_model, frame_id, checked, 6)
    except StructureError as error:
        return Structure("none", f"the QP finds one configuration: {error}", ())
    try:
        geometry = measure(robot.pin_model, frame_id, checked)
    except StructureError as error:
        wrist, parallel = spherical_wrist(chain), parallel_axes(chain)
        jaco = Residual("built like a Jaco", *((error.misfit, 0.0) if error.unit == "m" else (0.0, error.misfit)))
        name = "general"
        if max(wrist.position, wrist.angle) < EXACT_STRUCTURE:
            name = "spherical wrist"
        elif max(parallel.position, parallel.angle) < EXACT_STRUCTURE:
            name = "three parallel axes"
        size = size_of(chain)
        form = quick_form(chain, 1.0 / size) if 0.0 < size < np.inf else NO_FORM
        return Structure(name, form.sentence, (jaco, wrist, parallel))
    return Structure(
        "jaco",
        NO_FORM.sentence if geometry.misfit > EXACT_MISFIT else "every branch, from the Jaco's closed form",
        (Residual("built like a Jaco", float(geometry.misfit), 0.0),),
    )


def _turns_seven(robot: Robot, frame_id: int, tool: pin.SE3 | None) -> bool:
    """Whether an arm is one chain of seven turning joints up to a frame."""
    try:
        chain_of(robot.pin_model, frame_id, tool, 7)
    except StructureError:
        return False
    return True


def spherical_wrist(chain: NDArray[np.float64]) -> Residual:
    """How far the last three axes of a chain (7, 3, 4) are from meeting in one point."""
    return Residual("axes 4, 5 and 6 meet", nearest_to_axes(frames_at_zero(chain)[3:6])[1], 0.0)


def nearest_to_axes(frames: Frames) -> tuple[NDArray[np.float64], float]:
    """The point (3,) nearest to the z axes of some frames, by least squares, and how far it is from one at most."""
    across = [np.eye(3) - np.outer(R[:, 2], R[:, 2]) for R, _ in frames]
    right = np.concatenate([P @ p for P, (_, p) in zip(across, frames, strict=True)])
    point = np.linalg.lstsq(np.concatenate(across), right, rcond=None)[0]
    return point, max(float(np.linalg.norm(P @ (point - p))) for P, (_, p) in zip(across, frames, strict=True))


class EndWrist(NamedTuple):
    """Six joints of which three at an end have axes that meet at right angles, and the other end's two meet."""

    chain: NDArray[np.float64]
    """(7, 3, 4)"""
    arm: NDArray[np.float64]
    """(46,) constants, see `kernels.closed_form.arm`."""
    moved: float
    """How far their axes are from those of the arm that they stand for, in units of its size, or turned [rad]."""


def with_end_wrist(chain: NDArray[np.float64]) -> EndWrist | None:
    """The arm with a wrist at an end that is nearest to an arm (7, 3, 4), with its tool at q = 0; None without any."""
    ends = (0, [3, 4, 5], [0, 1]), (LABELLINGS - 1, [0, 1, 2], [4, 5])
    size, found = size_of(chain), []
    for labelling, wrist, shoulder in ends if 0.0 < size < np.inf else ():
        frames = frames_at_zero(chain)
        middle = frames[wrist[1]][0][:, 2]
        off = [float(frames[j][0][:, 2] @ middle) for j in wrist[::2]]
        moved = max(abs(cosine) for cosine in off)
        if moved > DISTINCT:
            continue
        for j, cosine in zip(wrist[::2], off, strict=True):
            R, p = frames[j]
            x, y, z = np.cross(middle, R[:, 2]) / np.sqrt(1.0 - cosine * cosine)
            frames[j] = rotation_about((x, y, z), float(np.arcsin(cosine))) @ R, p
        for joints in (wrist, shoulder):
            point, misfit = nearest_to_axes([frames[j] for j in joints])
            for j in joints:
                R, p = frames[j]
                frames[j] = R, point + R[:, 2] * float(R[:, 2] @ (p - point))
            moved = max(moved, misfit / size)
        last, placements = (np.eye(3), np.zeros(3)), []
        for R, p in frames:
            placements.append(np.column_stack([last[0].T @ R, last[0].T @ (p - last[1])]))
            last = R, p
        near, links = np.array(placements), np.zeros((6, 3, 4))
        fill_links(near, np.eye(4), 1.0 / size, labelling, links)
        form = wrist_form(links, labelling, 5)
        if form is not None and form.rank == 0:
            arm = np.zeros(ARM_CONSTANTS)
            arm[39:] = 1.0 / size, 0.0, 0.0, form.kind, form.labelling, form.first, form.second
            found.append(EndWrist(near, arm, moved))
    return min(found, key=lambda one: one.moved, default=None)


def parallel_axes(chain: NDArray[np.float64]) -> Residual:
    """How far axes 2, 3 and 4 of a chain (7, 3, 4) are from parallel."""
    *frames, _ = frames_at_zero(chain)
    second, third, fourth = (R[:, 2] for R, _ in frames[1:4])
    sines = (float(np.linalg.norm(np.cross(a, b))) for a, b in ((second, third), (third, fourth)))
    return Residual("axes 2, 3 and 4 are parallel", 0.0, max(float(np.arcsin(min(sine, 1.0))) for sine in sines))


def measure_general(chain: NDArray[np.float64], labellings: Sequence[float] | None = None) -> ArmGeometry:
    """What an arm of any structure is solved with: a scale of its lengths, and the labellings that suit it.

    Args:
        chain: (7, 3, 4) placements between joints that turn about z.
        labellings: those of the arm itself and of its neighbours, if they are known; None to rank all of them.

    Raises:
        StructureError: the joints do not move the tool in six independent ways, whatever their angles; or lengths that
            are not finite.
    """
    size = size_of(chain)
    if not np.isfinite(size):
        raise StructureError("the lengths of the arm must be finite")
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (RANKED, 6))
    freedoms = int((largest_freedoms(chain, q, size) > SMALLEST_FREEDOM).sum())
    if freedoms < 6:
        raise StructureError(f"the joints move the tool in {freedoms} independent ways only, whatever their angles")
    arm = np.zeros(ARM_CONSTANTS)
    form = quick_form(chain, 1.0 / size)
    own, neighbours = rank(chain, q, size) if labellings is None else labellings
    arm[39:] = 1.0 / size, own, neighbours, form.kind, form.labelling, form.first, form.second
    return ArmGeometry(checks.sealed(chain), checks.sealed(arm), 0.0, spherical=False)


def rank(chain: NDArray[np.float64], q: NDArray[np.float64], size: float) -> NDArray[np.int64]:
    """The labellings (2,) that suit an arm and its neighbours best, tried on configurations (n, 6)."""
    limits = np.array([np.full(6, -np.inf), np.full(6, np.inf), np.zeros(6)])
    work = make_rank_work()._replace(chain=chain, scale=np.array([1.0 / size]), limits=limits)
    Call(rank_labellings, work._replace(q=q[:TRIED_ON_ALL].copy()))()
    others = np.argsort(costs_of(work.scores), axis=1, kind="stable")[:, GOING_ON:]
    np.put_along_axis(work.tried, others, 0, axis=1)
    Call(rank_labellings, work._replace(q=q[TRIED_ON_ALL:].copy()))()
    return np.asarray(np.where(work.tried, costs_of(work.scores), np.inf).argmin(axis=1), dtype=np.int64)


def costs_of(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the scores (2, n, 4) of labellings come to (2, n)."""
    weights = np.zeros(scores.shape[2])
    weights[list(COSTS)] = list(COSTS.values())
    return np.asarray(scores @ weights)


def size_of(chain: NDArray[np.float64]) -> float:
    """What lengths of a chain (7, 3, 4) are compared with: about the arm's reach [m]."""
    return 0.5 * float(np.linalg.norm(chain[1:6, :, 3], axis=1).sum())


def largest_freedoms(chain: NDArray[np.float64], q: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    """How far the joints move the tool in independent ways: (6,) falling, the most at any of configurations (n, 6).

    Singular values of the Jacobian; lengths count in units of the arm's size [m].
    """
    jacobian = kinematics.jacobians(kinematics.turning_arm(chain), q, "world")
    jacobian[:, :3] /= size if size > 0.0 else 1.0
    return np.asarray(np.linalg.svd(jacobian, compute_uv=False).max(axis=0))


class QuickForm(NamedTuple):
    """A structure, where it is in the arm, and what the kernels must know about it."""

    kind: int
    """`GENERAL` for none, `SPHERICAL_WRIST`, `PARALLEL_AXES`, `PLANAR_ARM` or `ELBOW_OFFSET`."""
    labelling: int
    """In which the structure has its place."""
    first: float
    """Where axes 4 and 5 of a wrist meet on axis 4; or axes 5 and 6 on axis 5, lengths scaled. Of a planar arm, by how
    much it misses the structure."""
    second: float
    """Where that point is on axis 6; 0 for a planar arm."""
    joints: tuple[int, ...]
    """The joints, from 1: three, or two with parallel axes and then the two beside them."""
    rank: int
    """The lower, the quicker."""

    @property
    def sentence(self) -> str:
        """How poses are solved."""
        if self.kind == Form.SPHERICAL_WRIST:
            return "every branch, in closed form: axes {}, {} and {} meet in one point".format(*self.joints)
        if self.kind == Form.PARALLEL_AXES:
            return "every branch, in closed form: axes {}, {} and {} are parallel".format(*self.joints)
        if self.kind in (Form.PLANAR_ARM, Form.ELBOW_OFFSET):
            degree = 4 if self.kind == Form.PLANAR_ARM else 8
            parts = "axes {} and {} are parallel, {} and {} in one plane across them".format(*self.joints)
            return f"every branch, from a polynomial of degree {degree}: {parts}"
        return "every branch, from a determinant of the closed loop"


NO_FORM = QuickForm(Form.GENERAL, 0, 0.0, 0.0, (), 0)


def quick_form(chain: NDArray[np.float64], scale: float) -> QuickForm:
    """The quickest form that fits a chain (7, 3, 4) to rounding; `NO_FORM` for none.

    Each labelling of the loop is looked at (see ``kernels.six_joints.loop``), so that the axes that meet or are
    parallel may be any that follow each other: of a wrist, of a shoulder, or between.

    Args:
        chain: placements between joints that turn about z.
        scale: what lengths are multiplied by [1/m].
    """
    ways = np.zeros((2, 6, 3, 4))  # the links forwards, and backwards
    fill_links(chain, np.eye(4), scale, 0, ways[0])
    fill_links(chain, np.eye(4), scale, 6, ways[1])
    found = []
    for labelling in range(LABELLINGS):
        backwards, begin = divmod(labelling, 6)
        links = ways[backwards, (np.arange(6) + (-begin if backwards else begin)) % 6]
        # The link that carries the target, and no structure.
        carrier = next(i for i in range(6) if link_of(labelling, i) == 5)
        forms = (make(links, labelling, carrier) for make in (wrist_form, plane_form, planar_arm_form))
        found += [form for form in forms if form]
    return min(found, key=lambda form: form.rank, default=NO_FORM)


def link_of(labelling: int, i: int) -> int:
    """Which link of the loop, from 0, L_(i + 1) is."""
    return (labelling + i) % 6 if labelling < 6 else (labelling - i - 1) % 6


def wrist_form(links: NDArray[np.float64], labelling: int, carrier: int) -> QuickForm | None:
    """Axes 4, 5 and 6 meet, and axes 1 and 2 clearly do or do not, nor are they parallel."""
    if carrier in (0, 3, 4):
        return None
    if min(sine_of(links[3]), sine_of(links[4])) < DISTINCT:
        return None
    if max(distance_of(links[3]), distance_of(links[4])) > 2.0 * EXACT_STRUCTURE:
        return None
    frames = [(np.eye(3), np.zeros(3)), *frames_at_zero(links[3:5])]
    point, misfit = nearest_to_axes(frames)
    if misfit > EXACT_STRUCTURE:
        return None
    rotation, position = frames[-1]
    # Axis 1 and the way to axis 2, in the axes of joint 2: their cross product along axis 2 vanishes where they meet.
    u, v = links[0, :, :3].T @ links[0, :, 3], links[0, 2, :3]
    apart = abs(u[0] * v[1] - u[1] * v[0])
    long = max(np.hypot(*u[:2]), np.hypot(*v[:2]))
    if long < DISTINCT or EXACT_STRUCTURE < apart < DISTINCT:
        return None
    first, second = float(point[2]), float(rotation[:, 2] @ (point - position))
    joints = tuple(sorted(joint_of(labelling, i) + 1 for i in (3, 4, 5)))
    return QuickForm(Form.SPHERICAL_WRIST, labelling, first, second, joints, 0 if apart <= EXACT_STRUCTURE else 2)


def plane_form(links: NDArray[np.float64], labelling: int, carrier: int) -> QuickForm | None:
    """Axes 2, 3 and 4 are parallel, 5 and 6 meet, and axis 1 is none of the former."""
    if carrier in (1, 2, 3, 4) or max(sine_of(links[1]), sine_of(links[2])) > EXACT_STRUCTURE:
        return None
    if min(np.hypot(*links[i, :2, 3]) for i in (1, 2)) < DISTINCT or min(sine_of(links[i]) for i in (3, 4)) < DISTINCT:
        return None
    if carrier != 0 and sine_of(links[0]) < DISTINCT:
        return None
    t, z = links[4, :, 3], links[4, :, 2]
    across = np.array([-z[1], z[0], 0.0]) / np.hypot(z[0], z[1])
    if abs(across @ t) > EXACT_STRUCTURE:
        return None
    # The point t - s z on axis 6 that is on axis 5, too.
    s = float(t[:2] @ z[:2] / (z[:2] @ z[:2]))
    first, second = float(t[2] - s * z[2]), -s
    joints = tuple(sorted(joint_of(labelling, i) + 1 for i in (1, 2, 3)))
    return QuickForm(Form.PARALLEL_AXES, labelling, first, second, joints, 1)


def planar_arm_form(links: NDArray[np.float64], labelling: int, carrier: int) -> QuickForm | None:
    """Axes 2 and 3 are parallel, axes 1 and 4 at right angles to them and in one plane, 1 and 2 and 4 and 5 meet.

    Axis 4 meets axis 3, too, or clearly does not.
    """
    first, second, third, fourth = links[:4]
    if carrier < 4 or min(sine_of(link) for link in (first, third, fourth)) < DISTINCT:
        return None
    shoulder, elbow, wrist = (meeting(link) for link in (first, third, fourth))
    across = second[2, 3] + second[2, 2] * (third[2, 3] + elbow * third[2, 2]) - shoulder
    misfit = max(
        sine_of(second),
        *(abs(float(link[2, 2])) for link in (first, third)),
        *(distance_of(link) for link in (first, fourth)),
        abs(float(across)),
    )
    beside = distance_of(third)
    if beside <= EXACT_STRUCTURE:
        kind, misfit = Form.PLANAR_ARM, max(misfit, beside)
    else:
        kind = Form.ELBOW_OFFSET
    if not misfit <= EXACT_STRUCTURE or EXACT_STRUCTURE < beside < DISTINCT:
        return None
    if min(np.hypot(*second[:2, 3]), abs(elbow - fourth[2, 3] - wrist * fourth[2, 2])) < DISTINCT:
        return None
    outer, inner = ([joint_of(labelling, i) + 1 for i in pair] for pair in ((0, 3), (1, 2)))
    return QuickForm(kind, labelling, misfit, 0.0, (*sorted(inner), *sorted(outer)), 3 + (kind == Form.ELBOW_OFFSET))


def sine_of(link: NDArray[np.float64]) -> float:
    """The sine of the angle between the axes at both ends of a link (3, 4)."""
    return float(np.hypot(link[0, 2], link[1, 2]))


def distance_of(link: NDArray[np.float64]) -> float:
    """The distance of the axes at both ends of a link (3, 4), which are not parallel."""
    return abs(float(link[1, 3] * link[0, 2] - link[0, 3] * link[1, 2])) / sine_of(link)
