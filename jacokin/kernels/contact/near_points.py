"""The entry point: which of many points are on the arm, inside of it, or near to it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import FIRST_SHAPE, GROUP_LINK, LAST_SHAPE, in_link, place_links
from jacokin.kernels.contact.cloud import put
from jacokin.kernels.contact.run import NOTHING, ContactNumber, ContactWork, counts_of, make_contact_work
from jacokin.kernels.contact.separation import SeparationWork, separation
from jacokin.kernels.contact.shapes import ELLIPSOID, KIND, MESH, Shapes, point_bound
from jacokin.kernels.contact.touching import Geometry, group_box_bound
from jacokin.kernels.vector import Vec, minus, norm


class NearWork(NamedTuple):
    """What a call reads and writes; one set for each thread."""

    contact: ContactWork  # its configuration, and one obstacle: a point
    points: Array  # (n, 3) in the world [m]
    near: NDArray[np.int64]  # (n,) filled with 1 where a point is at the margin of a shape or nearer


def make_near_work(geometry: Geometry = NOTHING, points: Array | None = None) -> NearWork:
    """Fresh work arrays for an arm and a point, and points (n, 3) [m]."""
    given = np.zeros((0, 3)) if points is None else points
    rows = 1 if len(geometry.arm.joint_kinds) else 0
    return NearWork(make_contact_work(geometry, rows), given, np.zeros(len(given), np.int64))


def find_near_points(work: NearWork) -> int:
    """Mark the points that are within `MARGIN_KEPT` of the arm at the configuration given; returns how many."""
    contact, total = work.contact, 0
    counts, geometry, places = counts_of(contact), contact.geometry, contact.places
    arm, shapes, margin = geometry.arm, geometry.shapes, contact.numbers[ContactNumber.MARGIN_KEPT]
    place_links(arm, counts.dof, counts.groups, contact.q, places)
    for k in range(work.points.shape[0]):
        point = (work.points[k, 0], work.points[k, 1], work.points[k, 2])
        work.near[k] = 0
        for g in range(counts.groups):
            centre = (places.centres[g, 0], places.centres[g, 1], places.centres[g, 2])
            if norm(minus(point, centre)) - arm.spheres[g, 3] > margin:
                continue
            if group_box_bound(arm, places, g, point) > margin:
                continue
            there = in_link(places.frames, arm.groups[g, GROUP_LINK], point)
            for a in range(arm.groups[g, FIRST_SHAPE], arm.groups[g, LAST_SHAPE]):
                if point_distance(shapes, a, there, contact.hits.pair, margin) <= margin:
                    work.near[k] = 1
                    break
            if work.near[k] == 1:
                total += 1
                break
    return total


def point_distance(shapes: Shapes, a: int, p: Vec, work: SeparationWork, enough: float) -> float:
    """Distance of a shape and a point of its link's frame, or a lower bound larger than `enough` [m].

    The last of the shapes is a point. Inside of a mesh or an ellipsoid the distance is zero.
    """
    bound = point_bound(shapes, a, p)
    if bound > enough or shapes.integers[a, KIND] not in (ELLIPSOID, MESH):
        return float(bound)
    row = shapes.numbers[a]
    x, y, z = p[0] - row[3], p[1] - row[7], p[2] - row[11]
    there = (
        row[0] * x + row[4] * y + row[8] * z,
        row[1] * x + row[5] * y + row[9] * z,
        row[2] * x + row[6] * y + row[10] * z,
    )
    put(work.relative, there)
    last = shapes.numbers.shape[0] - 1
    return float(separation(shapes, (a, last), work, enough, enough, math.inf, False))
