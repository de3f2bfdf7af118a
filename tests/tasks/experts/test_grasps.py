"""The ways to hold a brick that experts choose from hold it, by the physics of the hand."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest

import jacokin.tasks
from jacokin.tasks.experts import grasps
from jacokin.tasks.experts.driver import BRICK, SQUEEZE, ArmDriver, Script, shift, up
from jacokin.tasks.experts.expert import Expert
from jacokin.tasks.experts.grasps import LONG, SHORT, BrickGrasp, Side

RISE = up(0.1)


def grasp_at(arm: ArmDriver, side: Side, at: pin.SE3) -> BrickGrasp | None:
    """A grasp where the arm may be, if it reaches that far."""
    before = shift(at, -grasps.ABOVE * at.rotation[:, 2])
    for q in arm.configurations(before):
        stops = arm.chain([at, shift(at, RISE)], q, grasps.LONGEST_STEP)
        if stops is not None:
            return BrickGrasp((q, stops[0]), at, np.inf, side)
    return None


def holds(environment: jacokin.tasks.TaskEnv, seed: int, side: Side, number: int) -> bool | None:
    """Whether a brick that is held in one of the ways is still held when it is lifted; None if the arm cannot do so."""
    found: list[bool | None] = []

    def script(arm: ArmDriver) -> Script:
        at, _ = next(itertools.islice(grasps.poses(arm.prop(BRICK), side, straight=False), number, None))
        grasp = grasp_at(arm, side, at)
        if grasp is None:
            found.append(None)
        else:
            yield from grasps.take(arm, grasp)
            yield from arm.move(shift(arm.pose, RISE), SQUEEZE, tolerance=0.02)
            found.append(grasps.holds(arm, arm.prop(BRICK)))
        yield from arm.stay(0.0)

    observation, _ = environment.reset(seed=seed)
    expert = Expert(script)
    while not found:
        observation, *_ = environment.step(expert(observation))
    return found[0]


@pytest.mark.slow
@pytest.mark.parametrize("side", [SHORT, LONG], ids=["short", "long"])
def test_a_brick_is_held_in_every_way(side: Side) -> None:
    environment = jacokin.tasks.TaskEnv("lift_brick", flatten=False)
    count = 2 * sum(len(shifts) for *_, shifts in side.tilts)
    held = [holds(environment, seed=number, side=side, number=number) for number in range(count)]
    tried = [each for each in held if each is not None]
    assert len(tried) > 0.7 * count
    assert sum(tried) >= 0.95 * len(tried)
