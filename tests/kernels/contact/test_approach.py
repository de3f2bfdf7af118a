"""For how long pairs stay apart on a motion: exact distances in many places of it are never less."""

from __future__ import annotations

import numpy as np
import pytest

import jacokin
from jacokin.arrays import Array
from jacokin.kernels.contact.approach import apart_along, lasts
from jacokin.kernels.contact.arm import place_links, relate
from jacokin.kernels.contact.cloud import shape_separation
from jacokin.kernels.contact.run import counts_of, make_contact_work
from jacokin.kernels.contact.shapes import LINK
from jacokin.kernels.contact.touching import Geometry
from jacokin.model.contact import Contact
from tests.kernels.contact.calls import measured_pairs
from tests.kernels.contact.test_distances import Flight
from tests.kernels.contact.test_sweep import AMONG, ROUNDING, pairs_of

PLACES = 40  # at which distances are measured on each side


def check(geometry: Geometry, q: Array, step: Array, half: float, margin: float) -> list[float]:
    """For which part of half of a motion each pair lasts, both ways."""
    work, dof = make_contact_work(geometry, 1), len(q)
    counts, found = counts_of(work), []
    place_links(geometry.arm, dof, counts.groups, q, work.places)
    links = geometry.shapes.integers[:, LINK]
    for a, b in pairs_of(geometry).tolist():
        measuring = work.finder.work
        relate(geometry.shapes, work.places.frames, a, b, measuring.relative)
        distance = shape_separation(geometry.shapes, (a, b), measuring, np.inf, -np.inf, margin, False)
        room = apart_along(geometry.shapes, (a, b), measuring, distance) - margin
        if room <= 0.0:
            continue
        own = links[b] <= dof
        time = min(lasts(geometry, work.places, measuring, (a, b), own, step, half, room), half)
        found.append(time / half)
        along = time * np.linspace(-1.0, 1.0, 2 * PLACES + 1)[:, None]
        assert measured_pairs(geometry, np.array([(a, b)]), q + along * step)[:, 0, 0].min() > margin - ROUNDING, (a, b)
    return found


@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
@pytest.mark.one_quick
def test_shapes_of_an_arm_stay_apart(name: str, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(name)
    geometry, found = Contact(robot, AMONG).geometry, list[float]()
    for _ in range(4):
        step = rng.normal(size=robot.dof)
        found += check(geometry, robot.sample(rng), step, rng.uniform(0.05, 0.6), rng.choice([0.0, 0.01]))
    assert min(found) < 0.5 < np.median(found)


@pytest.mark.parametrize("other", ["sphere", "capsule", "box", "cylinder", "ellipsoid", "mesh", "plane"])
@pytest.mark.parametrize("kind", ["sphere", "box", "mesh"])
@pytest.mark.one_quick("other")
def test_what_slides_and_turns_stays_apart(kind: str, other: str, rng: np.random.Generator) -> None:
    geometry = Flight((kind, other), rng).geometry
    for _ in range(5):
        q = np.concatenate([rng.normal(size=3) * 0.4, rng.uniform(-3.0, 3.0, 3)])
        check(geometry, q, rng.normal(size=6) * [0.3, 0.3, 0.3, 1.5, 1.5, 1.5], rng.uniform(0.05, 1.0), 0.01)
