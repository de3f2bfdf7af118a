"""The other end of peers/worker.py: starts a solver in its environment and talks to it."""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import subprocess
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from jacokin.arrays import Array

PEERS_FOLDER = Path(__file__).resolve().parent / "peers"
REPLY_TIMEOUT = 180.0  # [s]; the slowest peer needs a few seconds a round, imports and compilation included


class WorkerError(Exception):
    """The solver failed, died or stayed silent; the text says how."""


class Worker:
    """One solver in its own process, in the process group of the caller."""

    def __init__(self, python: Path, module: str) -> None:
        """Start the process; it loads nothing before `start`."""
        # Absolute, as a relative entry would name another folder there.
        path = os.pathsep.join([str(PEERS_FOLDER.parent.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
        self._noise = tempfile.TemporaryFile()  # noqa: SIM115 - closed in close()
        self._process = subprocess.Popen(
            [str(python), str(PEERS_FOLDER / "worker.py"), module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._noise,
            env={**os.environ, "PYTHONPATH": path},
            cwd=tempfile.gettempdir(),  # MuJoCo writes its log where it runs
        )
        self._buffer = b""

    def __enter__(self) -> Self:
        """Return the worker."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """End the process."""
        self.close()

    def start(self, setup: dict[str, Any]) -> str:
        """Load the solver; returns its versions as text."""
        version: str = self.ask({"do": "start", "setup": setup})["version"]
        return version

    def forward(self, q: Array) -> Array:
        """The solver's own forward kinematics: (n, dof) [rad] -> (n, 4, 4)."""
        return np.array(self.ask({"do": "forward", "q": q.tolist()})["poses"])

    def solve(self, targets: Array) -> tuple[list[Array], Array]:
        """Answers (k, dof) to each of (n, 4, 4) targets; time and processor time of each call (n, 2) [s]."""
        reply = self.ask({"do": "solve", "targets": targets.tolist()})
        seconds = np.array([reply["seconds"], reply["processor"]]).T
        return [np.array(q, dtype=np.float64) for q in reply["answers"]], seconds

    def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        """Send one request and wait for its reply.

        Raises:
            WorkerError: the solver reported an error, ended or did not answer in time.
        """
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise WorkerError(self._last_words()) from None
        reply: dict[str, Any] = json.loads(self._read_line())
        if "error" in reply:
            raise WorkerError(reply["error"])
        return reply

    def close(self) -> None:
        """End the process, politely first."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()  # the end of its input ends it
        try:
            self._process.wait(timeout=5.0)  # [s]
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process.stdout.close()
        self._noise.close()

    def _read_line(self) -> bytes:
        assert self._process.stdout is not None
        with selectors.DefaultSelector() as selector:
            selector.register(self._process.stdout, selectors.EVENT_READ)
            while b"\n" not in self._buffer:
                if not selector.select(REPLY_TIMEOUT):
                    self._process.kill()
                    raise WorkerError(f"no answer within {REPLY_TIMEOUT:.0f} s")
                chunk = os.read(self._process.stdout.fileno(), 1 << 20)
                if not chunk:
                    raise WorkerError(self._last_words())
                self._buffer += chunk
        line, self._buffer = self._buffer.split(b"\n", 1)
        return line

    def _last_words(self) -> str:
        code = self._process.wait()
        self._noise.seek(0)
        lines = self._noise.read().decode(errors="replace").strip().splitlines()
        return f"ended with code {code}" + (f": {lines[-1]}" if lines else "")
