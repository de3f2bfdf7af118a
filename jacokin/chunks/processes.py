"""Worker processes on this machine that end with the process that started them."""

from __future__ import annotations

import os
import signal
import threading
from concurrent.futures import ProcessPoolExecutor


def worker_processes(count: int) -> ProcessPoolExecutor:
    """Processes of their own, started anew: threads of numba and BLAS do not survive a fork.

    Scripts that use them must do so under ``if __name__ == "__main__":``, because each process imports the script.
    """
    import multiprocessing

    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(count, mp_context=context, initializer=_begin)


def follow_parent() -> None:
    """End this process when its parent has ended: killed ones cannot tell, and it would wait for work for ever."""
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _begin() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which then stops them
    follow_parent()


def _end_with_parent() -> None:
    import multiprocessing

    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
