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
from jacokin.kernels.contact.cloud_tree import CloudTree
from jacokin.kernels.contact.shapes import (
    BOX,
    CENTRE,
    CLOUD,
    CYLINDER,
    ELLIPSOID,
    FIRST_NODE,
    FIRST_VERTEX,
    KIND,
    LAST_VERTEX,
    LEAVES,
    LINK,
    MARGIN,
    MESH,
    NODE_HALF,
    NODE_NUMBERS,
    NODE_RADIUS,
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
from jacokin.kernels.contact.world import WorldWork, build_world, make_world_work
from jacokin.kernels.library import Call
from jacokin.model.descriptions.meshes import convex_hull
from jacokin.model.descriptions.shapes import KINDS, Shape
from jacokin.model.kinematics import arm_of, own_axes

CORES = np.array([PLANE, POINT, SEGMENT, ELLIPSOID, CYLINDER, BOX, MESH, CLOUD])  # of the `KINDS`
NUMBER_OF_KIND = {kind: number for number, kind in enumerate(KINDS)}
PLANES = NUMBER_OF_KIND["plane"]
NO_POINTS = np.empty((0, 3))


class ShapeRow(NamedTuple):
    """One shape as the kernels see it."""

    numbers: Array
    integers: NDArray[np.int64]
    vertices: Array = NO_POINTS
    neighbours: Sequence[Sequence[int]] = ()
    cloud: CloudTree | None = None


class ArmArrays(NamedTuple):
    """What the kernels know of an arm, and whose shapes they are."""

    shapes: Shapes
    arm: ArmShapes
    numbers: NDArray[np.intp]
    """(n,) number of each of them among the shapes given, group by group."""
    alone: int
    """How many, the first ones, are obstacles that do not count against every shape."""
    met_partly: int
    """How many meetings, the first ones, are with these."""


class WorldArrays(NamedTuple):
    """What the kernels know of obstacles, whatever arm is among them: all shapes are of link 0, and numbered from 0."""

    shapes: Shapes
    tree: Tree
    kinds: NDArray[np.int64]
    """(n,) number of the kind of each among `KINDS`."""


def arm_arrays(
    joints: tuple[Array, list[int]],
    links: Sequence[int],
    rows: Sequence[ShapeRow],
    pairs: Sequence[tuple[int, int]],
    alone: Sequence[int] = (),
) -> ArmArrays:
    """The arrays for an arm.

    Args:
        joints: their placements and kinds, see `joints_about_z`.
        links: number of the joint that carries each shape.
        rows: the shapes.
        pairs: numbers of the shapes that count as contact when they touch.
        alone: numbers of shapes that are obstacles, kept as shapes of the base: those that do not count against every
            shape that moves.
    """
    placements, kinds = joints
    # They come first, and so do their meetings.
    groups = [_Group(0, [number], rows[number].numbers[CENTRE:]) for number in alone]
    groups += _groups_by_link(len(kinds), links, rows, alone)
    numbers = [number for group in groups for number in group.members]
    shapes = _stacked([rows[number] for number in numbers])
    ends = np.cumsum([0] + [len(group.members) for group in groups])
    slices = list(itertools.pairwise(ends.tolist()))

    shape_of = {number: index for index, number in enumerate(numbers)}
    group_of = {number: index for index, group in enumerate(groups) for number in group.members}
    ordered = [(a, b) if links[a] <= links[b] else (b, a) for a, b in pairs]
    ordered.sort(key=lambda pair: (group_of[pair[0]], group_of[pair[1]], shape_of[pair[0]], shape_of[pair[1]]))
    meetings = _meetings([(group_of[a], group_of[b]) for a, b in ordered])
    arm = ArmShapes(
        joint_kinds=np.array(kinds, dtype=np.int64),
        placements=placements,
        spheres=np.array([group.sphere for group in groups]).reshape(-1, 4),
        boxes=_boxes_around(shapes.numbers, slices),
        groups=_integers([(group.link, *ends) for group, ends in zip(groups, slices, strict=True)], 3),
        meetings=_integers(meetings, 4),
        pairs=_integers([(shape_of[a], shape_of[b]) for a, b in ordered], 2),
        less=np.zeros(len(ordered)),
    )
    met_partly = sum(inner < len(alone) for inner, *_ in meetings)
    return ArmArrays(shapes, arm, np.array(numbers, dtype=np.intp), len(alone), met_partly)


class _Group(NamedTuple):
    """Shapes of one link that lie together."""

    link: int
    members: list[int]
    """Their numbers."""
    sphere: Array
    """(4,) centre and radius of a sphere around them, in the frame of the link [m]."""


def _groups_by_link(dof: int, links: Sequence[int], rows: Sequence[ShapeRow], without: Sequence[int]) -> list[_Group]:
    """The shapes of each link in groups, those of the base first, without some shapes."""
    groups = list[_Group]()
    for link in range(dof + 1):
        own = [number for number in range(len(rows)) if links[number] == link and number not in without]
        groups += [_Group(link, *each) for each in _grouped({number: rows[number].numbers for number in own})]
    return groups


def _meetings(between: Sequence[tuple[int, int]]) -> list[tuple[int, int, int, int]]:
    """Pairs of groups, and where the pairs of their shapes start and stop.

    Args:
        between: the two groups of each pair of shapes; those of the same two follow each other.
    """
    starts = [at for at, groups in enumerate(between) if at == 0 or groups != between[at - 1]]
    return [(*between[start], start, stop) for start, stop in itertools.pairwise([*starts, len(between)])]


def _boxes_around(numbers: Array, slices: Sequence[tuple[int, int]]) -> Array:
    """Centres and half sizes (n, 6) [m] of boxes around groups of shapes, in the frames of their links."""
    low, high = _extents(numbers)
    extents = [(low[start:stop].min(axis=0), high[start:stop].max(axis=0)) for start, stop in slices]
    return np.array([(*(0.5 * (least + most)), *(0.5 * (most - least))) for least, most in extents]).reshape(-1, 6)


def world_arrays(obstacles: Sequence[Shape]) -> WorldArrays:
    """The arrays for obstacles.

    Raises:
        ShapeError: one of an unknown kind.
    """
    kinds, integers, own, work = _rows(obstacles, [obstacle.placement for obstacle in obstacles], with_tree=True)
    if not own:
        edges = np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64)
        shapes = Shapes(work.numbers, integers, NO_POINTS, *edges, NO_POINTS, np.empty((0, NODE_NUMBERS)))
    else:
        shapes = _stacked([own.get(k) or ShapeRow(work.numbers[k], integers[k]) for k in range(len(kinds))])
    return WorldArrays(shapes, work.tree._replace(planes=np.flatnonzero(kinds == PLANES)), kinds)


