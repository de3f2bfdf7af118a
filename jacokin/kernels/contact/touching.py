"""Which shapes touch at a configuration: the first pair that does, or all of them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.kernels.contact.arm import (
    FIRST_PAIR,
    FIRST_SHAPE,
    GROUP_LINK,
    INNER,
    LAST_PAIR,
    LAST_SHAPE,
    OUTER,
    ArmShapes,
    Places,
    in_link,
    in_world,
    relate,
)
from jacokin.kernels.contact.cloud import shape_separation
from jacokin.kernels.contact.separation import SeparationWork
from jacokin.kernels.contact.shapes import CENTRE, LINK, RADIUS, Shapes, box_distance, point_bound
from jacokin.kernels.contact.tree import Tree, reaches_node
from jacokin.kernels.vector import Vec, minus, norm


class Counts(NamedTuple):
    """How much of the arrays is in use."""

    dof: int
    groups: int
    meetings: int
    nodes: int
    planes: int


class Geometry(NamedTuple):
    """An arm among obstacles."""

    shapes: Shapes
    arm: ArmShapes
    tree: Tree


class Hits(NamedTuple):
    """Pairs of shapes that touch, and working memory to find them."""

    last: NDArray[np.int64]  # (3,) what an earlier call found first is looked at first: two shapes, own pair; or -1
    pairs: NDArray[np.int64]  # (room, 2)
    stack: NDArray[np.int64]  # (DEEPEST,)
    pair: SeparationWork


def find_touching(
    geometry: Geometry, counts: Counts, places: Places, hits: Hits, margin: float, standing: float, every: bool
) -> int:
    """Find pairs of shapes that touch.

    Args:
        geometry: arm and obstacles; counts leave out what does not matter.
        counts: how much of it there is.
        places: where everything is.
        hits: filled.
        margin: shapes this near to each other touch [m].
        standing: the same for shapes of the base and obstacles; -inf to leave these pairs out [m].
        every: False to stop at the first pair.

    Returns:
        How many pairs were found.
    """
    a, b, k = hits.last[0], hits.last[1], hits.last[2]
    kept = margin - geometry.arm.less[k] if k >= 0 else margin
    again = not every and a >= 0 and pair_bound(geometry.shapes, places, a, b, kept) <= kept
    if again and touch(geometry, places, hits, a, b, kept):
        hits.pairs[0, 0], hits.pairs[0, 1] = a, b
        return 1
    found, k = touching_obstacles(geometry, counts, places, hits, margin, standing, every), -1
    if found == 0 or every:
        found, k = touching_itself(geometry, counts, places, hits, margin, every, found)
    if found > 0 and not every:
        a, b = hits.pairs[0, 0], hits.pairs[0, 1]
        own_margin = geometry.shapes.integers[a, LINK] == 0 and geometry.shapes.integers[b, LINK] > counts.dof
        hits.last[0], hits.last[1], hits.last[2] = -1 if own_margin else a, b, k
    return found


def touch(geometry: Geometry, places: Places, hits: Hits, a: int, b: int, margin: float) -> bool:
    """Whether two shapes touch."""
    relate(geometry.shapes, places.frames, a, b, hits.pair.relative)
    return shape_separation(geometry.shapes, (a, b), hits.pair, margin, margin, math.inf, margin < 0.0) <= margin


def touching_obstacles(
    geometry: Geometry, counts: Counts, places: Places, hits: Hits, margin: float, standing: float, every: bool
) -> int:
    """Fill in the pairs of the arm and obstacles; returns how many."""
    arm, tree = geometry.arm, geometry.tree
    stack, found = hits.stack, 0
    for g in range(counts.groups - 1, -1, -1):  # what is far out touches more often
        near = margin if arm.groups[g, GROUP_LINK] > 0 else standing
        if near == -math.inf:
            continue
        centre = (places.centres[g, 0], places.centres[g, 1], places.centres[g, 2])
        radius = arm.spheres[g, 3]
        reach = max(radius + near, 0.0)
        for k in range(counts.planes):
            b = tree.planes[k]
            if point_bound(geometry.shapes, b, centre) - radius <= near:
                found = touching_one(geometry, places, hits, g, b, near, every, found)
                if found > 0 and not every:
                    return found
        size = 0
        if counts.nodes > 0:
            stack[0], size = 0, 1
        while size > 0:
            size -= 1
            node = stack[size]
            if not reaches_node(tree, node, centre, reach):
                continue
            if tree.children[node, 0] >= 0:
                stack[size], stack[size + 1] = tree.children[node, 0], tree.children[node, 1]
                size += 2
                continue
            b = tree.children[node, 1]
            if point_bound(geometry.shapes, b, centre) - radius <= near:
                found = touching_one(geometry, places, hits, g, b, near, every, found)
                if found > 0 and not every:
                    return found
    return found


def touching_one(
    geometry: Geometry, places: Places, hits: Hits, g: int, b: int, margin: float, every: bool, found: int
) -> int:
    """Fill in the pairs of a group and one obstacle after those found so far; returns how many there are then."""
    shapes, groups = geometry.shapes, geometry.arm.groups
    for a in range(groups[g, FIRST_SHAPE], groups[g, LAST_SHAPE]):
        s = shapes.numbers[a]
        p = in_world(places.frames, groups[g, GROUP_LINK], s[CENTRE], s[CENTRE + 1], s[CENTRE + 2])
        if point_bound(shapes, b, p) - s[RADIUS] <= margin and touch(geometry, places, hits, a, b, margin):
            hits.pairs[found, 0], hits.pairs[found, 1] = a, b
            found += 1
            if not every:
                return found
    return found


def touching_itself(
    geometry: Geometry, counts: Counts, places: Places, hits: Hits, margin: float, every: bool, found: int
) -> tuple[int, int]:
    """Fill in the pairs of the arm's own shapes after those found so far.

    Returns:
        How many there are then, and the number of the pair where it is the first that is looked for, else -1.
    """
    arm = geometry.arm
    for m in range(counts.meetings):
        if are_apart(arm, places, m, margin) or meeting_bound(arm, places, m, margin) > margin:
            continue
        for k in range(arm.meetings[m, FIRST_PAIR], arm.meetings[m, LAST_PAIR]):
            a, b, kept = arm.pairs[k, 0], arm.pairs[k, 1], margin - arm.less[k]
            near = pair_bound(geometry.shapes, places, a, b, kept) <= kept
            if near and touch(geometry, places, hits, a, b, kept):
                hits.pairs[found, 0], hits.pairs[found, 1] = a, b
                found += 1
                if not every:
                    return found, k
    return found, -1


def are_apart(arm: ArmShapes, places: Places, m: int, margin: float) -> bool:
    """Whether the spheres of two groups are farther apart than a margin [m]."""
    g, h = arm.meetings[m, INNER], arm.meetings[m, OUTER]
    x = places.centres[g, 0] - places.centres[h, 0]
    y = places.centres[g, 1] - places.centres[h, 1]
    z = places.centres[g, 2] - places.centres[h, 2]
    reach = max(arm.spheres[g, 3] + arm.spheres[h, 3] + margin, 0.0)
    return bool(x * x + y * y + z * z > reach * reach)


def meeting_bound(arm: ArmShapes, places: Places, m: int, enough: float) -> float:
    """A lower bound of the distance between two groups, found with no more work than to show that it is enough [m]."""
    g, h = arm.meetings[m, INNER], arm.meetings[m, OUTER]
    p = (places.centres[g, 0], places.centres[g, 1], places.centres[g, 2])
    q = (places.centres[h, 0], places.centres[h, 1], places.centres[h, 2])
    bound = norm(minus(p, q)) - arm.spheres[g, 3] - arm.spheres[h, 3]
    if bound > enough:
        return float(bound)
    bound = max(bound, group_box_bound(arm, places, g, q) - arm.spheres[h, 3])
    if bound > enough:
        return float(bound)
    return float(max(bound, group_box_bound(arm, places, h, p) - arm.spheres[g, 3]))


def group_box_bound(arm: ArmShapes, places: Places, g: int, p: Vec) -> float:
    """A lower bound of the distance from a point to a group, negative inside of its box [m]."""
    box = arm.boxes[g]
    there = in_link(places.frames, arm.groups[g, GROUP_LINK], p)
    return box_distance(
        abs(there[0] - box[0]) - box[3], abs(there[1] - box[1]) - box[4], abs(there[2] - box[2]) - box[5]
    )


def pair_bound(shapes: Shapes, places: Places, a: int, b: int, enough: float) -> float:
    """A lower bound of the distance between two shapes of the arm, as `meeting_bound` [m]."""
    s, t = shapes.numbers[a], shapes.numbers[b]
    link_a, link_b = shapes.integers[a, LINK], shapes.integers[b, LINK]
    p = in_world(places.frames, link_a, s[CENTRE], s[CENTRE + 1], s[CENTRE + 2])
    q = in_world(places.frames, link_b, t[CENTRE], t[CENTRE + 1], t[CENTRE + 2])
    bound = norm(minus(p, q)) - s[RADIUS] - t[RADIUS]
    if bound > enough:
        return float(bound)
    bound = max(bound, point_bound(shapes, a, in_link(places.frames, link_a, q)) - t[RADIUS])
    if bound > enough:
        return float(bound)
    return float(max(bound, point_bound(shapes, b, in_link(places.frames, link_b, p)) - s[RADIUS]))
