"""All of this folder needs dm_control."""

from __future__ import annotations

import pytest

from tests.optional import needs_dm_control


@pytest.fixture(autouse=True, scope="session")
def _dm_control() -> None:
    needs_dm_control()
