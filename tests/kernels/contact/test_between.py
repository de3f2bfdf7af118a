"""What happens between two rows of a motion: the same step as one by one, in machine code and in plain Python."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin.arrays import Array
from jacokin.kernels.contact.between import NONE, CheckWork, check_between, make_check_work
from jacokin.kernels.contact.run import ContactNumber
from jacokin.kernels.library import Call
from jacokin.model.contact import REFUSED_WITHIN, Contact
from jacokin.model.obstacles import Box
from jacokin.model.scene import Scene
from tests.kernels.plain import PlainCall

SCENE = Scene([Box("wall", [0.6, 0.02, 0.5], [0.45, -0.05, 0.25])])
DT = 0.2  # [s]


def one_by_one(contact: Contact, q: Array, reach: Array) -> int:
    """The first step on which something could touch, while nothing is near at its rows."""
    for step, far in enumerate(reach.tolist()):
        if 3.0 * far <= REFUSED_WITHIN or contact.in_the_way(q[step], q[step + 1], extra=far) is None:
            continue
        if all(contact.in_the_way(row, row) is None for row in q[step : step + 2]):
            return step
    return NONE


@pytest.mark.parametrize("form", [Call, pytest.param(PlainCall, marks=pytest.mark.slow)])
def test_the_step_is_the_one_that_is_found_one_by_one(form: Any, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot()
    contact, seen, count = Contact(robot, SCENE.surroundings), set[bool](), 12
    levers = contact.levers
    call = form(check_between, make_check_work(contact.geometry, count))
    work: CheckWork = call.work
    numbers = work.contact.numbers
    numbers[ContactNumber.MARGIN_KEPT], numbers[ContactNumber.SLACK] = 0.0, REFUSED_WITHIN
    work.between.counts[:], work.between.dt[0], work.between.levers[:] = (robot.dof, count), DT, levers
    work.between.lower[:], work.between.upper[:] = robot.lower, robot.upper
    for _ in range(60 if form is Call else 6):
        ends = np.linspace(robot.sample(rng), robot.sample(rng), count)
        q = ends + rng.normal(scale=0.03, size=ends.shape)
        a = rng.normal(size=ends.shape) * rng.choice([0.0, 1e-4, 0.5], size=(count, 1))
        work.between.q[:], work.between.a[:] = q.ravel(), a.ravel()
        bulge = 0.125 * DT**2 * np.maximum(np.abs(a[:-1]), np.abs(a[1:]))
        expected = one_by_one(contact, q, bulge @ levers)
        assert call() == expected
        np.testing.assert_allclose(work.between.reach[: count - 1], bulge @ levers)
        low, high = np.minimum(q[:-1], q[1:]) - bulge, np.maximum(q[:-1], q[1:]) + bulge
        assert work.beyond[0] == ((low < robot.lower) | (high > robot.upper)).any(axis=1).sum()
        seen.add(expected == NONE)
    assert seen == {True, False} or form is PlainCall
