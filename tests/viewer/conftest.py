"""A viewer, and a page that it has opened."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from jacokin import Robot
from jacokin.viewer import Viewer, serve
from tests.viewer.page import Page, opened


@pytest.fixture
def viewer(robot: Robot) -> Iterator[Viewer]:
    with serve(robot, port=0) as running:
        yield running


@pytest.fixture
def page(viewer: Viewer) -> Iterator[Page]:
    with opened(viewer) as tab:
        yield tab
