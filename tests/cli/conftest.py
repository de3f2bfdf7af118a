"""The command line, called in this process."""

from __future__ import annotations

import pytest

from tests.cli.run import Answer, Run, leave


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    def call(*words: str) -> Answer:
        code = leave(*words)
        captured = capsys.readouterr()
        return Answer(code, captured.out, captured.err)

    return call
