"""`CurveArm`: what the kernels know about an arm whose targets leave one parameter free, and their calls."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import StructureError
from jacokin.ik.closed_form import ClosedForm
from jacokin.ik.geometry import chain_of, measure_seven
from jacokin.ik.structures import (
    NO_FORM,
    EndWrist,
    largest_freedoms,
    measure_general,
    quick_form,
    size_of,
    with_end_wrist,
)
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Verifier
from jacokin.kernels.closed_form.arm import unpack_arm
from jacokin.kernels.library import Call
from jacokin.kernels.six_joints.loop import LABELLINGS, Form
from jacokin.kernels.solution_set.nearest import (
    NearestWork,
    find_nearest,
    find_point,
    make_nearest_work,
    make_point_work,
)
from jacokin.kernels.solution_set.run import SetWork, make_set_work, solve_set
from jacokin.kernels.solution_set.slices import AFTER, BEFORE, JOINT_3, NO_SLICES
from jacokin.kernels.solution_set.within import CIRCLE, FOLD, LOST
from jacokin.kernels.tolerances import DISTINCT, SMALLEST_FREEDOM_OF_CURVES
from jacokin.model.angles import TURN
from jacokin.model.kinematics import frame_with_z
from jacokin.model.robot import Robot

__all__ = ["CIRCLE", "FOLD", "LOST", "CurveArm", "CurveProblem", "Curves"]

#: Index among seven angles of one about a free axis, which comes after six joints; and how many there are.
FREE_AXIS, DIMENSIONS = 6, 7
#: Half a turn about x: an arm turned round turns the same way.
HALF_TURN = np.diag([1.0, -1.0, -1.0])
#: An axis of the tool that no structure has, for curves of six joints at a pose.
ANY_AXIS = np.array([0.48, -0.6, 0.64])
#: Configurations on which the freedoms of six of seven joints are counted.
TRIED = 8
#: [rad] how far configurations of an arm may be from those of one with a wrist at an end, for each of the arm's size by
#: which axes moved; and the farthest that pays.
SLACK, MOST_SLACK = 30.0, 0.05


class CurveArm:
    """An arm whose targets leave one parameter free; may be shared between threads.

    Attributes:
        parameter: index among seven angles of the one that is the parameter.
        name: what the parameter is called: a joint's name, or "angle".
        dof: joints of the arm.
        nearly: the arm as one of a structure that it nearly has, which tells most members next to a seed; or None.
    """

    __slots__ = (
        "_bounds",
        "_chain",
        "_constants",
        "_from_last",
        "_idle",
        "_kind",
        "_limits",
        "_six",
        "_slack",
        "dof",
        "name",
        "nearly",
        "parameter",
    )

    def __init__(
        self, kind: int, name: str, chain: Array, constants: Array, robot: Robot, near: EndWrist | None = None
    ) -> None:
        """Take the constants of an arm.

        Args:
            kind: which joint is the parameter, see `kernels.solution_set.slices`.
            name: what it is called.
            chain: (7, 3, 4) of six joints, or (8, 3, 4) of seven.
            constants: (46,) of the six joints that are solved for, or (12,) of seven built like a Jaco's.
            robot: the arm.
            near: six joints to solve for instead of those in the chain, of which they are nearly equal.
        """
        self._kind, self.name, self._chain, self._constants, self.dof = kind, name, chain, constants, robot.dof
        self.nearly: CurveArm | None = None
        self._slack = SLACK * near.moved if near else 0.0
        ordered = turned_round(chain) if kind == BEFORE else chain
        self._six = near.chain if near else ordered[:7]
        self._from_last = _inverse(_square(ordered[-1]))
        self.parameter = {AFTER: FREE_AXIS, BEFORE: 0, JOINT_3: 2}[kind]
        bounded = robot.upper - robot.lower < TURN  # others have some equivalent of every angle within their limits
        self._limits = np.array([np.full(DIMENSIONS, -np.inf), np.full(DIMENSIONS, np.inf)])
        self._limits[0, : self.dof][bounded] = robot.lower[bounded]
        self._limits[1, : self.dof][bounded] = robot.upper[bounded]
        self._bounds = np.array([robot.lower, robot.upper])
        self._idle: list[_Calls] = [
            _Calls(self._nearest_work())
        ]  # each thread takes one, or makes one, and puts it back

    def __getstate__(self) -> tuple[object, ...]:
        """Working memory is made anew."""
        return tuple(getattr(self, name) for name in self.__slots__ if name != "_idle")

    def __setstate__(self, state: tuple[object, ...]) -> None:
        """Take what `__getstate__` gave, with working memory of its own."""
        names = (name for name in self.__slots__ if name != "_idle")
        for name, value in zip(names, state, strict=True):
            setattr(self, name, value)
        self._idle = [_Calls(self._nearest_work())]

    @property
    def constants(self) -> tuple[int, Array, Array]:
        """What the C library is told: which joint is the parameter, the chain, and the constants."""
        return self._kind, self._chain, self._constants

    def problem(self, target: TargetPose) -> CurveProblem:
        """A target for the kernels: a pose of seven joints, or a free axis of six."""
        free = target.free_axis
        if free is None:
            return CurveProblem(self, self._chain, target.matrix, self._limits, None)
        limits = self._limits
        if not free.full_turn:
            limits = limits.copy()
            limits[:, FREE_AXIS] = free.range
        return CurveProblem(self, with_axis(self._chain, free.axis), target.matrix, limits, free.axis)

    def turning(self, T: Array) -> CurveProblem:
        """A pose (4, 4) of six joints whose tool may turn, which it does not along the self-motions of the pose."""
        return CurveProblem(self, with_axis(self._chain, ANY_AXIS), T, self._limits, ANY_AXIS)

    def _prepare(
        self, problem: CurveProblem, starts: Array, *, only_starts: bool = False, sure: bool = False
    ) -> _Calls:
        try:
            calls = self._idle.pop()
        except IndexError:
            calls = _Calls(self._nearest_work())
        work, walk, six = calls.solve.work, calls.solve.work.walk, calls.solve.work.six
        walk.chain[:], walk.T[:], work.pieces.limits[:] = problem.chain, problem.T, problem.limits
        walk.parameter[0] = self.parameter
        work.options[:] = NO_SLICES if only_starts else self._kind, self.dof, sure
        work.starts[:], work.near.seed[:], work.near.slack[0] = np.nan, np.nan, self._slack
        work.starts[: len(starts)] = starts
        if self._kind == JOINT_3:
            work.seven.arm[:] = self._constants
            return calls
        six.arm[:], six.chain[:] = self._constants, self._six
        if problem.axis is not None:
            six.axis[:], six.T[:] = problem.axis, problem.T
        else:
            six.axis[:] = 0.0, 0.0, -1.0
            six.T[:] = (problem.T if self._kind == AFTER else _inverse(problem.T)) @ self._from_last
        return calls

    def _nearest_work(self) -> NearestWork:
        """Fresh work arrays that know which angles are joints, and their limits."""
        work, dof = make_nearest_work(), self.dof
        work.weights[dof:], work.limits[0], work.limits[1] = 0.0, -np.inf, np.inf
        work.limits[:, :dof] = self._bounds
        return work

    def _nearest(self, call: Call[NearestWork], seed: Array) -> Array | None:
        """The point (7,) of pieces that is nearest to a seed (dof,); None where it is not found."""
        call.work.seed[: self.dof] = seed
        return call.work.x.copy() if call() else None

    def _put_back(self, calls: _Calls) -> None:
        """Let others use calls, once their arrays are read."""
        self._idle.append(calls)


class _Calls:
    """The kernels' calls of one thread at a time; they share the walk, and the pieces that are found."""

    __slots__ = ("nearest", "point", "solve")

    #: Starts there is room for.
    STARTS = 24

    def __init__(self, nearest: NearestWork) -> None:
        self.solve = Call(solve_set, make_set_work()._replace(starts=np.full((self.STARTS, DIMENSIONS), np.nan)))
        work = self.solve.work
        nearest = nearest._replace(walk=work.walk, nodes=work.pieces.nodes, ends=work.pieces.ends)
        self.nearest = Call(find_nearest, nearest)
        self.point = Call(find_point, make_point_work()._replace(walk=work.walk))


