"""ROS 1 of Debian, with a master, and ROS 2 of wheels; tests are skipped without."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.ros.nodes import Master, MissingRosError, Ros, ros1_with_master, ros2_of_wheels


@pytest.fixture(scope="module")
def ros1_and_master() -> Iterator[tuple[Ros, Master]]:
    try:
        with ros1_with_master() as both:
            yield both
    except MissingRosError as why:
        pytest.skip(str(why))


@pytest.fixture(scope="module")
def ros1(ros1_and_master: tuple[Ros, Master]) -> Ros:
    """ROS 1 with a master."""
    return ros1_and_master[0]


@pytest.fixture(scope="module")
def ros2() -> Ros:
    """ROS 2 in a domain of its own."""
    try:
        return ros2_of_wheels()
    except MissingRosError as why:
        pytest.skip(str(why))
