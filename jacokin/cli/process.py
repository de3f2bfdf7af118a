"""The process around a command: exit codes, standard streams, signals, log messages."""

from __future__ import annotations

import contextlib
import io
import logging
import os
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Any, TextIO

# Exit codes; 0 means solved, or that the check passed.
NOT_SOLVED = 1  # not (all) solved, or a check failed
WRONG_INPUT = 2  # wrong usage or input

# Ends the process after `finally` blocks have removed unfinished files. Missing on Windows: SIGHUP.
ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))

_signals: list[int] = []  # that have come and end the process


class _Dropping(io.FileIO):
    """A descriptor; what it does not take is dropped, as where the reader has left or the disk is full."""

    def write(self, content: Any, /) -> int:  # Any: a buffer, as of `FileIO`
        """Write some bytes; how many, also where they are dropped."""
        try:
            return super().write(content) or len(content)
        except OSError:
            return len(content)


@contextlib.contextmanager
def around_command() -> Iterator[None]:
    """Streams that can be written to, an orderly end at SIGTERM and SIGHUP, and the library's log on stderr."""
    _open_streams()
    stderr = sys.stderr
    is_own = stderr is sys.__stderr__ and os.name == "posix"
    if is_own:  # notes and progress that nobody reads end no work
        raw = _Dropping(stderr.fileno(), "w", closefd=False)
        sys.stderr = io.TextIOWrapper(io.BufferedWriter(raw), stderr.encoding, stderr.errors, line_buffering=True)
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("jacokin: %(message)s"))
    logger = logging.getLogger("jacokin")
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    before = _handle_signals()
    try:
        yield
    finally:
        logger.removeHandler(handler)
        sys.stderr = stderr
        _signals.clear()
        for number, old in before.items():
            signal.signal(number, old)


def _open_streams() -> None:
    """Connect closed streams to the null device; what cannot be encoded or decoded becomes escapes.

    A closed descriptor would be given to the next file that is opened, and what is printed would end up there.
    """
    for descriptor, name in enumerate(("stdin", "stdout", "stderr")):  # in the order of their descriptors
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
        if getattr(sys, name) is None:
            mode = "r" if name == "stdin" else "w"
            setattr(sys, name, open(descriptor, mode, encoding="utf-8", closefd=False))  # noqa: SIM115 - a descriptor, open to the end
        stream: TextIO = getattr(sys, name)
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")


def _handle_signals() -> dict[int, signal.Handlers]:
    """Turn signals that end the process into exceptions; returns the handlers before."""
    before: dict[int, signal.Handlers] = {}
    if threading.current_thread() is not threading.main_thread():
        return before
    for number in ENDING:
        if signal.getsignal(number) is signal.SIG_DFL:  # `nohup` ignores SIGHUP: let it
            signal.signal(number, _leave)
            before[number] = signal.SIG_DFL
    return before


def _leave(number: int, frame: FrameType | None) -> None:
    """End the process as the signal would, with the exit code that shells give it."""
    signal.signal(number, signal.SIG_DFL)
    _signals.append(number)
    heed_signals()


def heed_signals() -> None:
    """End the process if a signal has come: other code may have dropped the exception, as `rospy` does in places.

    Raises:
        SystemExit: with the exit code that shells give it.
    """
    if _signals:
        raise SystemExit(128 + _signals[-1])


def flush() -> None:
    """Write out what is still to be printed, unless who reads it has closed the pipe.

    Raises:
        OSError: it cannot be written; what remains is dropped, so that Python does not try again when it ends.
    """
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        drop_output()
    except OSError:
        drop_output()
        raise


def drop_output() -> None:
    """Discard whatever is still printed."""
    with contextlib.suppress(OSError, ValueError):  # stdout is not a file, as in tests
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, sys.stdout.fileno())
        os.close(nothing)
