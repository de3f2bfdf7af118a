"""Python programs run in a process of their own: a broken package may crash the one that imports it."""

from __future__ import annotations

import json
import os
import subprocess
import sys

PROBE_TIMEOUT = 120.0  # [s] for imports or one rendered picture on a slow machine

# One line of JSON for each module, written as it goes: after a crash the first one missing is at fault.
_IMPORT_PROBE = """
import importlib, json, sys
for name in sys.argv[1:]:
    try:
        module = importlib.import_module(name)
        line = [name, getattr(module, "__file__", None), None]
    except BaseException as error:
        line = [name, None, f"{type(error).__name__}: {error}"]
    print("\\n" + json.dumps(line), flush=True)
"""


def imported(modules: list[str]) -> dict[str, tuple[str | None, str | None]]:
    """Place and error of each module that was tried before the process ended."""
    output, _ = run(_IMPORT_PROBE, *modules)
    found = {}
    for line in output.splitlines():
        if line.startswith('["'):
            name, place, error = json.loads(line)
            found[name] = (place, error)
    return found


def run(program: str, *words: str, **environment: str) -> tuple[str, str | None]:
    """Output of a Python program in a process of its own, and the last line of its complaint if it failed.

    The current folder is not searched for modules.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", program, *words],
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            timeout=PROBE_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "", f"no answer within {PROBE_TIMEOUT:.0f} s"
    if done.returncode == 0:
        return done.stdout, None
    lines = done.stderr.strip().splitlines()
    return done.stdout, lines[-1] if lines else f"ended with code {done.returncode}"