def joined(arm: ArmArrays, world: WorldArrays) -> Geometry:
    """An arm among obstacles, as the kernels take them; arrays of the arm are shared, those of shapes are not."""
    own, others = arm.shapes, world.shapes
    count, dof = len(own.numbers), len(arm.arm.joint_kinds)
    integers = np.concatenate([own.integers, others.integers])
    integers[count:, LINK] = dof + 1
    vertices, first_edge, neighbours, points, nodes = own[2:]
    clouds = integers[:, KIND] == CLOUD
    clouds[:count] = False
    if clouds.any():
        integers[np.ix_(clouds, [FIRST_VERTEX, LAST_VERTEX])] += len(own.points)
        integers[clouds, FIRST_NODE] += len(own.nodes)
        points = np.concatenate([own.points, others.points]) if len(own.points) else others.points
        nodes = np.concatenate([own.nodes, others.nodes]) if len(own.nodes) else others.nodes
    if len(others.vertices):
        meshes = integers[:, KIND] == MESH
        meshes[:count] = False
        integers[np.ix_(meshes, [FIRST_VERTEX, LAST_VERTEX])] += len(own.vertices)
        vertices = np.concatenate([own.vertices, others.vertices])
        first_edge = np.concatenate([own.first_edge, others.first_edge[1:] + len(own.neighbours)])
        neighbours = np.concatenate([own.neighbours, others.neighbours + len(own.vertices)])
    children = world.tree.children.copy()
    children[children[:, 0] < 0, 1] += count
    return Geometry(
        Shapes(
            np.concatenate([own.numbers, others.numbers]), integers, vertices, first_edge, neighbours, points, nodes
        ),
        arm.arm,
        Tree(world.tree.boxes, children, world.tree.planes + count),
    )


def _integers(rows: Sequence[tuple[int, ...]], columns: int) -> NDArray[np.int64]:
    return np.array(rows, dtype=np.int64).reshape(-1, columns)


def joints_about_z(model: pin.Model) -> tuple[Array, list[int]]:
    """For each joint its placement on the link before it, axes z, and its kind."""
    arm = arm_of(model)
    return arm.placements[:-1], [SLIDE if slides else HINGE for slides in arm.sliding.tolist()]


