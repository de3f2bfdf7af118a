"""`Description`, what a file holds, and `extract`, which takes the arm out of it.

The arm is the chain of joints from a base frame to a tip frame, with one coordinate per joint. Joints off the chain
(fingers, other arms, free objects) are locked at a reference configuration, and their bodies join the link that they
hang on. Pinocchio's (cos, sin) packing of continuous joints ends here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.model import checks
from jacokin.model.descriptions.tools import FRAME_TYPES, frames_on, is_finger, is_torso, joints_of_tool, usual_tools

if TYPE_CHECKING:
    import mujoco

MOST_JOINTS = 200  # of an arm; Pinocchio's memory grows with the cube of their number: 6 GiB at a thousand
SHORTEST_ARM = 2  # joints of a branch that may be an arm; one joint is a finger, also on a single slide
ONLY_ARM = 4  # joints of a chain that is the arm of a scene where no other has more than two: doors, wheels, knobs
NAMED_CANDIDATES = 6  # in a message
NO_LIMIT = 1e6  # [rad] or [m]; files that must write a number for "none" write one beyond this

_PLAIN_AXIS = {"X": pin.JointModelRX, "Y": pin.JointModelRY, "Z": pin.JointModelRZ}


@dataclass(frozen=True, slots=True)
class Coupling:
    """Joints that do not move independently of each other."""

    joints: frozenset[str]
    what: str
    """Kind and name of what couples them, for messages."""
    leader: str | None = None
    """The joint that the others follow, where they do."""
    multiplier: float = 1.0
    offset: float = 0.0
    """[rad] or [m] of the others where their leader is at zero."""

    @property
    def followers(self) -> frozenset[str]:
        """The joints that follow the leader; none without one."""
        return frozenset() if self.leader is None else self.joints - {self.leader}


@dataclass(frozen=True, slots=True, eq=False)
class Description:
    """A robot or scene as a file describes it, before the arm is taken out of it."""

    model: pin.Model
    reference: Array
    """(nq,) configuration at which joints off the arm rest."""
    kind: str
    """"urdf" or "mjcf"."""
    base: str
    """Name of the frame that poses are expressed in when none is named."""
    couplings: Sequence[Coupling]
    content: str | mujoco.MjModel | None
    """Checked text of a URDF, compiled MJCF; None for bundled robots."""
    notes: tuple[str, ...] = ()
    """Sentences on what was left out of the file."""


class ArmEnds(NamedTuple):
    """Which joints of a model are those of the arm."""

    base: str | None
    """The frame in which the arm begins; None for the world of the model."""
    above_base: frozenset[int]
    """Numbers of the joints that carry the base."""
    chain: tuple[int, ...]
    """Numbers of the joints between base and tip."""
    frame: str | None
    """The frame solved when none is named: `tip`, else the one of the last link that is called as tools are."""
    notes: tuple[str, ...]
    """Sentences on joints that were left out, and how they would be taken in."""


def find_ends(full: pin.Model, base: str | None, tip: str | None, leaders: Mapping[str, str]) -> ArmEnds:
    """Where the arm of a model begins and ends.

    Args:
        full: the whole robot.
        base: frame in which the arm begins; None for the world of the model.
        tip: frame at the end of the chain; None to end where the tree branches, before joints that move only a tool.
        leaders: which joint a joint follows, by name.

    Raises:
        UnknownNameError: no such base or tip.
        ModelError: the chain does not exist.
    """
    start = full.frames[0 if base is None else frame_id(full, base)].parentJoint
    notes: tuple[str, ...] = ()
    if tip is None:
        end, notes = _arm_end(full, start, leaders)
    else:
        end = full.frames[frame_id(full, tip)].parentJoint
    above_base, above_tip = (set(full.supports[joint]) - {0} for joint in (start, end))
    if not above_base <= above_tip:
        raise ModelError(f"tip {tip!r} does not descend from base {base!r}: no chain joins them")
    between = sorted(above_tip - above_base)
    if not between:
        where = (
            f"no joint moves tip {tip!r}" if base is None else f"no joint moves between base {base!r} and tip {tip!r}"
        )
        raise ModelError(where)
    if len(between) > MOST_JOINTS:
        raise ModelError(f"the chain has {len(between)} joints; at most {MOST_JOINTS} are read")
    frames = frames_on(full, end)  # not those of fingers, whose joints are locked
    frame = tip or next(iter(usual_tools(frames)), None)
    return ArmEnds(base, frozenset(above_base), tuple(between), frame, notes)


def extract(full: pin.Model, q_reference: Array, ends: ArmEnds, name: str) -> pin.Model:
    """The arm between the ends of a model, as a fresh model with nq == nv == number of joints.

    Args:
        full: the whole robot.
        q_reference: (full.nq,) configuration at which everything off the chain is locked.
        ends: which joints are those of the arm.
        name: name of the result.

    Returns:
        A model whose universe is the base; frames of the locked parts are kept, rigidly attached.

    Raises:
        ModelError: the chain contains a joint with more than one degree of freedom.
    """
    base, above_base, chain = ends.base, ends.above_base, ends.chain
    T_parent_joint, T_world_joint = _placements(full, q_reference)
    base_frame = full.frames[0 if base is None else frame_id(full, base)]
    T_world_base = T_world_joint[base_frame.parentJoint] * base_frame.placement
    arm = pin.Model()
    arm.name = name
    arm.gravity.linear = T_world_base.rotation.T @ full.gravity.linear
    # For each joint of the full model: the joint of the arm that carries it, and its placement there. (Pinocchio's
    # buildReducedModel freezes joints too, but fails where a body has the name of a joint, which is common in MJCF.)
    T_base_world = T_world_base.inverse() if base is not None else pin.SE3.Identity()
    carried: list[tuple[int, pin.SE3]] = [(0, T_base_world)]
    for joint in range(1, full.njoints):
        carrier, T_carrier_parent = carried[full.parents[joint]]
        if joint in chain:
            added = _add_joint(arm, carrier, T_carrier_parent * full.jointPlacements[joint], full, joint)
            carried.append((added, pin.SE3.Identity()))
        elif joint in above_base:
            carried.append((0, T_base_world * T_world_joint[joint]))
        else:
            carried.append((carrier, T_carrier_parent * T_parent_joint[joint]))
    for (carrier, T_carrier_joint), inertia in zip(carried, full.inertias, strict=True):
        arm.appendBodyToJoint(carrier, inertia, T_carrier_joint)
    for frame in list(full.frames)[1:]:
        carrier, T_carrier_joint = carried[frame.parentJoint]
        placement = T_carrier_joint * frame.placement
        _check_place(f"frame {frame.name!r}", placement)
        arm.addFrame(pin.Frame(frame.name, carrier, 0, placement, frame.type), False)
    dofs = [full.joints[joint].idx_v for joint in chain]
    arm.armature, arm.damping = full.armature[dofs], full.damping[dofs]
    arm.upperDryFrictionLimit = full.upperDryFrictionLimit[dofs]
    arm.lowerDryFrictionLimit = -arm.upperDryFrictionLimit
    return arm


def _placements(full: pin.Model, q: Array) -> tuple[list[pin.SE3], list[pin.SE3]]:
    """Every joint's placement in its parent joint and in the world.

    Without Pinocchio's working memory, which grows with the cube of the degrees of freedom: 3 GB for 60 free objects.
    """
    in_parent, in_world = [pin.SE3.Identity()], [pin.SE3.Identity()]
    for index in range(1, full.njoints):
        joint = full.joints[index]
        motion = joint.createData()
        joint.calc(motion, q)
        in_parent.append(full.jointPlacements[index] * motion.M)
        in_world.append(in_world[full.parents[index]] * in_parent[-1])
    return in_parent, in_world


def _arm_end(model: pin.Model, base_joint: int, leaders: Mapping[str, str]) -> tuple[int, tuple[str, ...]]:
    """The last joint of the arm: before the tree branches into fingers, and before joints that move only a tool.

    Raises:
        ModelError: nothing moves, or arms rather than fingers begin where the tree branches; names candidates for tip.
    """
    # Free objects in the scene hang on the base too, and are not arms.
    starts = list(model.children[base_joint])
    starts = [joint for joint in starts if model.joints[joint].nv == 1] or starts
    if model.njoints == 1:
        raise ModelError("no joint starts at the base, nor anywhere else: this is an object, not an arm")
    if not starts:
        raise ModelError("no joint starts at the base; say where the arm begins with base=...")
    start, notes = _only_arm(model, starts, leaders)
    end, length = _before_the_branches(model, start)
    branches = list(model.children[end])
    if _branches_into_arms(model, length, branches):
        longest = max(_length(model, branch) for branch in branches)
        raise ModelError(
            f"the chain branches at joint {model.names[end]!r}, its number {length}, into chains of up to {longest} "
            f"joints: arms on a torso rather than fingers on an arm; {_advice(model, branches, leaders)}"
        )
    chain = _chain_to(model, base_joint, end)
    beside = [each for joint in chain[:-1] for each in model.children[joint] if each not in chain]
    if beside:
        notes = (*notes, f"locked beside the arm are {_listed([str(model.names[joint]) for joint in beside])}")
    left_out = joints_of_tool(model, chain, leaders)
    for joint, why in reversed(left_out):
        frames = frames_on(model, joint)
        cure = f": tip={frames[0]!r} takes it in" if frames else ""
        notes = (*notes, f"joint {model.names[joint]!r} is not part of the arm, as it {why}{cure}")
    return chain[-1 - len(left_out)], notes


def _only_arm(model: pin.Model, starts: list[int], leaders: Mapping[str, str]) -> tuple[int, tuple[str, ...]]:
    """The first joint of the arm among those that start at the base, and notes on the others.

    Raises:
        ModelError: several may be arms.
    """
    if len(starts) == 1:
        return starts[0], ()
    lengths = {joint: _length(model, joint) for joint in starts}
    arms = [joint for joint in starts if lengths[joint] >= ONLY_ARM and not is_finger(model, joint)]
    if len(arms) == 1 and all(lengths[joint] <= SHORTEST_ARM for joint in starts if joint != arms[0]):
        others = _listed([model.names[joint] for joint in starts if joint != arms[0]])
        return arms[0], (f"the arm is the chain that begins with joint {model.names[arms[0]]!r}; locked are {others}",)
    names = _listed([model.names[joint] for joint in starts])
    raise ModelError(f"several chains start at the base ({names}); {_advice(model, starts, leaders)}")


def _listed(names: Sequence[str]) -> str:
    """Some names, and that there are more."""
    return ", ".join(names[:NAMED_CANDIDATES]) + (", ..." if len(names) > NAMED_CANDIDATES else "")


def _branches_into_arms(model: pin.Model, length: int, branches: Sequence[int]) -> bool:
    """Whether what begins where a chain of some joints branches are arms rather than fingers."""
    if any(is_finger(model, branch) for branch in branches):
        return False
    return max((_length(model, branch) for branch in branches), default=0) >= max(length, SHORTEST_ARM)


def _chain_to(model: pin.Model, base_joint: int, end: int) -> list[int]:
    """Numbers of the joints after the base up to another one."""
    return [joint for joint in model.supports[end] if joint > base_joint and joint in model.subtrees[base_joint]]


def _before_the_branches(model: pin.Model, joint: int) -> tuple[int, int]:
    """The last joint outwards from a joint before the tree branches or ends, and the number of joints up to it."""
    trunk = [joint]
    while (onward := _onward(model, trunk)) is not None:
        trunk.append(onward)
    return trunk[-1], len(trunk)


def _onward(model: pin.Model, trunk: Sequence[int]) -> int | None:
    """The joint with which a chain goes on: the only one, or the only one of an arm beside a head or a linkage.

    Not behind a torso: whether that is part of the arm, its user knows.
    """
    branches = list(model.children[trunk[-1]])
    if len(branches) < 2:
        return branches[0] if branches else None
    arms = [branch for branch in branches if _length(model, branch) > SHORTEST_ARM]
    if len(arms) != 1 or not _branches_into_arms(model, len(trunk), branches):
        return None
    if len(trunk) + _length(model, arms[0]) < ONLY_ARM:
        return None
    return None if any(is_torso(model, joint) for joint in trunk) else arms[0]


def _length(model: pin.Model, joint: int) -> int:
    """Joints on the longest way outwards from a joint, itself included."""
    return max(len(model.supports[end]) for end in model.subtrees[joint]) - len(model.supports[joint]) + 1


def _advice(model: pin.Model, starts: list[int], leaders: Mapping[str, str]) -> str:
    """Advice to give tip=..., with frames at the ends of the chains that may be arms, those of the longest first."""
    ends = [end for start in starts for end in _ends_of_arms(model, start, leaders)]
    ends.sort(key=lambda end: -len(model.supports[end]))
    trunk = model.parents[starts[0]]
    arms = [end for end in ends if len(model.supports[end]) - len(model.supports[trunk]) > SHORTEST_ARM] or ends
    carried = [frames_on(model, end) for end in arms]
    candidates = [usual_tools(frames)[0] for frames in carried if frames][:NAMED_CANDIDATES]
    named = f", for example {', '.join(candidates)}" if candidates else ""
    return f"say which frame ends the arm with tip=...{named}{_advice_on_base(model, trunk)}"


def _advice_on_base(model: pin.Model, trunk: int) -> str:
    """Advice to give base=..., too, where a joint carries all chains."""
    frames = frames_on(model, trunk) if trunk else []
    if not frames:
        return " (and which begins it with base=...)"
    if model.joints[trunk].nv != 1:
        return f", and where it begins with base={frames[0]!r}"
    return f"; base={frames[0]!r}, too, for the arm without joint {model.names[trunk]!r}"


def _ends_of_arms(model: pin.Model, start: int, leaders: Mapping[str, str]) -> list[int]:
    """The last joints of what may be arms in the tree from a joint on."""
    end, length = _before_the_branches(model, start)
    branches = list(model.children[end])
    if _branches_into_arms(model, length, branches):
        return [each for branch in branches for each in _ends_of_arms(model, branch, leaders)]
    chain = _chain_to(model, model.parents[start], end)
    return [chain[-1 - len(joints_of_tool(model, chain, leaders))]]


def _add_joint(arm: pin.Model, parent: int, placement: pin.SE3, full: pin.Model, index: int) -> int:
    """Add a joint of the full model to the arm, with one plain coordinate and infinite limits where it has none."""
    joint = full.joints[index]
    if joint.nv != 1:
        raise ModelError(
            f"joint {full.names[index]!r} in the chain has {joint.nv} degrees of freedom; "
            "an arm needs hinge (or slide) joints; base=... names a frame behind it"
        )
    _check_place(f"joint {full.names[index]!r}", placement)
    plain, continuous = _one_coordinate_joint(full, index)
    lower, upper = -np.inf, np.inf
    if not continuous:
        lower, upper = full.lowerPositionLimit[joint.idx_q], full.upperPositionLimit[joint.idx_q]
    at = slice(joint.idx_v, joint.idx_v + 1)
    added: int = arm.addJoint(
        parent,
        plain,
        placement,
        full.names[index],
        _given(full.effortLimit[at]),
        _given(full.velocityLimit[at]),
        np.array([lower if lower > -NO_LIMIT else -np.inf]),
        np.array([upper if upper < NO_LIMIT else np.inf]),
    )
    return added


def _given(limit: Array) -> Array:
    """A limit of effort or velocity; files write 0 where they know none."""
    return np.where(limit > 0.0, limit, np.inf)


def _one_coordinate_joint(full: pin.Model, index: int) -> tuple[object, bool]:
    """A joint with one plain coordinate, and whether it was a continuous one."""
    joint = full.joints[index]
    kind = joint.shortname()
    if kind.startswith("JointModelRUB") and kind[-1] in _PLAIN_AXIS:
        return _PLAIN_AXIS[kind[-1]](), True
    if kind == "JointModelRevoluteUnboundedUnaligned":
        motion = joint.createData()  # the joint itself does not tell its axis
        joint.calc(motion, pin.neutral(full))
        return pin.JointModelRevoluteUnaligned(np.array(motion.S[3:])), True
    return joint.extract(), False


def standing(
    wanted: Mapping[str, float],
    limits: Mapping[str, tuple[float, float]],
    followers: Sequence[tuple[str, str, float, float]],
) -> dict[str, float]:
    """Where joints off the arm stand.

    Args:
        wanted: where each is to stand, if it does not follow another one [rad or m].
        limits: of each.
        followers: joint, leader, multiplier and offset of those that follow; of joints that are not there, nothing.
    """
    found = {name: min(max(value, limits[name][0]), limits[name][1]) for name, value in wanted.items()}
    for name, leader, multiplier, offset in followers:
        if name in found and leader in found:
            found[name] = min(max(multiplier * found[leader] + offset, limits[name][0]), limits[name][1])
    return found


def range_of_fingers(allowed: Sequence[tuple[float, float, str]]) -> str:
    """In words, from where to where joints off the arm move: the first of some ranges, with its unit."""
    if not allowed:
        return "it has no fingers"
    low, high, unit = allowed[0]
    return f"the fingers move from {low} to {high} {unit}"


def _check_place(what: str, placement: pin.SE3) -> None:
    """Refuse a place that is not finite, or so far from the joint before it that rounding exceeds every tolerance."""
    if not np.abs(placement.homogeneous).max() <= 1e6:
        x, y, z = placement.translation
        raise ModelError(
            f"{what} is at ({x:.3g}, {y:.3g}, {z:.3g}) m of the joint before it: not finite, or beyond 1e6 m"
        )


def frame_names(model: pin.Model) -> dict[str, int]:
    """Names of links, bodies and sites with their frame ids; the first of two equal names wins."""
    names: dict[str, int] = {}
    for index, frame in enumerate(model.frames):
        if frame.type in FRAME_TYPES and index > 0:
            names.setdefault(frame.name, index)
    return names


def frame_id(model: pin.Model, name: str) -> int:
    """Id of a link, body or site.

    Raises:
        UnknownNameError: there is no such frame; lists the ones there are.
    """
    names = frame_names(model)
    return names[checks.choice("frame", name, names)]


def default_frame(model: pin.Model, tip: str | None) -> str:
    """The frame solved when none is named: `tip`, else one called as tools are, else the first of the last link."""
    if tip is not None:
        return tip
    names = frames_on(model, model.njoints - 1)
    if not names:
        raise ModelError("the last link of the arm has no named frame; name it, or give tip=...")
    return usual_tools(names)[0]
