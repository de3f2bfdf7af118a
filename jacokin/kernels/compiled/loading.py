"""Which form of the kernels answers: machine code where there is some, the plain Python of `kernels` until then.

library     machine code in memory, and calls of it
cache       machine code on disk
compiler    from Python to machine code, by numba

Nothing here happens on import. A single solve never compiles and never waits for the compiler: after a few poses in
plain Python a process in the background compiles, and its result is used from then on. A large batch waits for it.
"""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable

from jacokin.errors import JacokinError
from jacokin.kernels.compiled import cache
from jacokin.kernels.compiled.library import KernelLibrary

logger = logging.getLogger(__name__)

# Its arguments: where to import from, its niceness, and a pipe whose other end closes when this process ends.
_PROGRAM = """
import json, os, sys, threading
threading.Thread(target=lambda: (os.read(int(sys.argv[3]), 1), os._exit(1)), daemon=True).start()
sys.path[:] = json.loads(sys.argv[1])
os.nice(int(sys.argv[2]))
"""
_COMPILE = "from jacokin.kernels.compiled import compiler; compiler.main()"
_BACKGROUND_NICENESS = 10  # a control loop on the same cores comes first
#: Poses solved in plain Python before compiling in the background begins: a script with a few poses needs none.
COMPILE_AFTER = 20
#: Poses in one batch that are worth waiting for the compiler.
WAIT_FOR = 500
#: The warning where numba is disabled.
DISABLED = "NUMBA_DISABLE_JIT is set: the closed form stays in plain Python, about 10 ms a pose"


def warmup() -> float:
    """Compile the closed form, or load it from the cache, so that nothing waits for it later.

    Returns:
        Seconds it took.

    Raises:
        JacokinError: compiling failed.
    """
    start = time.perf_counter()
    KERNELS.warmup()
    return time.perf_counter() - start


def is_disabled() -> bool:
    """Whether ``NUMBA_DISABLE_JIT`` asks for plain Python, as it does of numba itself."""
    return os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")


class Kernels:
    """The kernels of this process.

    Attributes:
        library: the machine code; None as long as the plain form is in use.
    """

    def __init__(self) -> None:
        """Begin in plain Python."""
        self.library: KernelLibrary | None = None
        self._lock = threading.Lock()
        self._looked = False
        self._plain_poses = 0
        self._job: CompileJob | None = None
        self._failed = False
        self._logged: set[str] = set()

    def prepare(self) -> None:
        """Load what the cache holds; without a cache this changes nothing."""
        if self._looked:
            return
        with self._lock:
            if self._looked:
                return
            os.register_at_fork(after_in_child=self._after_fork)
            if is_disabled():
                self._log_once(DISABLED)
            else:
                self._load()
            self._looked = True

    def for_poses(self, poses: int) -> KernelLibrary | None:
        """The machine code for so many poses more; None for the plain form.

        A batch of `WAIT_FOR` poses or more waits for the compiler; less than that never waits.
        """
        if self.library is not None:
            return self.library
        self.prepare()
        if self.library is not None or is_disabled():
            return self.library
        self._plain_poses += poses
        if poses >= WAIT_FOR and not self._failed:
            self._wait(self._compiling(background=False))
        elif self._plain_poses > COMPILE_AFTER and not self._failed:
            self._compiling(background=True)
        if self.library is None:
            self._log_once(
                "the closed form is not compiled yet: using its plain Python form, about 10 ms a pose. "
                "`jacokin warmup` compiles it once and for all."
            )
        return self.library

    def warmup(self) -> None:
        """Compile, or load from the cache; the plain form stays only if numba is disabled.

        Raises:
            JacokinError: compiling failed.
        """
        self.prepare()
        if self.library is None and not is_disabled():
            failure = self._wait(self._compiling(background=False))
            if failure:
                raise JacokinError(f"the closed form could not be compiled: {failure}")

    def _compiling(self, *, background: bool) -> CompileJob | None:
        """The compiler at work, started if it is not; None when it is done."""
        with self._lock:
            if self.library is None and self._job is None:
                if background:
                    logger.info("compiling the closed form in the background")
                self._job = CompileJob(self._finished, background=background)
                self._job.start()
            return self._job

    def _wait(self, job: CompileJob | None) -> str:
        """Wait until the compiler is done; returns why it failed, or nothing."""
        if job is None:
            return ""
        logger.warning("compiling the closed form (about 20 s, once)")
        job.join()
        return job.failure

    def _finished(self, job: CompileJob) -> None:
        """Use what the compiler made; called in its thread."""
        with self._lock:
            self.library = job.library
            self._failed = job.library is None
            self._job = None
        if self._failed:
            self._log_once(f"the closed form could not be compiled: {job.failure}. Its plain Python form is used.")

    def _load(self) -> None:
        found = cache.read()
        if found.problem:
            self._log_once(found.problem)
        if found.code is not None:
            try:
                self.library = KernelLibrary(found.code)
            except RuntimeError as error:
                self._log_once(f"{cache.path()} is not used: {error}")

    def _after_fork(self) -> None:
        """In a forked child the lock is free and the compiler is the parent's."""
        self._lock = threading.Lock()
        self._job = None

    def _log_once(self, text: str) -> None:
        if text not in self._logged:
            self._logged.add(text)
            logger.warning("%s", text)


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
        return cache.unpack(done.stdout[done.stdout.find(cache.FORMAT) :])


def _is_kept(variable: str) -> bool:
    """Whether an environment variable is for the compiler: options of numba that change machine code are not."""
    return not variable.startswith("NUMBA_") or variable.startswith("NUMBA_CPU_")


#: What every solver of this process uses.
KERNELS = Kernels()
