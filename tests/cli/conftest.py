"""The command line, called in this process."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import pytest

from tests.cli.run import Answer, Run, leave


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    def call(*words: str | Path, code: int | Collection[int] = 0) -> Answer:
        """What a command prints, once it has left with this code, or one of these."""
        left, captured = leave(*words), capsys.readouterr()
        assert left in ([code] if isinstance(code, int) else code), captured.err
        return Answer(captured.out, captured.err)

    return call
