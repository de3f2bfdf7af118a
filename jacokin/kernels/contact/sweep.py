"""What could touch on a part of a motion: looked at in places side by side, and certain between them.

From one place to the next, the centre of a sphere of the arm leaves the chord by at most an eighth of its second
derivative by the motion's parameter times the square of the step. So it stays that near to a box around both centres,
in the axes of any shape, and what is farther from this box than the sphere reaches is not touched in between.

Innermost loops run along the places without branches or calls, so that compilers make vector instructions of them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.configurations.arm import LANES, PLACE, move
from jacokin.kernels.contact.arm import (
    FIRST_PAIR,
    FIRST_SHAPE,
    GROUP_LINK,
    HINGE,
    INNER,
    LAST_PAIR,
    LAST_SHAPE,
    OUTER,
    ArmShapes,
    Places,
    in_world,
)
from jacokin.kernels.contact.nearest import FIRST, KIND, OBSTACLE_PAIR, OWN_PAIR, SECOND, Entry, fill
from jacokin.kernels.contact.shapes import (
    CENTRE,
    CLOUD,
    CYLINDER,
    ELLIPSOID,
    LINK,
    MARGIN,
    MESH,
    PLANE,
    RADIUS,
    SIZE,
    Shapes,
    core_bound,
    point_bound,
)
from jacokin.kernels.contact.shapes import KIND as SHAPE_KIND
from jacokin.kernels.contact.touching import Counts, Geometry, Hits, pair_bound, touch
from jacokin.kernels.contact.tree import DEEPEST

#: Steps from place to place.
STEPS = LANES - 1
#: What a sweep returns where something touches in one of the places.
TOUCHES_THERE = -1
#: Columns of what is known of a group: lowest and highest coordinates of its centre [m].
LOWEST, HIGHEST, GROUP_NUMBERS = 0, 3, 6
#: Columns of what is known of a joint: how far it turns or slides for each unit of t at most, how far those that turn
#: before it do in sum, and half of what the second derivative of a point is for each metre of its lever.
SPEED, BEFORE, PULL, JOINT_NUMBERS = range(4)
#: Columns of what is known of a group seen from a link: how far its centre moves from a place to the next, how far that
#: leaves the chords, and how much more another point does for each metre that it is away from the centre [m].
MOVES, LEAVES, LEAVES_MORE, SEEN_NUMBERS = range(4)


class Sweep(NamedTuple):
    """The places; rows along them that are read to the next place have the last one twice."""

    levers: Array  # (groups dof,) see `levers_of`
    bend: Array  # (dof,) of the motion [rad]
    shares: Array  # (LANES,) where they are on the part
    turned: Array  # (3, LANES) angle, sine and cosine of one joint
    links: Array  # (dof + 1, PLACE, LANES) where the links are
    centres: Array  # (groups, 3, LANES + 1) of the groups' spheres in the world [m]
    numbers: Array  # (groups GROUP_NUMBERS,)
    joints: Array  # (dof + 1, JOINT_NUMBERS)
    seen: Array  # (groups (dof + 1), SEEN_NUMBERS) from each link
    folded: Array  # (2, LANES // 2) lowest and highest of some places
    between: Array  # (PLACE, LANES) one link seen from an earlier one
    point: Array  # (3, LANES + 1) the centre of a shape, in the world or seen from a link [m]
    local: Array  # (3, LANES + 1) the same in the axes of another shape, from its centre [m]
    near: NDArray[np.int64]  # (LANES,) 1 where something could touch from a place to the next
    found: NDArray[np.int64]  # (3,) two shapes that touch, and in which place
    stack: NDArray[np.int64]  # (DEEPEST,)


def make_sweep(arm: ArmShapes) -> Sweep:
    """Fresh work arrays for an arm."""
    dof, groups = len(arm.joint_kinds), len(arm.groups)
    point, local = np.zeros((2, 3, LANES + 1))
    return Sweep(
        levers_of(arm).ravel(),
        np.zeros(dof),
        np.linspace(0.0, 1.0, LANES),
        np.zeros((3, LANES)),
        np.zeros((dof + 1 if dof else 0, PLACE, LANES)),
        np.zeros((groups, 3, LANES + 1)),
        np.zeros(groups * GROUP_NUMBERS),
        np.zeros((dof + 1 if dof else 0, JOINT_NUMBERS)),
        np.zeros((groups * (dof + 1), SEEN_NUMBERS)),
        np.zeros((2, LANES // 2)),
        np.zeros((PLACE, LANES)),
        point,
        local,
        np.zeros(LANES, np.int64),
        np.zeros(3, np.int64),
        np.zeros(DEEPEST, np.int64),
    )


def levers_of(arm: ArmShapes) -> Array:
    """How far the centres of groups can be from the axes of joints (groups, dof), all that slides at zero [m].

    0 for joints that do not move them.
    """
    links, dof = arm.groups[:, GROUP_LINK], len(arm.joint_kinds)
    moved, places = np.flatnonzero(links > 0), arm.placements[:, :, 3]
    along = np.append(0.0, np.cumsum(np.sqrt((places * places).sum(axis=1))))
    aside = np.append(np.hypot(places[1:, 0], places[1:, 1]) - along[2:], 0.0)
    beyond = along[links] + np.sqrt((arm.spheres[:, :3] ** 2).sum(axis=1))
    levers = np.where(np.arange(dof) < links[:, None] - 1, beyond[:, None] + aside[:dof], 0.0)
    levers[moved, links[moved] - 1] = np.hypot(arm.spheres[moved, 0], arm.spheres[moved, 1])
    return levers


class Part(NamedTuple):
    """A part of a motion start + t step + t^2 bend."""

    start: Array  # (dof,) [rad]
    step: Array  # (dof,) [rad]
    bend: Array  # (dof,) zero for a straight motion [rad]
    low: float  # t where it begins, from 0 to 1
    high: float


def speed_on(part: Part, j: int) -> float:
    """How far a joint turns on a part for each unit of t, at most [rad]."""
    step, bend = part.step[j], 2.0 * part.bend[j]
    return float(max(abs(step + part.low * bend), abs(step + part.high * bend)))


def slides_to(part: Part, j: int) -> float:
    """How far from zero a joint slides on a part, at most [m]."""
    return float(abs(part.start[j]) + abs(part.step[j]) + abs(part.bend[j]))


def sweep_part(
    geometry: Geometry,
    counts: Counts,
    places: Places,
    sweep: Sweep,
    part: Part,
    rows: NDArray[np.int64],
    last: NDArray[np.int64],
    margin: float,
) -> int:
    """Write the pairs of shapes that could come as near as a margin on a part of a motion.

    Args:
        geometry: arm and obstacles.
        counts: how much of it there is.
        places: where the base is.
        sweep: its places are filled, and near which of them something was found.
        part: of the motion.
        rows: filled with the pairs.
        last: (3,) what was found last is looked at first, see `Hits`.
        margin: [m].

    Returns:
        How many there are; `TOUCHES_THERE` where two shapes are that near in one of the places: `sweep.found`.
    """
    arm, tree = geometry.arm, geometry.tree
    place_along(arm, counts.dof, places, sweep, part)
    if touches_again(geometry.shapes, sweep, last, margin):
        return TOUCHES_THERE
    know_joints(arm, counts.dof, sweep, part)
    for i in range(LANES):
        sweep.near[i] = 0
    end = 0
    for g in range(counts.groups - 1, -1, -1):  # what is far out touches more often
        know_group(arm, counts.dof, sweep, part, g)
        if arm.groups[g, GROUP_LINK] == 0:
            continue
        for k in range(counts.planes):
            end = sweep_obstacle(geometry, counts.dof, sweep, rows, end, tree.planes[k], g, margin)
            if end == TOUCHES_THERE:
                return end
        if counts.nodes > 0:
            end = sweep_tree(geometry, counts.dof, sweep, rows, end, g, margin)
            if end == TOUCHES_THERE:
                return end
    for m in range(counts.meetings):
        end = sweep_meeting(geometry, counts, sweep, rows, end, m, margin)
        if end == TOUCHES_THERE:
            return end
    return end


def touches_again(shapes: Shapes, sweep: Sweep, last: NDArray[np.int64], margin: float) -> bool:
    """Whether a shape and an obstacle that were found last touch in one of the places, which is left in the sweep."""
    a, b = last[0], last[1]
    if a < 0 or last[2] >= 0:
        return False
    s = shapes.numbers[a]
    put_centres(sweep.links[shapes.integers[a, LINK]], s[CENTRE], s[CENTRE + 1], s[CENTRE + 2], sweep.point)
    turn_into(shapes.numbers[b], sweep.point, sweep.local)
    touching = first_touching(shapes, b, sweep.local, margin + radius_inside(shapes, a))
    if touching < 0:
        return False
    sweep.found[0], sweep.found[1], sweep.found[2] = a, b, touching
    return True


def place_along(arm: ArmShapes, dof: int, places: Places, sweep: Sweep, part: Part) -> None:
    """Place the links."""
    base, links, turned = places.frames[0], sweep.links, sweep.turned
    for k in range(PLACE):
        value = base[k % 3, k // 3]
        for i in range(LANES):
            links[0, k, i] = value
    for j in range(dof):
        start, step, bend = part.start[j], part.step[j], part.bend[j]
        for i in range(LANES):
            t = part.low + sweep.shares[i] * (part.high - part.low)
            turned[0, i] = start + t * (step + t * bend)
        move(arm.placements, j, arm.joint_kinds[j] != HINGE, turned, links)


def know_joints(arm: ArmShapes, dof: int, sweep: Sweep, part: Part) -> None:
    """Fill what is known of the joints."""
    joints, before = sweep.joints, 0.0
    for j in range(dof):
        speed = speed_on(part, j)
        joints[j, SPEED], joints[j, BEFORE], joints[j, PULL] = speed, before, speed * before + abs(part.bend[j])
        if arm.joint_kinds[j] == HINGE:
            joints[j, PULL] += 0.5 * speed * speed
            before += speed
    joints[dof, BEFORE] = before


def know_group(arm: ArmShapes, dof: int, sweep: Sweep, part: Part, g: int) -> None:
    """Fill centres and numbers of a group, and what is seen of it from each link that does not move with it."""
    sphere, centres, numbers = arm.spheres[g], sweep.centres[g], sweep.numbers[g * GROUP_NUMBERS :]
    put_centres(sweep.links[arm.groups[g, GROUP_LINK]], sphere[0], sphere[1], sphere[2], centres)
    for k in range(3):
        numbers[LOWEST + k], numbers[HIGHEST + k] = range_of(centres[k], sweep.folded)
    # The second derivative by two joints is at most the distance from the axis of the outer one; where a joint slides,
    # it is 1 or 0.
    joints, seen = sweep.joints, sweep.seen[g * (dof + 1) : (g + 1) * (dof + 1)]
    gap, moved, turned, pull, pull_more, slid = (part.high - part.low) / STEPS, 0.0, 0.0, 0.0, 0.0, 0.0
    seen[arm.groups[g, GROUP_LINK], MOVES] = 0.0
    for j in range(arm.groups[g, GROUP_LINK] - 1, -1, -1):
        speed, lever = joints[j, SPEED], 1.0
        if arm.joint_kinds[j] == HINGE:
            lever = sweep.levers[g * dof + j] + slid
            turned += speed
            pull_more += joints[j, PULL]
        else:
            slid += slides_to(part, j)
        moved += lever * speed
        pull += lever * joints[j, PULL]
        before = joints[j, BEFORE]
        seen[j, MOVES] = gap * moved
        seen[j, LEAVES] = 0.25 * gap * gap * (pull - before * moved)
        seen[j, LEAVES_MORE] = 0.25 * gap * gap * (pull_more - before * turned)


def range_of(row: Array, folded: Array) -> tuple[float, float]:
    """The lowest and the highest of a row's numbers in all places, halves side by side."""
    half, quarter = LANES // 2, LANES // 4
    for i in range(half):
        folded[0, i], folded[1, i] = min(row[i], row[half + i]), max(row[i], row[half + i])
    for i in range(quarter):
        folded[0, i] = min(folded[0, i], folded[0, quarter + i])
        folded[1, i] = max(folded[1, i], folded[1, quarter + i])
    low, high = folded[0, 0], folded[1, 0]
    for i in range(1, quarter):
        low, high = min(low, folded[0, i]), max(high, folded[1, i])
    return low, high


