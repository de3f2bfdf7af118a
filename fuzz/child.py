"""Runs cases of one kind and prints what it finds, a line of JSON for each case; may crash or hang without harm."""

from __future__ import annotations

import faulthandler
import json
import resource
import sys

from fuzz import arguments, files, own_answers, targets

KINDS = {"targets": targets.run, "own": own_answers.run, "arguments": arguments.run, "files": files.run}
HANG = 60.0  # [s] for one case; then the process prints where it is and ends
MEMORY = 12 * 2**30  # [bytes] of address space; libraries reserve far more than they use


def main() -> None:
    """Arguments: kind, seed, first case, number of cases."""
    kind, seed, first, cases = sys.argv[1], *(int(word) for word in sys.argv[2:])
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    out = sys.stdout
    sys.stdout = sys.stderr  # whatever the code under test prints
    faulthandler.enable()
    faulthandler.dump_traceback_later(HANG, exit=True)
    for index, size, findings in KINDS[kind](seed, first, cases):
        faulthandler.dump_traceback_later(HANG, exit=True)  # starts anew
        out.write(json.dumps([index, size, findings]) + "\n")
        out.flush()


if __name__ == "__main__":
    main()
