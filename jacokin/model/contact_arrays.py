"""The shapes of an arm and its obstacles as the arrays that the kernels of contact work on."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import ShapeError
from jacokin.kernels.contact.arm import HINGE, SLIDE, ArmShapes
from jacokin.kernels.contact.shapes import (
    BOX,
    CENTRE,
    CYLINDER,
    ELLIPSOID,
    FIRST_VERTEX,
    KIND,
    LAST_VERTEX,
    LINK,
    MARGIN,
    MESH,
    PLANE,
    POINT,
    RADIUS,
    SEGMENT,
    SHAPE_INTEGERS,
    SHAPE_NUMBERS,
    SIZE,
    Shapes,
)
from jacokin.kernels.contact.touching import Geometry
from jacokin.kernels.contact.tree import Tree
from jacokin.model.descriptions.shapes import KINDS, Shape

CORES = dict(zip(KINDS, (PLANE, POINT, SEGMENT, ELLIPSOID, CYLINDER, BOX, MESH), strict=True))
WIDEST_GROUP = 1.35  # times its largest shape: wider groups hold more shapes and are near more often
GROUP_AT_LEAST = 0.08  # [m] radius below which shapes are grouped anyway


class ContactArrays(NamedTuple):
    """What the kernels need to know, and whose shapes they are."""

    geometry: Geometry
    numbers: NDArray[np.intp]
    """(n,) number of each of them among the shapes given: those of the arm group by group, then the obstacles."""
    met_partly: int
    """How many meetings, the first ones, are with obstacles that do not count against every shape."""


def contact_arrays(
    model: pin.Model,
    given: Sequence[Shape],
    pairs: Sequence[tuple[int, int]],
    obstacles: Sequence[int],
    partly: Sequence[tuple[int, int]] = (),
) -> ContactArrays:
    """The arrays for an arm and its obstacles.

    Args:
        model: the arm, a chain of joints.
        given: the shapes of the arm and the obstacles.
        pairs: numbers of the shapes of the arm that count as contact when they touch.
        obstacles: numbers of obstacles that count against every shape that moves.
        partly: pairs of another obstacle and a shape that moves; these obstacles are kept as shapes of the base.

    Raises:
        ShapeError: a shape of a kind that is not convex.
    """
    turns, placements, kinds = _joints(model)
    links = [shape.joint for shape in given]
    for geom in obstacles:
        links[geom] = len(turns)
    rows = {geom: _row(shape, links[geom], turns) for geom, shape in enumerate(given)}
    alone = list(dict.fromkeys(obstacle for obstacle, _ in partly))
    # They come first, and so do their meetings.
    groups = [(0, [geom], rows[geom].numbers[CENTRE:]) for geom in alone] + [
        (link, group, sphere)
        for link in range(len(turns))
        for group, sphere in _grouped(
            {geom: rows[geom].numbers for geom in rows if links[geom] == link and geom not in alone}
        )
    ]
    geoms = [geom for _, group, _ in groups for geom in group] + list(obstacles)
    shape_of = {geom: index for index, geom in enumerate(geoms)}
    group_of = {geom: index for index, (_, group, _) in enumerate(groups) for geom in group}
    ends = np.cumsum([0] + [len(group) for _, group, _ in groups])

    ordered = [(a, b) if links[a] <= links[b] else (b, a) for a, b in [*partly, *pairs]]
    ordered.sort(key=lambda pair: (group_of[pair[0]], group_of[pair[1]], shape_of[pair[0]], shape_of[pair[1]]))
    between = [(group_of[a], group_of[b]) for a, b in ordered]
    met = sorted(set(between))
    firsts = np.searchsorted([g * len(groups) + h for g, h in between], [g * len(groups) + h for g, h in met])
    shapes = _stacked([rows[geom] for geom in geoms])
    low, high = _extents(shapes)
    slices = list(itertools.pairwise(ends.tolist()))
    extents = [(low[i:j].min(axis=0), high[i:j].max(axis=0)) for i, j in slices]
    arm = ArmShapes(
        joint_kinds=np.array(kinds, dtype=np.int64),
        placements=placements,
        spheres=np.array([sphere for _, _, sphere in groups]).reshape(-1, 4),
        boxes=np.array([(*(0.5 * (least + most)), *(0.5 * (most - least))) for least, most in extents]).reshape(-1, 6),
        groups=_integers([(link, *ends) for (link, _, _), ends in zip(groups, slices, strict=True)], 3),
        meetings=_integers(
            [(*pair, *ends) for pair, ends in zip(met, itertools.pairwise([*firsts, len(between)]), strict=True)], 4
        ),
        pairs=_integers([(shape_of[a], shape_of[b]) for a, b in ordered], 2),
    )
    return ContactArrays(
        Geometry(shapes, arm, _tree(shapes, int(ends[-1]))),
        np.array(geoms, dtype=np.intp),
        sum(inner < len(alone) for inner, _ in met),
    )


def _integers(rows: Sequence[tuple[int, ...]], columns: int) -> NDArray[np.int64]:
    return np.array(rows, dtype=np.int64).reshape(-1, columns)


class _Row(NamedTuple):
    """One shape as the kernels see it."""

    numbers: Array
    integers: NDArray[np.int64]
    vertices: Array
    neighbours: list[list[int]]


def _joints(model: pin.Model) -> tuple[list[pin.SE3], Array, list[int]]:
    """For each link, base first: T_joint_link, whose z is the axis; its placement on the one before; its kind."""
    turns, placements, kinds = [pin.SE3.Identity()], np.empty((model.nv, 3, 4)), []
    for index in range(1, model.njoints):
        joint = model.joints[index]
        data = joint.createData()
        joint.calc(data, np.zeros(model.nq))
        subspace = np.asarray(data.S).ravel()
        hinge = bool(subspace[3:].any())
        axis = subspace[3:] if hinge else subspace[:3]
        turn = pin.SE3(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).toRotationMatrix(), np.zeros(3))
        placements[index - 1] = (turns[-1].inverse() * model.jointPlacements[index] * turn).homogeneous[:3]
        turns.append(turn)
        kinds.append(HINGE if hinge else SLIDE)
    return turns, placements, kinds


def _row(shape: Shape, link: int, turns: Sequence[pin.SE3]) -> _Row:
    """A shape as the kernels see it."""
    if shape.kind not in CORES:
        raise ShapeError(f"the shape {shape.name!r} is of a kind that contact is not computed for ({', '.join(KINDS)})")
    core, size, T_link_shape = CORES[shape.kind], shape.size, shape.placement
    if link < len(turns):  # of the arm
        T_link_shape = turns[link].inverse() * T_link_shape
    half, margin, vertices, neighbours = np.zeros(3), 0.0, np.empty((0, 3)), list[list[int]]()
    if core == POINT:
        margin = size[0]
    elif core == SEGMENT:
        half[2], margin = size[1], size[0]
    elif core == CYLINDER:
        half[:] = size[0], size[0], size[1]
    elif core == MESH:
        vertices, neighbours = _hull(shape.vertices)
        centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
        vertices = vertices - centre
        T_link_shape = T_link_shape * pin.SE3(np.eye(3), centre)
        half = np.abs(vertices).max(axis=0)
    elif core != PLANE:
        half = size
    numbers, integers = np.zeros(SHAPE_NUMBERS), np.zeros(SHAPE_INTEGERS, dtype=np.int64)
    numbers[:SIZE] = T_link_shape.homogeneous[:3].ravel()
    numbers[SIZE : SIZE + 3], numbers[MARGIN] = half, margin
    numbers[CENTRE : CENTRE + 3], numbers[RADIUS] = (
        T_link_shape.translation,
        margin + _core_radius(core, half, vertices),
    )
    integers[KIND], integers[LINK] = core, link
    return _Row(numbers, integers, vertices, neighbours)


def _core_radius(core: int, half: Array, vertices: Array) -> float:
    """How far a core reaches from its centre [m]."""
    if core == PLANE:
        return float(np.inf)
    if core == CYLINDER:
        return float(np.hypot(half[0], half[2]))
    if core == ELLIPSOID:
        return float(half.max())
    return float(np.linalg.norm(vertices, axis=1).max() if core == MESH else np.linalg.norm(half))


def _hull(points: Array) -> tuple[Array, list[list[int]]]:
    """The vertices of a convex hull, and for each those at the other end of an edge."""
    from scipy.spatial import ConvexHull, QhullError  # only meshes need it

    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):  # flat: every point counts, and each is next to all others
        return points, [[j for j in range(len(points)) if j != i] for i in range(len(points))]
    number = {int(vertex): index for index, vertex in enumerate(hull.vertices)}
    neighbours: list[set[int]] = [set() for _ in number]
    for triangle in hull.simplices.tolist():
        for vertex in triangle:
            neighbours[number[vertex]].update(number[other] for other in triangle if other != vertex)
    return points[hull.vertices], [sorted(each) for each in neighbours]


def _stacked(rows: Sequence[_Row]) -> Shapes:
    """The shapes one after another."""
    first_edge, neighbours = [0], list[int]()
    vertices = 0
    integers = np.array([row.integers for row in rows], dtype=np.int64).reshape(-1, SHAPE_INTEGERS)
    for row, whole in zip(rows, integers, strict=True):
        whole[FIRST_VERTEX], whole[LAST_VERTEX] = vertices, vertices + len(row.vertices)
        for each in row.neighbours:
            neighbours.extend(vertices + other for other in each)
            first_edge.append(len(neighbours))
        vertices += len(row.vertices)
    return Shapes(
        np.array([row.numbers for row in rows]).reshape(-1, SHAPE_NUMBERS),
        integers,
        np.concatenate([np.empty((0, 3)), *(row.vertices for row in rows)]),
        np.array(first_edge, dtype=np.int64),
        np.array(neighbours, dtype=np.int64),
    )


def _grouped(numbers: dict[int, Array]) -> list[tuple[list[int], Array]]:
    """Shapes of one link in groups that lie together, each with its sphere (centre, radius) [m]."""
    groups = [[geom] for geom in numbers]
    spheres = np.array([row[CENTRE:] for row in numbers.values()])
    while len(groups) > 1:
        far = np.linalg.norm(spheres[:, np.newaxis, :3] - spheres[:, :3], axis=2)
        radii = spheres[:, 3]
        around = np.maximum(0.5 * (far + radii[:, np.newaxis] + radii), np.maximum(radii[:, np.newaxis], radii))
        around[np.tril_indices(len(groups))] = np.inf
        i, j = (int(index) for index in np.unravel_index(np.argmin(around), around.shape))
        if around[i, j] > max(GROUP_AT_LEAST, WIDEST_GROUP * max(radii[i], radii[j])):
            break
        spheres[i] = _around(spheres[i], spheres[j])
        groups[i] += groups.pop(j)
        spheres = np.delete(spheres, j, axis=0)
    return list(zip(groups, spheres, strict=True))


def _around(a: Array, b: Array) -> Array:
    """The smallest sphere (4,) around two."""
    across = b[:3] - a[:3]
    far = float(np.linalg.norm(across))
    if far + b[3] <= a[3]:
        return a
    if far + a[3] <= b[3]:
        return b
    radius = 0.5 * (far + a[3] + b[3])
    return np.append(a[:3] + across * ((radius - a[3]) / far), radius)


def _extents(shapes: Shapes) -> tuple[Array, Array]:
    """Lowest and highest coordinates (n, 3) of shapes in the frames of their links [m]; a plane is taken as a point."""
    placed = shapes.numbers[:, :SIZE].reshape(-1, 3, 4)
    half = np.einsum("nij,nj->ni", np.abs(placed[:, :, :3]), shapes.numbers[:, SIZE : SIZE + 3])
    half += shapes.numbers[:, MARGIN, None]
    return placed[:, :, 3] - half, placed[:, :, 3] + half


def _tree(shapes: Shapes, first: int) -> Tree:
    """The obstacles, which are the shapes from a number on, halved along the longest side again and again."""
    numbers, kinds = shapes.numbers, shapes.integers[:, KIND]
    planes = [i for i in range(first, len(numbers)) if kinds[i] == PLANE]
    ends = [i for i in range(first, len(numbers)) if kinds[i] != PLANE]
    boxes, children = list[Array](), list[tuple[int, int]]()
    if ends:
        low, high = _extents(shapes)
        waiting = [(np.array(ends), -1, 0)]
        while waiting:
            held, parent, side = waiting.pop()
            if parent >= 0:
                children[parent] = (len(boxes), children[parent][1]) if side == 0 else (children[parent][0], len(boxes))
            least, most = low[held].min(axis=0), high[held].max(axis=0)
            boxes.append(np.append(0.5 * (least + most), 0.5 * (most - least)))
            if len(held) == 1:
                children.append((-1, int(held[0])))
                continue
            centres = low[held] + high[held]
            order = np.argsort(centres[:, int(np.argmax(np.ptp(centres, axis=0)))], kind="stable")
            middle = len(held) // 2
            waiting += [(held[order[:middle]], len(boxes) - 1, 0), (held[order[middle:]], len(boxes) - 1, 1)]
            children.append((0, 0))
    return Tree(
        np.array(boxes).reshape(-1, 6),
        np.array(children, dtype=np.int64).reshape(-1, 2),
        np.array(planes, dtype=np.int64),
    )