def sweep_tree(
    geometry: Geometry, dof: int, sweep: Sweep, rows: NDArray[np.int64], end: int, g: int, margin: float
) -> int:
    """Write the pairs of a group and what the tree holds; returns where they end."""
    tree, numbers, stack = geometry.tree, sweep.numbers[g * GROUP_NUMBERS :], sweep.stack
    limit = geometry.arm.spheres[g, 3] + margin + sweep.seen[g * (dof + 1), LEAVES]
    stack[0], size = 0, 1
    while size > 0:
        size -= 1
        node, square = stack[size], 0.0
        for k in range(3):
            c, h = tree.boxes[node, k], tree.boxes[node, 3 + k]
            away = max(max(numbers[LOWEST + k] - (c + h), (c - h) - numbers[HIGHEST + k]), 0.0)
            square += away * away
        if square > limit * limit:
            continue
        if tree.children[node, 0] >= 0:
            stack[size], stack[size + 1] = tree.children[node, 0], tree.children[node, 1]
            size += 2
            continue
        end = sweep_obstacle(geometry, dof, sweep, rows, end, tree.children[node, 1], g, margin)
        if end == TOUCHES_THERE:
            return end
    return end


def sweep_obstacle(
    geometry: Geometry, dof: int, sweep: Sweep, rows: NDArray[np.int64], end: int, b: int, g: int, margin: float
) -> int:
    """Write the pairs of a group and an obstacle; returns where they end."""
    shapes, groups, seen = geometry.shapes, geometry.arm.groups, sweep.seen[g * (dof + 1)]
    turn_into(shapes.numbers[b], sweep.centres[g], sweep.local)
    radius = geometry.arm.spheres[g, 3]
    if not comes_near(shapes, b, sweep.local, radius + margin + seen[LEAVES]):
        return end
    leaves = seen[LEAVES] + radius * seen[LEAVES_MORE]
    link = sweep.links[groups[g, GROUP_LINK]]
    for a in range(groups[g, FIRST_SHAPE], groups[g, LAST_SHAPE]):
        s = shapes.numbers[a]
        put_centres(link, s[CENTRE], s[CENTRE + 1], s[CENTRE + 2], sweep.point)
        turn_into(shapes.numbers[b], sweep.point, sweep.local)
        end = sweep_pair(shapes, sweep, rows, end, (OBSTACLE_PAIR, a, b, g), (a, b), margin, leaves)
        if end == TOUCHES_THERE:
            return end
    return end


