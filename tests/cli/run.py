"""The command line in this process: exit code and what was printed."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from jacokin.cli.main import main

HOME = ("4.8046852", "2.92482", "1.002", "4.2031852", "1.4458", "1.3233")
POSE = ("--position", "0.3", "-0.2", "0.5", "--down")


@dataclass
class Answer:
    code: int
    out: str
    err: str

    @property
    def document(self) -> dict[str, Any]:
        document: dict[str, Any] = json.loads(self.out)
        return document


Run = Callable[..., Answer]


def leave(*words: str) -> int:
    """Exit code of a command."""
    with pytest.raises(SystemExit) as leaving:
        main(words)
    code = leaving.value.code
    assert code is None or isinstance(code, int)
    return code or 0
