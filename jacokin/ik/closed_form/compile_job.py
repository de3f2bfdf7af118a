"""Compiling in a process of its own, so that the one that solves never waits for it."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable

from jacokin.ik.closed_form import cache
from jacokin.ik.closed_form.kernel_library import KernelLibrary

logger = logging.getLogger(__name__)

# Its arguments: where to import from, its niceness, and a pipe whose other end closes when this process ends.
_PROGRAM = """
import json, os, sys, threading
threading.Thread(target=lambda: (os.read(int(sys.argv[3]), 1), os._exit(1)), daemon=True).start()
sys.path[:] = json.loads(sys.argv[1])
os.nice(int(sys.argv[2]))
"""
_COMPILE = "from jacokin.ik.closed_form import compiler; compiler.main()"
_BACKGROUND_NICENESS = 10  # a control loop on the same cores comes first


class CompileJob(threading.Thread):
    """One attempt to get the compiled kernels: from another process that compiles already, or from one of its own.

    Attributes:
        library: the kernels, once the thread has ended; None if that failed.
        failure: why it failed.
    """

    def __init__(self, when_done: Callable[[CompileJob], None], *, background: bool) -> None:
        """Prepare; `start` begins.

        Args:
            when_done: called in the thread when it ends.
            background: leave the processor to others.
        """
        super().__init__(name="jacokin-compiler", daemon=True)
        self.library: KernelLibrary | None = None
        self.failure = ""
        self._niceness = _BACKGROUND_NICENESS if background else 0
        self._when_done = when_done

    def run(self) -> None:
        """Compile, load, and keep the result in the cache."""
        start = time.perf_counter()
        try:
            with cache.lock():
                code = cache.read().code  # another process may have filled the cache meanwhile
                if code is None:
                    code = self._compile()
                    logger.info("compiled the closed form in %.0f s", time.perf_counter() - start)
                    problem = cache.write(code)
                    if problem:
                        logger.warning("%s", problem)
                    else:
                        logger.info("kept it in %s", cache.folder())
            self.library = KernelLibrary(code)
        except Exception as error:  # whatever it is, the plain form goes on
            self.failure = f"{error}" or type(error).__name__
        finally:
            self._when_done(self)

    def _compile(self) -> bytes:
        """The machine code, from a process of its own.

        Raises:
            OSError: no process can be started.
            RuntimeError: it ended with an error.
            ValueError: its output was cut off.
        """
        if not sys.executable:
            raise RuntimeError("there is no Python program to compile with")
        places = json.dumps([place for place in sys.path if place])
        theirs, ours = os.pipe()
        command = [sys.executable, "-P", "-W", "ignore", "-c", _PROGRAM + _COMPILE]
        try:
            done = subprocess.run(
                [*command, places, str(self._niceness), str(theirs)],
                pass_fds=[theirs],
                env={name: value for name, value in os.environ.items() if _is_kept(name)},
                stdin=subprocess.DEVNULL,
                capture_output=True,
                start_new_session=True,  # Ctrl-C in the terminal is not meant for it
                check=False,
            )
        finally:
            os.close(theirs)
            os.close(ours)
        if done.returncode != 0:
            lines = done.stderr.decode(errors="replace").strip().splitlines()
            raise RuntimeError(lines[-1] if lines else f"the compiler ended with code {done.returncode}")
        return cache.unpacked(done.stdout[done.stdout.find(cache.FORMAT) :])


def _is_kept(variable: str) -> bool:
    """Whether an environment variable is for the compiler: options of numba that change machine code are not."""
    return not variable.startswith("NUMBA_") or variable.startswith("NUMBA_CPU_")