def sweep_meeting(
    geometry: Geometry,
    counts: Counts,
    sweep: Sweep,
    rows: NDArray[np.int64],
    end: int,
    m: int,
    margin: float,
) -> int:
    """Write the pairs of two groups; returns where they end."""
    arm, shapes = geometry.arm, geometry.shapes
    g, h = arm.meetings[m, INNER], arm.meetings[m, OUTER]
    link = arm.groups[g, GROUP_LINK]
    seen = sweep.seen[h * (counts.dof + 1) + link]
    reach = arm.spheres[h, 3] + margin
    limit = arm.spheres[g, 3] + reach + 0.5 * seen[MOVES]
    inner, outer, square = sweep.numbers[g * GROUP_NUMBERS :], sweep.numbers[h * GROUP_NUMBERS :], 0.0
    for k in range(3):  # boxes around all places of both
        away = max(max(inner[LOWEST + k] - outer[HIGHEST + k], outer[LOWEST + k] - inner[HIGHEST + k]), 0.0)
        square += away * away
    if square > limit * limit or not come_close(sweep.centres[g], sweep.centres[h], limit * limit):
        return end
    relate_links(sweep, link, arm.groups[h, GROUP_LINK])
    centre, box, point, local = arm.spheres[h], arm.boxes[g], sweep.point, sweep.local
    put_centres(sweep.between, centre[0], centre[1], centre[2], point)
    x, y, z = box[0], box[1], box[2]
    for i in range(LANES + 1):
        local[0, i], local[1, i], local[2, i] = point[0, i] - x, point[1, i] - y, point[2, i] - z
    reach += seen[LEAVES]
    if not comes_to_box(local, box[3], box[4], box[5], reach * reach):
        return end
    leaves = seen[LEAVES] + arm.spheres[h, 3] * seen[LEAVES_MORE]
    for k in range(arm.meetings[m, FIRST_PAIR], arm.meetings[m, LAST_PAIR]):
        a, b = arm.pairs[k, 0], arm.pairs[k, 1]
        s = shapes.numbers[b]
        put_centres(sweep.between, s[CENTRE], s[CENTRE + 1], s[CENTRE + 2], point)
        turn_into(shapes.numbers[a], point, local)
        end = sweep_pair(shapes, sweep, rows, end, (OWN_PAIR, k, 0, h), (a, b), margin - arm.less[k], leaves)
        if end == TOUCHES_THERE:
            return end
    return end


