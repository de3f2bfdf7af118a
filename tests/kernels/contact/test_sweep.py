"""Sweeps: what they leave out is far all along a part of a motion, by exact distances in many places of it."""

from __future__ import annotations

import numpy as np
import pytest

import jacokin
from jacokin.arrays import Array
from jacokin.ik import Box, Cylinder, Floor, Sphere
from jacokin.kernels.contact.nearest import OWN_PAIR
from jacokin.kernels.contact.run import counts_of, make_contact_work, run_contact
from jacokin.kernels.contact.shapes import LINK
from jacokin.kernels.contact.sweep import STEPS, TOUCHES_THERE, Part, levers_of, make_sweep, sweep_part
from jacokin.kernels.contact.touching import Geometry
from jacokin.kernels.library import Call
from jacokin.model.contact import Contact
from jacokin.model.scene import Scene
from tests.kernels.contact.calls import measured_pairs
from tests.kernels.contact.test_distances import Flight

AMONG = Scene(
    [
        Box("board", [0.3, 0.5, 0.02], [0.45, 0.0, 0.3]),
        Cylinder("post", 0.05, 0.6, [0.3, 0.4, 0.3]),
        Sphere("ball", 0.1, [0.2, -0.4, 0.6]),
        Box("tilted", [0.1, 0.1, 0.3], jacokin.pose([-0.4, 0.2, 0.3], rpy=[0.3, 0.5, 0.2])),
        Floor(-0.02),
    ]
).surroundings
MARGIN = 0.01  # [m]
BETWEEN = 4  # places at which distances are measured from one place of a sweep to the next
ROUNDING = 1e-9  # [m]


def pairs_of(geometry: Geometry) -> Array:
    """All pairs (n, 2) that count: those of the arm, and what moves with obstacles."""
    links, dof = geometry.shapes.integers[:, LINK], len(geometry.arm.joint_kinds)
    moving, obstacles = np.flatnonzero((links > 0) & (links <= dof)), np.flatnonzero(links > dof)
    outside = np.column_stack([np.repeat(moving, len(obstacles)), np.tile(obstacles, len(moving))])
    return np.vstack([geometry.arm.pairs, outside])


def check(geometry: Geometry, part: Part, last: tuple[int, int, int] = (-1, -1, -1)) -> int:
    """Sweep a part of a motion; how many pairs are written, -1 where something touches."""
    work, sweep = make_contact_work(geometry, 1), make_sweep(geometry.arm)
    count = sweep_part(geometry, counts_of(work), work.places, sweep, part, work.course.near, np.array(last), MARGIN)
    t = np.linspace(part.low, part.high, BETWEEN * STEPS + 1)[:, None]
    pairs = pairs_of(geometry)
    measured = measured_pairs(geometry, pairs, part.start + t * (part.step + t * part.bend))[..., 0]
    if count == TOUCHES_THERE:
        a, b, place = sweep.found.tolist()
        (which,) = np.flatnonzero((pairs == (a, b)).all(axis=1)).tolist()
        assert measured[BETWEEN * place, which] <= MARGIN + ROUNDING
        return -1
    own = geometry.arm.pairs.tolist()
    rows = work.course.near[:count].tolist()
    written = {tuple(own[first]) if kind == OWN_PAIR else (first, second) for kind, first, second, _ in rows}
    for pair, away in zip(pairs.tolist(), measured.T, strict=True):
        if tuple(pair) not in written:
            assert away.min() > MARGIN, pair
        for step in range(STEPS):
            if sweep.near[step] == 0:
                assert away[BETWEEN * step : BETWEEN * (step + 1) + 1].min() > MARGIN, pair
    return count


def test_what_a_sweep_leaves_out_is_far(rng: np.random.Generator) -> None:
    geometry = Contact(jacokin.load_robot(), AMONG).geometry
    found = []
    for _ in range(6):
        start, step = rng.uniform([-3, 1, 1, -3, -3, -3], [3, 5, 5, 3, 3, 3]), rng.normal(size=6)
        step *= rng.uniform(0.1, 1.5) / np.abs(step).max()
        bend = rng.choice([0.0, 0.3]) * rng.normal(size=6)
        low = rng.uniform(0.0, 0.8)
        found.append(check(geometry, Part(start, step, bend, low, 1.0)))
    assert max(found) >= 0


def test_what_was_found_last_changes_no_sweep(rng: np.random.Generator) -> None:
    geometry = Contact(jacokin.load_robot(), AMONG).geometry
    links, dof, counts = geometry.shapes.integers[:, LINK], len(geometry.arm.joint_kinds), list[int]()
    moving, obstacles = np.flatnonzero((links > 0) & (links <= dof)), np.flatnonzero(links > dof)
    for _ in range(10):
        start, step = rng.uniform([-3, 1, 1, -3, -3, -3], [3, 5, 5, 3, 3, 3]), rng.normal(size=6)
        part = Part(start, step / np.abs(step).max(), np.zeros(6), 0.0, 1.0)
        last = int(rng.choice(moving)), int(rng.choice(obstacles)), -1
        counts.append(check(geometry, part))
        assert check(geometry, part, last) == counts[-1]
    assert -1 in counts
    assert max(counts) >= 0


@pytest.mark.parametrize("kind", ["sphere", "capsule", "box", "mesh"])
def test_a_sweep_of_joints_that_slide(kind: str, rng: np.random.Generator) -> None:
    geometry = Flight((kind, "box"), rng).geometry
    for _ in range(5):
        start = np.concatenate([rng.normal(size=3) * 0.4, rng.uniform(-3.0, 3.0, 3)])
        step, bend = rng.normal(size=(2, 6)) * [0.3, 0.3, 0.3, 1.5, 1.5, 1.5]
        check(geometry, Part(start, step, 0.3 * bend, 0.0, 1.0))


def test_levers_reach_as_far_as_any_configuration(rng: np.random.Generator) -> None:
    contact = Contact(jacokin.load_robot())
    arm, levers = contact.geometry.arm, levers_of(contact.geometry.arm)
    call = Call(run_contact, make_contact_work(contact.geometry, 1))
    places = call.work.places
    for _ in range(200):
        call.work.q[:] = rng.uniform(-3.0, 3.0, 6)
        call()
        for group, (link, *_) in enumerate(arm.groups.tolist()):
            for joint in range(link):
                frame = places.frames[joint + 1]
                away = np.cross(frame[:, 2], places.centres[group] - frame[:, 3])
                assert np.linalg.norm(away) <= levers[group, joint] + ROUNDING