def shape_rows(model: pin.Model, shapes: Sequence[Shape]) -> list[ShapeRow]:
    """Shapes of an arm as the kernels see them.

    Raises:
        ShapeError: one of an unknown kind.
    """
    axes, shapes = own_axes(model), [_with_ends(shape) for shape in shapes]
    kinds, integers, own, work = _rows(shapes, [axes[shape.joint].inverse() * shape.placement for shape in shapes])
    rows = [own.get(k) or ShapeRow(work.numbers[k], integers[k]) for k in range(len(kinds))]
    for row, shape in zip(rows, shapes, strict=True):
        row.integers[LINK] = shape.joint
    return rows


def _with_ends(shape: Shape) -> Shape:
    """A plane as a box below it, other shapes as they are: the kernels take planes only against every shape."""
    if shape.kind != "plane":
        return shape
    half = 50.0  # [m]
    below = pin.SE3(np.eye(3), np.array([0.0, 0.0, -half]))
    return shape._replace(kind="box", size=np.full(3, half), placement=shape.placement * below)


def _rows(
    shapes: Sequence[Shape], placements: Sequence[pin.SE3], *, with_tree: bool = False
) -> tuple[NDArray[np.int64], NDArray[np.int64], dict[int, ShapeRow], WorldWork]:
    """Kinds (n,) and integers (n, ...) of shapes at placements, of meshes and clouds their rows, by number; the rest.

    Raises:
        ShapeError: one of an unknown kind.
    """
    count = len(shapes)
    kinds = np.array([_kind(shape) for shape in shapes], dtype=np.int64)
    cores, integers = CORES[kinds], np.zeros((count, SHAPE_INTEGERS), dtype=np.int64)
    work = make_world_work(count, np.flatnonzero(kinds != PLANES) if with_tree else None)
    work.cores[:], integers[:, KIND] = cores, cores
    if count:
        work.sizes[:] = [shape.size for shape in shapes]
        work.numbers[:, :SIZE] = np.array([placement.homogeneous for placement in placements]).reshape(-1, 16)[:, :SIZE]
    numbers = np.flatnonzero((cores == MESH) | (cores == CLOUD)).tolist()
    own = {k: _own_row(shapes[k], placements[k]) for k in numbers}
    for k, row in own.items():
        work.numbers[k] = row.numbers
    Call(build_world, work)()
    return kinds, integers, own, work


def _kind(shape: Shape) -> int:
    """Number of its kind."""
    try:
        return NUMBER_OF_KIND[shape.kind]
    except KeyError:
        kinds = ", ".join(KINDS)
        raise ShapeError(f"the shape {shape.name!r} is of a kind that contact is not computed for ({kinds})") from None


def _own_row(shape: Shape, T_link_shape: pin.SE3) -> ShapeRow:
    """The row of a mesh or a cloud."""
    if shape.cloud is None:
        return _mesh_row(T_link_shape, shape.vertices)
    return _cloud_row(T_link_shape, float(shape.size[0]), shape.cloud)


def _cloud_row(T_link_shape: pin.SE3, radius: float, cloud: CloudTree) -> ShapeRow:
    """A cloud with spheres of a radius [m]; its tree begins with a box around all points."""
    around = cloud.nodes[0]
    row = _row(CLOUD, T_link_shape, around[NODE_HALF:NODE_RADIUS], radius, around[NODE_RADIUS] + radius)
    row.numbers[CENTRE : CENTRE + 3] = T_link_shape.act(around[:NODE_HALF])
    row.integers[LEAVES] = (len(cloud.nodes) + 1) // 2
    return row._replace(cloud=cloud)


def _mesh_row(T_link_shape: pin.SE3, points: Array) -> ShapeRow:
    """The convex hull of points (n, 3), with its origin in the middle."""
    vertices, neighbours = _hull(points)
    centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    vertices = vertices - centre
    half, radius = np.abs(vertices).max(axis=0), float(np.linalg.norm(vertices, axis=1).max())
    row = _row(MESH, T_link_shape * pin.SE3(np.eye(3), centre), half, 0.0, radius)
    return row._replace(vertices=vertices, neighbours=neighbours)