def sweep_pair(
    shapes: Shapes,
    sweep: Sweep,
    rows: NDArray[np.int64],
    end: int,
    entry: Entry,
    pair: tuple[int, int],
    margin: float,
    leaves: float,
) -> int:
    """Write the entry of a pair of shapes if it could touch; returns where the entries end.

    `sweep.local` is the centre of the one that moves, in the axes of the other.
    """
    a, b = pair
    moving, other = (b, a) if entry[0] == OWN_PAIR else (a, b)
    limit = shapes.numbers[moving, RADIUS] + margin + leaves
    if not comes_near(shapes, other, sweep.local, limit):
        return end
    mark_near(shapes, other, sweep, limit)
    touching = first_touching(shapes, other, sweep.local, margin + radius_inside(shapes, moving))
    if touching >= 0:
        sweep.found[0], sweep.found[1], sweep.found[2] = a, b, touching
        return TOUCHES_THERE
    fill(rows[end], entry)
    return end + 1


def touch_rows(
    geometry: Geometry, places: Places, hits: Hits, rows: NDArray[np.int64], first: int, last: int, margin: float
) -> bool:
    """Whether a pair in some rows touches where all is placed; then it is left in `hits.pairs`."""
    shapes, pairs = geometry.shapes, geometry.arm.pairs
    for row in range(first, last):
        a, b, kept = rows[row, FIRST], rows[row, SECOND], margin
        if rows[row, KIND] == OWN_PAIR:
            kept -= geometry.arm.less[a]
            a, b = pairs[a, 0], pairs[a, 1]
            bound = pair_bound(shapes, places, a, b, kept)
        else:
            s = shapes.numbers[a]
            p = in_world(places.frames, shapes.integers[a, LINK], s[CENTRE], s[CENTRE + 1], s[CENTRE + 2])
            bound = point_bound(shapes, b, p) - s[RADIUS]
        if bound <= kept and touch(geometry, places, hits, a, b, kept):
            hits.pairs[0, 0], hits.pairs[0, 1] = a, b
            return True
    return False


