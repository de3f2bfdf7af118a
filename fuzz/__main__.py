"""`python -m fuzz`: random targets, arguments, files, motions, ... for a bounded time; exit code 1 for any finding.

A set that is not complete, and says so, may lack a member: "unsure" is counted and no failure.

The seed is printed. The same seed, from the same first case on, runs the same cases.
"""

from __future__ import annotations

import argparse
import json
import secrets
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator

from fuzz.findings import Finding

#: By kind, how many cases there are, and how many of them in one process: a fresh one bounds memory.
KINDS = {
    "targets": (1_000_000, 400),
    "own": (200_000, 200),
    "six": (50_000, 500),
    "arguments": (100_000, 4000),
    "files": (10_000, 500),
    "damage": (20_000, 2000),
    "c": (1_000_000, 500),
    "motions": (1000, 50),
    "calibration": (1000, 100),
    "data": (100, 20),
}
SECONDS = 180.0  # for each kind: half an hour for all
SHOWN = 3  # examples of each finding


def main() -> int:
    """Run what is asked for and print the figures."""
    options = _options()
    print(f"seed {options.seed}")
    found = 0
    for kind in options.kinds or list(KINDS):
        found += _campaign(kind, options.seed, options.first, getattr(options, kind), options.seconds)
    return 1 if found else 0


def _campaign(kind: str, seed: int, first: int, goal: int, seconds: float) -> int:
    """All cases of one kind; how many failures."""
    start, done, case = time.monotonic(), 0, first
    counts: Counter[str] = Counter()
    shown: Counter[tuple[str, str]] = Counter()
    while done < goal and time.monotonic() - start < seconds:
        last = case
        for index, size, findings in _child(kind, seed, case, KINDS[kind][1]):
            last, done = index + 1, done + size
            for finding in findings:
                counts[finding.kind] += 1
                shown[finding.kind, finding.where] += 1
                if shown[finding.kind, finding.where] <= SHOWN:
                    print(f"{kind} case {index}: {finding.kind}: {finding.where}: {finding.what}", flush=True)
            if done >= goal or time.monotonic() - start >= seconds:
                break
        case = last if last > case else case + 1
    print(
        f"{kind}: {done} in {time.monotonic() - start:.0f} s, "
        + ", ".join(f"{counts[name]} {name}" for name in ("wrong", "lost", "raw", "crash", "slow", "unsure"))
        + f"; go on with --seed {seed} --first {case} {kind}"
    )
    for (what, where), times in sorted(shown.items(), key=lambda item: -item[1]):
        print(f"  {times:6d} {what}: {where}")
    return counts.total() - counts["unsure"]


def _child(kind: str, seed: int, first: int, cases: int) -> Iterator[tuple[int, int, list[Finding]]]:
    """The cases that one process finishes; the one it dies in counts as a crash."""
    words = [sys.executable, "-m", "fuzz.child", kind, str(seed), str(first), str(cases)]
    expected = first
    with tempfile.TemporaryFile("w+") as errors:
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=errors, text=True)
        try:
            assert process.stdout is not None
            for line in process.stdout:
                index, size, findings = json.loads(line)
                expected = index + 1
                yield index, size, [Finding(*finding) for finding in findings]
            code = process.wait()
            if code != 0:
                errors.seek(0)
                tail = " | ".join(errors.read().strip().splitlines()[-6:])
                yield expected, 1, [Finding("crash", f"exit code {code}", tail)]
        finally:
            process.kill()
            process.wait()


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m fuzz", description=__doc__)
    parser.add_argument("kinds", nargs="*", choices=[[], *KINDS], help="what to run; everything by default")
    parser.add_argument("--seed", type=int, default=secrets.randbelow(10**6))
    parser.add_argument("--first", type=int, default=0, help="case to begin with")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="at most so long for each kind")
    for kind, (goal, _) in KINDS.items():
        parser.add_argument(f"--{kind}", type=int, default=goal, metavar="N", help=f"default {goal}")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