class Curves(NamedTuple):
    """What reaches a target."""

    pieces: list[Piece]
    """What is within the limits."""
    whole: list[Array]
    """(m, 14) nodes of whole curves, within the limits or not."""
    branches: int
    """Parts of the curves from fold to fold."""
    complete: bool
    """Whether nothing may be missing."""


class Piece(NamedTuple):
    """A part of a curve within the limits, along which the parameter rises."""

    nodes: Array
    """(m, 14) points and unit tangents."""
    codes: tuple[int, int]
    """Of both ends: 2 j and 2 j + 1 for the limits of angle j, `FOLD`, `CIRCLE` or `LOST`."""
    branch: int


class CurveProblem(NamedTuple):
    """The curves of solutions of one arm at one target, in the space of seven angles."""

    arm: CurveArm
    chain: Array
    """(8, 3, 4)"""
    T: Array
    """(4, 4)"""
    limits: Array
    """(2, 7) [rad], infinite for none."""
    axis: Array | None
    """(3,) of a free axis of six joints, in the tool frame."""

    def find(self, starts: Array, *, only_starts: bool = False, sure: bool = True) -> Curves:
        """All curves; also those that lead from starts (k, 7) nearby, or those alone.

        Where it need not be sure, those of which no root of F tells are not looked for, and count as missing.
        """
        calls = self.arm._prepare(self, starts, only_starts=only_starts, sure=sure)
        wrong, work = calls.solve(), calls.solve.work
        found = read_curves(work, complete=wrong == 0)
        self.arm._put_back(calls)
        return found

    def nearest(self, starts: Array, seed: Array, parameter: float) -> Array | Curves | None:
        """The point (7,) within the limits nearest to a seed (dof,) [rad], or all curves where none is within them.

        Args:
            starts: (k, 7) points nearby whose curves are followed too.
            seed: (dof,) [rad].
            parameter: [rad] of the seed: about a free axis, where the target is turned least from it.

        Returns:
            None where neither is known.
        """
        if self.arm.nearly is not None:
            x = self._replace(arm=self.arm.nearly).nearest(starts, seed, parameter)
            if x is not None:
                return x
        calls, dof = self.arm._prepare(self, starts, sure=True), len(seed)
        work = calls.solve.work
        work.near.bounds[:, :dof], work.near.bounds[:, dof:] = self.arm._bounds, self.limits[:, dof:]
        work.near.seed[dof:] = parameter
        work.near.seed[:dof] = seed
        wrong = calls.solve()
        found: Array | Curves | None
        if work.pieces.size[1] > 0:
            work.pieces.ends[work.pieces.size[1] :] = 0
            found = self.arm._nearest(calls.nearest, seed)
        else:  # an arm that nearly has a structure is not looked at all round
            found = read_curves(work, complete=wrong == 0) if self.arm._slack == 0.0 else None
        self.arm._put_back(calls)
        return found

    def nearest_on(self, nodes: Array, seed: Array) -> Array | None:
        """The point (7,) within the limits on a run of nodes (m, 14), nearest to a seed (dof,) [rad]; None for none."""
        ends = np.array([[0, len(nodes), 0, 0, 0, 0]])
        work = self.arm._nearest_work()._replace(nodes=nodes, ends=ends)
        work.walk.chain[:], work.walk.T[:] = self.chain, self.T
        return self.arm._nearest(Call(find_nearest, work), seed)

    def at(self, chord: Array, parameter: float) -> Array:
        """The point (7,) of a chord (2, 14) where the parameter has a value [rad], or the end that is nearer to it."""
        calls = self.arm._prepare(self, np.empty((0, DIMENSIONS)))
        work = calls.point.work
        work.nodes[:], work.at[0] = chord, parameter
        found = calls.point()
        ends = np.abs(chord[:, self.arm.parameter] - parameter)
        x = work.x.copy() if found else chord[int(ends.argmin()), :DIMENSIONS].copy()
        self.arm._put_back(calls)
        return np.asarray(x)