def put_centres(frame: Array, x: float, y: float, z: float, centres: Array) -> None:
    """Fill where a point of a link is, from where the link is (PLACE, LANES)."""
    for i in range(LANES):
        u = frame[0, i] * x + frame[3, i] * y + frame[6, i] * z + frame[9, i]
        v = frame[1, i] * x + frame[4, i] * y + frame[7, i] * z + frame[10, i]
        w = frame[2, i] * x + frame[5, i] * y + frame[8, i] * z + frame[11, i]
        centres[0, i], centres[1, i], centres[2, i] = u, v, w
    for k in range(3):
        centres[k, LANES] = centres[k, LANES - 1]


def turn_into(row: Array, point: Array, local: Array) -> None:
    """Fill where a point is in the axes of a shape, from its centre."""
    x, y, z = row[CENTRE], row[CENTRE + 1], row[CENTRE + 2]
    a, b, c = row[0], row[4], row[8]
    d, e, f = row[1], row[5], row[9]
    g, h, k = row[2], row[6], row[10]
    u, v, w = a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + k * z
    for i in range(LANES + 1):
        x, y, z = point[0, i], point[1, i], point[2, i]
        local[0, i] = a * x + b * y + c * z - u
        local[1, i] = d * x + e * y + f * z - v
        local[2, i] = g * x + h * y + k * z - w


def relate_links(sweep: Sweep, inner: int, outer: int) -> None:
    """Fill where a link is, seen from an earlier one."""
    links, between = sweep.links, sweep.between
    for column in range(4):
        for i in range(LANES):
            x, y, z = links[outer, 3 * column, i], links[outer, 3 * column + 1, i], links[outer, 3 * column + 2, i]
            if column == 3:
                x, y, z = x - links[inner, 9, i], y - links[inner, 10, i], z - links[inner, 11, i]
            for k in range(3):
                between[3 * column + k, i] = (
                    links[inner, 3 * k, i] * x + links[inner, 3 * k + 1, i] * y + links[inner, 3 * k + 2, i] * z
                )


