"""The command line, in this process or in one of its own: exit code and what was printed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import jacokin
from jacokin.cli.main import main

HOME = ("4.8046852", "2.92482", "1.002", "4.2031852", "1.4458", "1.3233")
POSE = ("--position", "0.3", "-0.2", "0.5", "--down")
# The package under test, which may be an installed one.
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(jacokin.__file__).parent.parent)}
# Whoever started the tests may have these signals ignored, as nohup and the shells' & do, and children inherit that.
USUAL_SIGNALS = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    "for number in signal.SIGTERM, signal.SIGHUP: signal.signal(number, signal.SIG_DFL)\n"
)


@dataclass
class Answer:
    out: str
    err: str

    @property
    def document(self) -> dict[str, Any]:
        document: dict[str, Any] = json.loads(self.out)
        return document


Run = Callable[..., Answer]


def leave(*words: str | Path) -> int:
    """Exit code of a command."""
    with pytest.raises(SystemExit) as leaving:
        main([*map(str, words)])
    code = leaving.value.code
    assert code is None or isinstance(code, int)
    return code or 0


@contextmanager
def running(*words: str) -> Iterator[subprocess.Popen[str]]:
    """A process of the command line that is over after the block."""
    process = start(*words)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def start(*words: str, before: str = "") -> subprocess.Popen[str]:
    """A process that runs the command line after some lines of Python."""
    program = f"{USUAL_SIGNALS}{before}\nfrom jacokin.__main__ import main\nmain()\n"
    return subprocess.Popen(
        [sys.executable, "-P", "-u", "-c", program, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=ENVIRONMENT,
    )
