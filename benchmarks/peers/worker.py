"""Runs one solver for `benchmarks.run`: targets come in and answers go out, one JSON object a line.

    python worker.py MODULE        with MODULE one of the files beside this one

A request has a "do" key. "start" (the robot's files, limits and home), "forward" (configurations in, (4, 4) poses
out), "solve" (poses in; configurations, seconds and processor
seconds of each call out). Every reply is one line; a failure is
{"error": text}. Only the standard library and numpy are needed, so the same file runs in every environment.

A solver module has a class `Peer(setup)` with `version`, `forward(q)`, `prepare(T)`, `solve(prepared)` and
`answers(raw)`. Only `solve` is timed: what turns a (4, 4) matrix into the peer's own pose type, and its answer into a
list of joint vectors, is not.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import sys
import time
import traceback
from typing import Any, TextIO

import numpy as np

WARM_UP = 3  # calls of a round that are not counted: another process has just used the processor's caches


def solve(peer: Any, targets: list[list[list[float]]]) -> dict[str, Any]:
    """Answers of one solver to (n, 4, 4) targets, and of each call the time and the processor time [s]."""
    poses = np.array(targets, dtype=np.float64)
    for pose in poses[:WARM_UP]:
        peer.solve(peer.prepare(pose))
    answers = []
    seconds = []
    processor = []
    gc.collect()
    gc.freeze()  # the libraries' objects need not be looked at again while calls are timed
    for pose in poses:
        prepared = peer.prepare(pose)
        used = time.process_time()
        begin = time.perf_counter()
        raw = peer.solve(prepared)
        seconds.append(time.perf_counter() - begin)
        processor.append(time.process_time() - used)
        answers.append(np.array(peer.answers(raw), dtype=np.float64))
    return {"answers": [q.tolist() for q in answers], "seconds": seconds, "processor": processor}


def serve(module: str, requests: TextIO, replies: TextIO) -> None:
    """Answer requests until the end of the input."""
    peer: Any = None
    for line in requests:
        request = json.loads(line)
        try:
            if request["do"] == "start":
                peer = importlib.import_module(module).Peer(request["setup"])
                reply: dict[str, Any] = {"version": peer.version}
            elif request["do"] == "forward":
                reply = {"poses": [np.asarray(peer.forward(np.array(q))).tolist() for q in request["q"]]}
            else:
                reply = solve(peer, request["targets"])
        except Exception as error:  # whatever a peer raises becomes a line of the report
            traceback.print_exc()
            reply = {"error": f"{type(error).__name__}: {error}"}
        replies.write(json.dumps(reply) + "\n")
        replies.flush()


def main() -> None:
    # What a library prints must not get between the replies: they go to a copy of stdout, prints go to stderr.
    with os.fdopen(os.dup(1), "w") as replies:
        os.dup2(2, 1)
        serve(sys.argv[1], sys.stdin, replies)


if __name__ == "__main__":
    main()