def come_close(first: Array, second: Array, square: float) -> bool:
    """Whether two points are in any place no farther apart than the root of a square."""
    found = False
    for i in range(LANES):
        x, y, z = first[0, i] - second[0, i], first[1, i] - second[1, i], first[2, i] - second[2, i]
        found |= x * x + y * y + z * z <= square
    return found


def comes_near(shapes: Shapes, b: int, local: Array, limit: float) -> bool:
    """Whether the box around a point comes this near to a shape, from any place to the next."""
    row = shapes.numbers[b]
    if shapes.integers[b, SHAPE_KIND] == PLANE:
        found = False
        for i in range(LANES):
            found |= local[2, i] <= limit
        return found
    limit += row[MARGIN]
    return comes_to_box(local, row[SIZE], row[SIZE + 1], row[SIZE + 2], limit * limit)


def comes_to_box(local: Array, a: float, b: float, c: float, square: float) -> bool:
    """Whether the box around a point comes this near to a box around the origin, from any place to the next."""
    found = False
    for i in range(LANES):
        found |= square_beside(local, i, a, b, c) <= square
    return found


def square_beside(local: Array, i: int, a: float, b: float, c: float) -> float:
    """The square of the distance of two boxes: around a point in a place and the next, and around the origin."""
    u = max(min(local[0, i], local[0, i + 1]) - a, -max(local[0, i], local[0, i + 1]) - a)
    v = max(min(local[1, i], local[1, i + 1]) - b, -max(local[1, i], local[1, i + 1]) - b)
    w = max(min(local[2, i], local[2, i + 1]) - c, -max(local[2, i], local[2, i + 1]) - c)
    u, v, w = max(u, 0.0), max(v, 0.0), max(w, 0.0)
    return float(u * u + v * v + w * w)


def mark_near(shapes: Shapes, b: int, sweep: Sweep, limit: float) -> None:
    """Mark from which places to the next that is."""
    row, local, near = shapes.numbers[b], sweep.local, sweep.near
    if shapes.integers[b, SHAPE_KIND] == PLANE:
        for i in range(LANES):
            near[i] |= 1 if min(local[2, i], local[2, i + 1]) <= limit else 0
        return
    x, y, z, limit = row[SIZE], row[SIZE + 1], row[SIZE + 2], limit + row[MARGIN]
    for i in range(LANES):
        near[i] |= 1 if square_beside(local, i, x, y, z) <= limit * limit else 0


def first_touching(shapes: Shapes, b: int, local: Array, limit: float) -> int:
    """The first place in which a point is this near to a shape; -1 for none, or where that is not certain."""
    if limit < 0.0 or shapes.integers[b, SHAPE_KIND] in (ELLIPSOID, MESH, CLOUD):
        return -1
    row, found = shapes.numbers[b], False
    x, y, z, reach = row[SIZE], row[SIZE + 1], row[SIZE + 2], limit + row[MARGIN]
    if shapes.integers[b, SHAPE_KIND] == PLANE:
        for i in range(LANES):
            found |= local[2, i] <= limit
    elif shapes.integers[b, SHAPE_KIND] == CYLINDER:
        for i in range(LANES):
            u, v = max(abs(local[2, i]) - z, 0.0), local[0, i] * local[0, i] + local[1, i] * local[1, i]
            v = max(math.sqrt(v) - x, 0.0)
            found |= u * u + v * v <= reach * reach
    else:
        for i in range(LANES):
            u, v, w = abs(local[0, i]) - x, abs(local[1, i]) - y, abs(local[2, i]) - z
            u, v, w = max(u, 0.0), max(v, 0.0), max(w, 0.0)
            found |= u * u + v * v + w * w <= reach * reach
    if not found:
        return -1
    for i in range(LANES):
        plane = shapes.integers[b, SHAPE_KIND] == PLANE
        if (local[2, i] if plane else core_bound(shapes, b, local[0, i], local[1, i], local[2, i])) <= limit:
            return i
    return -1


def radius_inside(shapes: Shapes, i: int) -> float:
    """How large a sphere around the centre of a shape is inside of it; -inf where that is not known [m]."""
    if shapes.integers[i, SHAPE_KIND] in (MESH, CLOUD):
        return -math.inf
    row = shapes.numbers[i]
    return float(min(row[SIZE], min(row[SIZE + 1], row[SIZE + 2])) + row[MARGIN])
