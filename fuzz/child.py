"""Runs cases of one kind and prints what it finds, a line of JSON for each case; may crash or hang without harm."""

from __future__ import annotations

import faulthandler
import importlib
import json
import resource
import signal
import sys

KINDS = {"own": "own_answers", "six": "six_joints", "calibration": "calibrations", "c": "c_calls", "data": "data_sets"}
HANG = 60.0  # [s] of processor time for one case; then the process prints where it is and ends
STUCK = 10.0 * HANG  # [s] the same on the wall, however busy the machine is
MEMORY = 12 * 2**30  # [bytes] of address space; libraries reserve far more than they use


def main() -> None:
    """Arguments: kind, seed, first case, number of cases."""
    kind, seed, first, cases = sys.argv[1], *(int(word) for word in sys.argv[2:])
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    out = sys.stdout
    sys.stdout = sys.stderr  # whatever the code under test prints
    faulthandler.enable()
    faulthandler.register(signal.SIGPROF, chain=True)  # then the default: the process ends
    _start_anew()
    run = importlib.import_module(f"fuzz.{KINDS.get(kind, kind)}").run  # only what it needs
    for index, size, findings in run(seed, first, cases):
        _start_anew()
        out.write(json.dumps([index, size, findings]) + "\n")
        out.flush()


def _start_anew() -> None:
    """Give the next case all its time."""
    signal.setitimer(signal.ITIMER_PROF, HANG)
    faulthandler.dump_traceback_later(STUCK, exit=True)


if __name__ == "__main__":
    main()
