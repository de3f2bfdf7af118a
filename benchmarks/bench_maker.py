"""MotionBenchMaker's problems for a UR5 with a gripper, in the shapes that VAMP takes, and a referee of paths.

MotionBenchMaker (Chamzas et al.: MotionBenchMaker: A Tool to Generate and Benchmark Motion Planning Datasets, 2022) has
a hundred problems of each of seven kinds. They come with VAMP (Thomason, Kingston and Kavraki: Motions in Microseconds
via Vectorized Sampling-Based Planning, 2024), and so do the 40 spheres that stand for the arm. None of that is part of
this project: it is read from a clone of that repository, ``resources/ur5``.

The referee shares no code with any planner: its kinematics, spheres and distances are computed here, in numpy, from the
URDF, and pairs of links of the SRDF are left out.
"""

from __future__ import annotations

import re
import tarfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import yaml
from numpy.typing import NDArray

from jacokin.arrays import Array

WHERE = (
    "is missing in {folder}: clone https://github.com/KavrakiLab/vamp, whose Git LFS files are not needed, and give "
    "its folder resources/ur5"
)
FILES = ("problems.tar.bz2", "ur5_spherized.urdf", "ur5.srdf")
JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
STANDING_UP = "box"  # the kind whose cylinders VAMP takes as boxes; those of the others become capsules
ROWS_AT_ONCE = 2000
SAMPLES = 1000  # random configurations; what touches in all of them always does


class Solid(NamedTuple):
    """A box, a sphere or a capsule of a scene."""

    name: str
    kind: str
    size: tuple[float, ...]
    """Half edges of a box; the radius; the radius, and the length without the half spheres [m]."""
    place: Array
    """(4, 4) T_base_solid."""


class BenchProblem(NamedTuple):
    """One problem of the data."""

    kind: str
    number: int
    start: Array
    """(6,) [rad]."""
    goal: Array
    """(6,) [rad]."""
    solids: tuple[Solid, ...]


def files_in(folder: Path) -> tuple[Path, Path, Path]:
    """The problems, the URDF and the SRDF in a folder.

    Raises:
        SystemExit: says which is missing, and where to get it.
    """
    for name in FILES:
        if not (folder / name).is_file():
            raise SystemExit(f"{name} {WHERE.format(folder=folder)}")
    return folder / FILES[0], folder / FILES[1], folder / FILES[2]


def load_problems(archive: Path, count: int) -> list[BenchProblem]:
    """The first problems of each kind."""
    scenes: dict[tuple[str, int], Any] = {}
    requests: dict[tuple[str, int], Any] = {}
    with tarfile.open(archive) as tar:
        for member in tar:
            found = re.fullmatch(r"problems/(\w+)_ur5/(scene|request)(\d+)\.yaml", member.name)
            if found is None or int(found[3]) > count:
                continue
            content = tar.extractfile(member)
            assert content is not None
            data = yaml.load(content.read(), Loader=yaml.CSafeLoader)
            (scenes if found[2] == "scene" else requests)[found[1], int(found[3])] = data
    return [_problem(kind, number, scenes[kind, number], requests[kind, number]) for kind, number in sorted(requests)]


def _problem(kind: str, number: int, scene: Any, request: Any) -> BenchProblem:
    state = request["start_state"]["joint_state"]
    start = dict(zip(state["name"], state["position"], strict=True))
    goal = {each["joint_name"]: each["position"] for each in request["goal_constraints"][0]["joint_constraints"]}
    solids = tuple(_solid(kind, thing) for thing in scene["world"]["collision_objects"])
    return BenchProblem(
        kind, number, np.array([start[name] for name in JOINTS]), np.array([goal[name] for name in JOINTS]), solids
    )


