"""The point of a simplex nearest to the origin: of a point, a segment, a triangle or a tetrahedron."""

from __future__ import annotations

from jacokin.arrays import Array
from jacokin.kernels.vector import Vec, cross, dot, minus

#: A tetrahedron whose height is this part of its size is flat.
FLAT = 1e-12


def nearest_in_simplex(simplex: Array, weights: Array, count: int) -> int:
    """Reduce a simplex to the corners that its nearest point is made of.

    Args:
        simplex: (4, 9) corners in the first three columns; rows are moved.
        weights: (4,) filled with the parts of the corners that are left.
        count: number of corners, the newest last.

    Returns:
        How many are left; 4 where the origin is inside.
    """
    if count == 1:
        weights[0] = 1.0
        return 1
    if count == 2:
        return keep(simplex, weights, (0, 1, 1), on_segment(corner(simplex, 0), corner(simplex, 1)))
    if count == 3:
        nearest = on_triangle(corner(simplex, 0), corner(simplex, 1), corner(simplex, 2))
        return keep(simplex, weights, (0, 1, 2), nearest)
    return nearest_in_tetrahedron(simplex, weights)


def corner(simplex: Array, i: int) -> Vec:
    """One corner."""
    return (simplex[i, 0], simplex[i, 1], simplex[i, 2])


def on_segment(a: Vec, b: Vec) -> tuple[int, float, float, float]:
    """Which corners count, as bits, and their parts."""
    ab = minus(b, a)
    length = dot(ab, ab)
    t = -dot(a, ab)
    if t <= 0.0 or length == 0.0:
        return 1, 1.0, 0.0, 0.0
    if t >= length:
        return 2, 0.0, 1.0, 0.0
    t /= length
    return 3, 1.0 - t, t, 0.0


def on_triangle(a: Vec, b: Vec, c: Vec) -> tuple[int, float, float, float]:
    """Which corners count, as bits, and their parts (Ericson, Real-Time Collision Detection, 5.1.5)."""
    ab, ac = minus(b, a), minus(c, a)
    d1, d2 = -dot(ab, a), -dot(ac, a)
    if d1 <= 0.0 and d2 <= 0.0:
        return 1, 1.0, 0.0, 0.0
    d3, d4 = -dot(ab, b), -dot(ac, b)
    if d3 >= 0.0 and d4 <= d3:
        return 2, 0.0, 1.0, 0.0
    d5, d6 = -dot(ab, c), -dot(ac, c)
    if d6 >= 0.0 and d5 <= d6:
        return 4, 0.0, 0.0, 1.0
    n = cross(ab, ac)
    vc = dot(n, cross(a, b))
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        t = d1 / (d1 - d3)
        return 3, 1.0 - t, t, 0.0
    vb = dot(n, cross(c, a))
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6)
        return 5, 1.0 - t, 0.0, t
    va = dot(n, cross(b, c))
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 6, 0.0, 1.0 - t, t
    total = va + vb + vc
    if not total > 0.0:  # no area: the newest corner and the older one that is nearer
        kept, u, w, _ = on_segment(a, c)
        return (1 if kept == 1 else 4 if kept == 2 else 5), u, 0.0, w
    return 7, va / total, vb / total, vc / total


def nearest_in_tetrahedron(simplex: Array, weights: Array) -> int:
    """The nearest of the three faces with the newest corner that the origin is beyond; 4 where it is beyond none."""
    d = corner(simplex, 3)
    best, chosen, parts, found = 0.0, 0, (0, 0.0, 0.0, 0.0), False
    for face in range(3):
        a, b = corner(simplex, face), corner(simplex, (face + 1) % 3)
        other = corner(simplex, (face + 2) % 3)
        normal = cross(minus(b, a), minus(d, a))
        inwards = dot(normal, minus(other, a))
        side = -dot(normal, a)
        flat = inwards * inwards <= FLAT * FLAT * dot(normal, normal) * dot(minus(other, a), minus(other, a))
        if side * inwards < 0.0 or flat:
            kept = on_triangle(a, b, d)
            x = kept[1] * a[0] + kept[2] * b[0] + kept[3] * d[0]
            y = kept[1] * a[1] + kept[2] * b[1] + kept[3] * d[1]
            z = kept[1] * a[2] + kept[2] * b[2] + kept[3] * d[2]
            square = x * x + y * y + z * z
            if not found or square < best:
                best, chosen, parts, found = square, face, kept, True
    if not found:
        return 4
    return keep(simplex, weights, (chosen, (chosen + 1) % 3, 3), parts)


def keep(simplex: Array, weights: Array, corners: tuple[int, int, int], parts: tuple[int, float, float, float]) -> int:
    """Move those of three corners that count to the front, see `on_triangle`; returns how many there are."""
    # The order of rows matters: a row is overwritten only after it was read.
    (i, j, k), (kept, u, v, w) = corners, parts
    if i > j:
        i, j, u, v = j, i, v, u
        kept = (kept & 4) | ((kept & 1) << 1) | ((kept & 2) >> 1)
    count = 0
    for bit in range(3):
        if kept & (1 << bit):
            row = i if bit == 0 else (j if bit == 1 else k)
            weights[count] = u if bit == 0 else (v if bit == 1 else w)
            if row != count:
                for column in range(9):
                    simplex[count, column] = simplex[row, column]
            count += 1
    return count
