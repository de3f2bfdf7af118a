"""Packages that the tests compare with and that not every Python has."""

from __future__ import annotations

import sys
from importlib.util import find_spec

import pytest


def needs_dm_control() -> None:
    """Skip a test where dm_control cannot be installed; elsewhere the test extra brings it."""
    if sys.version_info >= (3, 13) and find_spec("dm_control") is None:
        pytest.skip("dm_control is not installed: it has no version for this Python")