def _solid(kind: str, thing: Any) -> Solid:
    shape, dimensions = thing["primitives"][0]["type"], [float(each) for each in thing["primitives"][0]["dimensions"]]
    place = (_place(thing["pose"]) if "pose" in thing else np.eye(4)) @ _place(thing["primitive_poses"][0])
    if shape == "box":
        return Solid(thing["id"], "box", tuple(0.5 * edge for edge in dimensions), place)
    if shape == "sphere":
        return Solid(thing["id"], "sphere", (dimensions[0],), place)
    length, radius = dimensions
    if kind == STANDING_UP:
        return Solid(thing["id"], "box", (radius, radius, 0.5 * length), place)
    return Solid(thing["id"], "capsule", (radius, length), place)


def _place(pose: Any) -> Array:
    x, y, z, w = np.array(pose["orientation"]) / np.linalg.norm(pose["orientation"])
    found = np.eye(4)
    found[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    found[:3, 3] = pose["position"]
    return found


class _Joint(NamedTuple):
    child: str
    parent: str
    place: Array
    axis: Array
    number: int
    """Of the arm's joints; -1 for one that stands."""


class Referee:
    """How deep the arm is in a scene or in itself, on the spheres of its URDF."""

    def __init__(self, urdf: Path, srdf: Path) -> None:
        """Read kinematics and spheres.

        Pairs that the SRDF has, that do not move against each other, or that touch in all configurations do not count.
        """
        root = ElementTree.parse(urdf).getroot()
        self._joints = _in_order([_joint(each) for each in root.iter("joint")])
        self._spheres: dict[str, tuple[Array, Array]] = {}
        for link in root.iter("link"):
            round_ones = [each for each in link.iter("collision") if each.find("geometry/sphere") is not None]
            if round_ones:
                centres = np.array([_numbers(each.find("origin"), "xyz") for each in round_ones])
                radii = np.array([float(each.find("geometry/sphere").attrib["radius"]) for each in round_ones])  # type: ignore[union-attr]  # they have one
                self._spheres[link.attrib["name"]] = centres, radii
        ignored = {
            frozenset((each.attrib["link1"], each.attrib["link2"]))
            for each in ElementTree.parse(srdf).getroot().iter("disable_collisions")
        }
        moved_by = {self._joints[0].parent: -1}  # the number of the last joint before a link
        for joint in self._joints:
            moved_by[joint.child] = moved_by[joint.parent] if joint.number < 0 else joint.number
        owner = [name for name, (centres, _) in self._spheres.items() for _ in centres]
        self.radii = np.concatenate([radii for _, radii in self._spheres.values()])
        pairs = [
            (i, j)
            for i in range(len(owner))
            for j in range(i)
            if moved_by[owner[i]] != moved_by[owner[j]] and frozenset((owner[i], owner[j])) not in ignored
        ]
        self._pairs: NDArray[np.intp] = np.array(pairs, dtype=np.intp)
        anywhere = np.random.default_rng(0).uniform(-np.pi, np.pi, (SAMPLES, len(JOINTS)))
        self._pairs = self._pairs[(self._depths(self.centres(anywhere)) <= 0.0).any(axis=0)]

    def centres(self, q: Array) -> Array:
        """Where the spheres are (n, spheres, 3) [m] at configurations (n, 6) [rad]."""
        places: dict[str, Array] = {self._joints[0].parent: np.tile(np.eye(4), (len(q), 1, 1))}
        for joint in self._joints:
            here = places[joint.parent] @ joint.place
            places[joint.child] = here if joint.number < 0 else here @ _turned(joint.axis, q[:, joint.number])
        found = [
            places[name][:, None, :3, 3] + np.einsum("nij,sj->nsi", places[name][:, :3, :3], centres)
            for name, (centres, _) in self._spheres.items()
        ]
        return np.concatenate(found, axis=1)

    def depth(self, q: Array, solids: Sequence[Solid]) -> float:
        """How deep two shapes are in each other at most at configurations (n, 6) [rad] [m]; negative for none."""
        worst = -np.inf
        for first in range(0, len(q), ROWS_AT_ONCE):
            centres = self.centres(q[first : first + ROWS_AT_ONCE])
            for solid in solids:
                worst = max(worst, float((self.radii - _distance(centres, solid)).max()))
            worst = max(worst, float(self._depths(centres).max()))
        return worst

    def _depths(self, centres: Array) -> Array:
        """How deep the spheres of each pair are in each other (n, pairs) [m], for their centres (n, spheres, 3)."""
        a, b = self._pairs.T
        return np.asarray(self.radii[a] + self.radii[b] - np.linalg.norm(centres[:, a] - centres[:, b], axis=2))

    def depth_along(self, path: Array, solids: Sequence[Solid], step: float) -> float:
        """The same along straight lines through configurations (n, 6) [rad], every so many radians of a joint."""
        rows = [path[:1]]
        for start, end in pairwise(path):
            count = max(1, int(np.ceil(np.abs(end - start).max() / step)))
            rows.append(start + np.arange(1, count + 1)[:, None] / count * (end - start))
        return self.depth(np.concatenate(rows), solids)


def _joint(element: ElementTree.Element) -> _Joint:
    origin, name = element.find("origin"), element.attrib["name"]
    roll, pitch, yaw = _numbers(origin, "rpy")
    place = np.eye(4)
    turns = _turned(np.array([0.0, 0.0, 1.0]), np.array([yaw])), _turned(np.array([0.0, 1.0, 0.0]), np.array([pitch]))
    place[:3, :3] = (turns[0] @ turns[1] @ _turned(np.array([1.0, 0.0, 0.0]), np.array([roll])))[0, :3, :3]
    place[:3, 3] = _numbers(origin, "xyz")
    axis = _numbers(element.find("axis"), "xyz") if element.find("axis") is not None else np.array([1.0, 0.0, 0.0])
    child, parent = element.find("child"), element.find("parent")
    assert child is not None
    assert parent is not None
    number = JOINTS.index(name) if name in JOINTS else -1
    return _Joint(child.attrib["link"], parent.attrib["link"], place, axis, number)


def _in_order(joints: list[_Joint]) -> list[_Joint]:
    """The same, parents first."""
    children, found = {joint.child for joint in joints}, list[_Joint]()
    known = {joint.parent for joint in joints if joint.parent not in children}
    while len(found) < len(joints):
        more = [joint for joint in joints if joint.parent in known and joint.child not in known]
        found += more
        known |= {joint.child for joint in more}
    return found


def _numbers(element: ElementTree.Element | None, key: str) -> Array:
    text = "0 0 0" if element is None else element.attrib.get(key, "0 0 0")
    return np.array([float(each) for each in text.split()])


def _turned(axis: Array, angles: Array) -> Array:
    """(n, 4, 4) rotations about an axis (3,) by angles (n,) [rad]."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    found = np.tile(np.eye(4), (len(angles), 1, 1))
    found[:, :3, :3] += np.sin(angles)[:, None, None] * cross
    found[:, :3, :3] += (1.0 - np.cos(angles))[:, None, None] * (cross @ cross)
    return found


def _distance(points: Array, solid: Solid) -> Array:
    """Of points (n, m, 3) from a solid (n, m), negative inside [m]."""
    there = (points - solid.place[:3, 3]) @ solid.place[:3, :3]
    if solid.kind == "sphere":
        return np.asarray(np.linalg.norm(there, axis=2) - solid.size[0])
    if solid.kind == "capsule":
        there[:, :, 2] -= np.clip(there[:, :, 2], -0.5 * solid.size[1], 0.5 * solid.size[1])
        return np.asarray(np.linalg.norm(there, axis=2) - solid.size[0])
    out = np.abs(there) - np.array(solid.size)
    return np.asarray(np.linalg.norm(np.maximum(out, 0.0), axis=2) + np.minimum(out.max(axis=2), 0.0))