def about_axis(form: ClosedForm, robot: Robot) -> CurveArm:
    """Six joints whose tool may turn about an axis; the parameter is that angle."""
    arm = CurveArm(AFTER, "angle", form.chain, form.arm, robot)
    if not has_end_wrist(form.arm):
        near = nearly(form.chain)
        if near:
            arm.nearly = CurveArm(AFTER, arm.name, form.chain, near.arm, robot, near)
    return arm


def at_poses(verifier: Verifier) -> CurveArm:
    """Seven joints at a pose; the parameter is joint 3 of an arm built like a Jaco, else the first or the last joint.

    Raises:
        StructureError: no six joints of those move the tool in six independent ways.
    """
    robot, frame_id, tool = verifier.robot, verifier.frame_id, verifier.tool
    names = robot.joint_names
    try:
        geometry = measure_seven(robot.pin_model, frame_id, tool)
    except StructureError:
        chain = chain_of(robot.pin_model, frame_id, tool, DIMENSIONS)
    else:
        return CurveArm(JOINT_3, names[2], geometry.chain, geometry.arm, robot)
    cut = min(_cuts(chain), key=_Cut.effort)
    constants = measure_general(np.ascontiguousarray(cut.six)).arm
    arm = CurveArm(cut.kind, names[-1 if cut.kind == AFTER else 0], chain, constants, robot)
    if not has_end_wrist(constants):
        found = [(near, kind) for kind, six in _ends(chain) if (near := nearly(six))]
        if found:
            near, kind = min(found, key=lambda one: one[0].moved)
            arm.nearly = CurveArm(kind, names[-1 if kind == AFTER else 0], chain, near.arm, robot, near)
    return arm


