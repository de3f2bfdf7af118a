"""What the tests of solving share."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """For the files of the arms of one module."""
    return tmp_path_factory.mktemp("arms")