def _row(kind: int, T_link_shape: pin.SE3, half: Array, margin: float, radius: float) -> ShapeRow:
    """A shape of a core, of half sizes (3,), a margin around it, and a radius that it reaches from its centre [m]."""
    numbers, integers = np.zeros(SHAPE_NUMBERS), np.zeros(SHAPE_INTEGERS, dtype=np.int64)
    numbers[:SIZE] = T_link_shape.homogeneous[:3].ravel()
    numbers[SIZE : SIZE + 3], numbers[MARGIN] = half, margin
    numbers[CENTRE : CENTRE + 3], numbers[RADIUS] = T_link_shape.translation, radius
    integers[KIND] = kind
    return ShapeRow(numbers, integers)


def _hull(points: Array) -> tuple[Array, list[list[int]]]:
    """The vertices of a convex hull, and for each those at the other end of an edge."""
    hull = convex_hull(points)
    if hull is None:  # every point counts, and each is next to all others
        return points, [[j for j in range(len(points)) if j != i] for i in range(len(points))]
    number = {int(vertex): index for index, vertex in enumerate(hull.vertices)}
    neighbours: list[set[int]] = [set() for _ in number]
    for triangle in hull.simplices.tolist():
        for vertex in triangle:
            neighbours[number[vertex]].update(number[other] for other in triangle if other != vertex)
    return points[hull.vertices], [sorted(each) for each in neighbours]


def _stacked(rows: Sequence[ShapeRow]) -> Shapes:
    """The shapes one after another."""
    first_edge, neighbours, clouds = [0], list[int](), list[CloudTree]()
    vertices, points, nodes = 0, 0, 0
    integers = np.array([row.integers for row in rows], dtype=np.int64).reshape(-1, SHAPE_INTEGERS)
    for row, whole in zip(rows, integers, strict=True):
        if row.cloud is not None:
            whole[FIRST_VERTEX], whole[LAST_VERTEX] = points, points + len(row.cloud.points)
            whole[FIRST_NODE] = nodes
            points, nodes = points + len(row.cloud.points), nodes + len(row.cloud.nodes)
            clouds.append(row.cloud)
            continue
        whole[FIRST_VERTEX], whole[LAST_VERTEX] = vertices, vertices + len(row.vertices)
        for each in row.neighbours:
            neighbours.extend(vertices + other for other in each)
            first_edge.append(len(neighbours))
        vertices += len(row.vertices)
    return Shapes(
        np.array([row.numbers for row in rows]).reshape(-1, SHAPE_NUMBERS),
        integers,
        np.concatenate([NO_POINTS, *(row.vertices for row in rows)]),
        np.array(first_edge, dtype=np.int64),
        np.array(neighbours, dtype=np.int64),
        *_stacked_clouds(clouds),
    )


def _stacked_clouds(clouds: Sequence[CloudTree]) -> tuple[Array, Array]:
    """Points and nodes of clouds, one after another; those of one cloud are shared."""
    if len(clouds) == 1:
        return clouds[0]
    points = np.concatenate([NO_POINTS, *(cloud.points for cloud in clouds)])
    return points, np.concatenate([np.empty((0, NODE_NUMBERS)), *(cloud.nodes for cloud in clouds)])


def _grouped(numbers: dict[int, Array]) -> list[tuple[list[int], Array]]:
    """Shapes of one link in groups that lie together, each with its sphere (centre, radius) [m]."""
    groups = [[geom] for geom in numbers]
    spheres = np.array([row[CENTRE:] for row in numbers.values()])
    below = np.tri(len(groups), dtype=np.bool_)
    while len(groups) > 1:
        far = np.linalg.norm(spheres[:, np.newaxis, :3] - spheres[:, :3], axis=2)
        radii = spheres[:, 3]
        around = np.maximum(0.5 * (far + radii[:, np.newaxis] + radii), np.maximum(radii[:, np.newaxis], radii))
        around[below[: len(groups), : len(groups)]] = np.inf
        i, j = divmod(int(np.argmin(around)), len(groups))
        # Groups of less than 8 cm, and of 1.35 times the larger shape: wider ones hold more and are near more often.
        if around[i, j] > max(0.08, 1.35 * max(radii[i], radii[j])):
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


def _extents(numbers: Array) -> tuple[Array, Array]:
    """Lowest and highest coordinates (n, 3) of shapes in the frames of their links [m]; a plane is taken as a point."""
    placed = numbers[:, :SIZE].reshape(-1, 3, 4)
    half = np.einsum("nij,nj->ni", np.abs(placed[:, :, :3]), numbers[:, SIZE : SIZE + 3])
    half += numbers[:, MARGIN, None]
    centres = numbers[:, CENTRE:RADIUS]
    return centres - half, centres + half


NO_WORLD = world_arrays([])
