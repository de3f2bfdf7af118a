"""The forwarder at an arm of no ROS."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from jacokin.runner.forwarder import Forwarder


class Arm:
    """An arm that may not hear its fingers yet."""

    def __init__(self) -> None:
        self.heard, self.shares = False, list[float]()

    def listens(self) -> bool:
        return True

    def hears_fingers(self) -> bool:
        return self.heard

    def turn(self, v: Sequence[float]) -> None:
        """Nothing."""

    def move_fingers(self, share: float) -> None:
        self.shares.append(share)

    def close(self) -> None:
        """Nothing."""


def test_fingers_are_moved_once_they_listen(capsys: pytest.CaptureFixture[str]) -> None:
    """A topic forgets what is published before; that of the fingers may be connected after that of velocities."""
    arm: Any = Arm()
    forwarder = Forwarder(lambda _: None)
    forwarder.attach(arm)
    forwarder.hear('{"fingers": 0.5}')
    forwarder.watch()
    assert arm.shares == []
    forwarder.end()
    assert "nobody listens to the fingers" in capsys.readouterr().err
    arm.heard = True
    forwarder.watch()
    forwarder.watch()
    assert arm.shares == [0.5]
    forwarder.hear('{"fingers": 1.0}')
    assert arm.shares == [0.5, 1.0]
    forwarder.end()
    assert capsys.readouterr().err == ""