def nearly(six: Array) -> EndWrist | None:
    """The arm with a wrist at an end that six joints (7, 3, 4) nearly are; None where they are too far from one."""
    found = with_end_wrist(six)
    return found if found is not None and SLACK * found.moved <= MOST_SLACK else None


def has_end_wrist(constants: Array) -> bool:
    """Whether six joints, by their constants, are solved by a wrist at an end of them."""
    six = unpack_arm(constants).six
    return bool(six.form == Form.SPHERICAL_WRIST and six.form_labelling in (0, LABELLINGS - 1))


def _ends(chain: Array) -> list[tuple[int, Array]]:
    """The two ways to leave out a joint at an end of seven (8, 3, 4): its kind, and the six others (7, 3, 4)."""
    return [(AFTER, chain[:7]), (BEFORE, turned_round(chain)[:7])]


class _Cut(NamedTuple):
    """A joint at an end of seven that may be the parameter."""

    kind: int
    """Which one, see `kernels.solution_set.slices`."""
    six: Array
    """(7, 3, 4) chain of the others."""
    freedom: float
    """How far those move the tool in the way in which they do least; the parameter changes as little along a curve."""

    def effort(self) -> tuple[float, bool, int]:
        """How hard curves are to find, to be compared: with little freedom, else how long a pose of the six takes."""
        form = quick_form(self.six, 1.0 / size_of(self.six))
        return max(DISTINCT / self.freedom, 1.0), form.kind == NO_FORM.kind, form.rank


def _cuts(chain: Array) -> list[_Cut]:
    """Which joint may be the parameter.

    Raises:
        StructureError: the others move the tool in fewer than six ways, whichever six they are.
    """
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (TRIED, 6))
    found, most = [], 0
    for kind, six in _ends(chain):
        size = size_of(six)
        freedoms = largest_freedoms(six, q, size) if 0.0 < size < np.inf else np.zeros(6)
        count = int((freedoms > SMALLEST_FREEDOM_OF_CURVES).sum())
        most = max(most, count)
        if count == 6:
            found.append(_Cut(kind, six, float(freedoms[-1])))
    if not found:
        raise StructureError(f"the joints move the tool in {most} independent ways only, whatever their angles")
    return found


def with_axis(chain: Array, axis: Array) -> Array:
    """(8, 3, 4): six joints, and a seventh that turns the tool back about an axis (3,) of its own."""
    align, found = frame_with_z(-axis), np.zeros((8, 3, 4))
    found[:7] = chain
    found[6, :, :3] = chain[6, :, :3] @ align
    found[7, :, :3] = align.T
    return found


def turned_round(chain: Array) -> Array:
    """(8, 3, 4): the arm from its tool to its base, whose joints turn by the same angles in the opposite order."""
    flip = np.eye(4)
    flip[:3, :3] = HALF_TURN
    links = [_inverse(_square(placement)) for placement in chain[::-1]]
    last = len(links) - 1
    turned = [(link if i == 0 else flip @ link) @ (np.eye(4) if i == last else flip) for i, link in enumerate(links)]
    return np.ascontiguousarray(np.array(turned)[:, :3])


def _square(placement: Array) -> Array:
    return np.vstack([placement, [0.0, 0.0, 0.0, 1.0]])


def _inverse(T: Array) -> Array:
    return np.asarray(pin.SE3(T[:3, :3], T[:3, 3]).inverse().homogeneous)


def read_curves(work: SetWork, *, complete: bool) -> Curves:
    """What the kernel found, copied."""
    pieces, loops = work.pieces, work.loops
    ends: NDArray[np.int64] = pieces.ends[: pieces.size[1]]
    found = [
        Piece(pieces.nodes[first:end].copy(), (start, stop), branch)
        for first, end, start, stop, branch, _ in ends.tolist()
        if end > first  # a full table
    ]
    whole = [loops.nodes[first:end].copy() for first, end, _ in loops.ends[: loops.size[1]].tolist()]
    return Curves(found, whole, int(pieces.size[2]), complete and bool(math.isfinite(work.walk.T.sum())))
