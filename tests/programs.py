"""Programs in a process of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any


def execute(
    *words: str | Path,
    code: int = 0,
    cwd: Path | None = None,
    timeout: float = 600.0,
    environment: Mapping[str, str] = MappingProxyType({}),
) -> subprocess.CompletedProcess[str]:
    """What a program printed that ended with this code, with variables of the environment beside those of the tests."""
    done = subprocess.run(
        [str(word) for word in words],
        env={**os.environ, **environment},
        cwd=cwd,
        timeout=timeout,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done


def python(*words: str | Path, **settings: Any) -> subprocess.CompletedProcess[str]:  # Any: those of `execute`
    """The same of Python, which looks for no modules in the folder that it runs in."""
    return execute(sys.executable, "-P", *words, **settings)
