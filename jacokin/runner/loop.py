"""`run`: a runner and the way to an arm, at 100 Hz, until it has ended and the arm stands."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from jacokin.errors import InvalidInputError
from jacokin.runner.links import Link
from jacokin.runner.runner import TICK, Runner, RunnerStatus

PATIENCE = 10.0  # [s] until an arm says where it is, and listens
ENDING = 1.5  # [s] for which zeros are sent and the arm is measured, at most
ZEROS = 5  # at least


def run(runner: Runner, link: Link, *, fingers: float | None = None, watch: Callable[[], None] | None = None) -> None:
    """Lead an arm along the motion of a runner; `runner.status` then says how it ended.

    Args:
        runner: that has not begun.
        link: to its arm. It is not closed.
        fingers: where they go meanwhile, 0 open to 1 closed; None to leave them alone.
        watch: called every tick.

    Raises:
        InvalidInputError: the arm does not say where it is, or does not listen, within 10 s, or the link is cut.
        KeyboardInterrupt: as it came; the arm was told to stop.
    """
    begun = due = link.now()
    try:
        while not runner.status.has_ended:
            due = max(due + TICK, link.now())  # what is late is not made up for: the driver would keep it in its queue
            link.wait(due)
            measured = link.hear()
            is_first = runner.status is RunnerStatus.WAITING
            if is_first and not (link.listens and measured is not None):
                if link.now() - begun > PATIENCE:
                    what = "says where it is" if link.listens else "listens to velocities"
                    raise InvalidInputError(f"no arm {what} (waited {PATIENCE:g} s)")
                continue
            if not link.listens:
                runner.lose()  # for good: a driver that comes back finds nobody who moves its arm
            step = runner.step(link.now(), measured)
            if is_first and fingers is not None and not step.status.has_ended:
                link.move_fingers(fingers)
            link.send(step.v)
            if watch is not None:
                watch()
    finally:
        runner.stop()
        _come_to_rest(runner, link)


def _come_to_rest(runner: Runner, link: Link) -> None:
    """Send zeros until the arm stands."""
    due = begun = link.now()
    sent, still = 0, np.zeros(runner.robot.dof)
    while sent < ZEROS or (link.now() - begun < ENDING and not runner.stands):
        link.send(still)
        sent += 1
        due = max(due + TICK, link.now())
        link.wait(due)
        runner.step(link.now(), link.hear())
