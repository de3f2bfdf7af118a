"""Frames of the documentation's playground while the tool is dragged, in Chromium, drawn by the processor.

python -m benchmarks.playground [--seconds 5] [--width 1280]

The tool is dragged by the pointer along an ellipse. Times from frame to frame are the browser's; those of the page are
of its main thread alone, in frames with new texts, and those of the solver of its worker. At 60 frames a second a frame
has 16.7 ms. Processor time is that of all of the browser's processes: it counts where other work runs on the machine.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import report
from tests.docs.playground_page import HANDLE, build, show
from tests.viewer.chromium import Tab, browsing

CASES = {
    "six joints": "#robot=j2n6s300",
    "a free axis": "#robot=j2n6s300&free=z",
    "seven joints": "#robot=j2s7s300",
    "seven joints, any structure": "#robot=gen3",
}
TURN = 2.0  # [s] of the ellipse
HALF_AXES = np.array([90.0, 50.0])  # [pixel]
RECORD = """globalThis.told = { frames: [], page: [], solver: [], drawn: 0 };
(() => {
  const page = jacokinPlayground;
  const { stage, handles, worker } = page;
  const draw = stage.draw.bind(stage);
  let begun = 0;
  stage.draw = (...all) => (told.drawn++, (begun = performance.now()), draw(...all));
  const show = page.panel.showPose.bind(page.panel);
  page.panel.showPose = (pose) => (show(pose), told.page.push(performance.now() - begun));
  worker.addEventListener("message", ({ data }) => told.solver.push(data.milliseconds));
  let last = performance.now();
  const frame = (now) => (told.frames.push(now - last), (last = now), requestAnimationFrame(frame));
  requestAnimationFrame(frame);
})()"""


def processor_time(folder: str) -> float:
    """[ms] of the browser whose files are in a folder, and of its processes, so far."""
    numbers = [int(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()]
    parents: dict[int, int] = {}
    ticks: dict[int, int] = {}
    wanted: set[int] = set()
    for number in sorted(numbers):
        try:
            fields = Path(f"/proc/{number}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
            words = Path(f"/proc/{number}/cmdline").read_text(encoding="utf-8", errors="replace")
        except OSError:
            continue  # it has ended
        parents[number], ticks[number] = int(fields[1]), int(fields[11]) + int(fields[12])
        if folder in words and "chrom" in words:
            wanted.add(number)
    while more := {number for number, parent in parents.items() if parent in wanted} - wanted:
        wanted |= more
    return 1e3 * sum(ticks[number] for number in wanted) / os.sysconf("SC_CLK_TCK")


def measure(tab: Tab, folder: str, seconds: float) -> dict[str, Any]:
    """Drag the dot for some seconds; times [ms], the first half second left out."""
    start = np.array(tab.value(HANDLE), dtype=float)[0]
    tab.ask("Input.dispatchMouseEvent", type="mouseMoved", x=start[0], y=start[1])
    tab.ask("Input.dispatchMouseEvent", type="mousePressed", x=start[0], y=start[1], button="left", clickCount=1)
    begun = time.monotonic()
    recording, used = False, 0.0
    while (now := time.monotonic() - begun) < seconds + 0.5:
        if now > 0.5 and not recording:
            tab.value(RECORD)
            used = processor_time(folder)
            recording = True
        angle = 2.0 * math.pi * now / TURN
        x, y = start + HALF_AXES * np.array([math.sin(angle), 1.0 - math.cos(angle)])
        tab.ask("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, button="left")
    told: dict[str, Any] = json.loads(str(tab.value("JSON.stringify(told)")))
    told["processor"] = (processor_time(folder) - used) / max(told["drawn"], 1)
    told["sharpness"] = tab.value("jacokinPlayground.stage.canvas.width / jacokinPlayground.panel.canvas.clientWidth")
    tab.ask("Input.dispatchMouseEvent", type="mouseReleased", x=x, y=y, button="left", clickCount=1)
    return told


def main() -> None:
    """Measure every case and print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--width", type=int, default=1280)
    options = parser.parse_args()
    print(report.machine())
    print("| case | frame, median [ms] | 95 % | frames in time | page | solver | processor, a frame | pixels |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as name, browsing("about:blank", Path(name) / "chromium", smooth=True) as tab:
        site = Path(name) / "site"
        site.mkdir()
        build(site)
        for case, state in CASES.items():
            show(tab, site, state, options.width)
            told = measure(tab, name, options.seconds)
            frames = np.array(told["frames"])
            numbers = [f"{np.median(frames):.1f}", f"{np.percentile(frames, 95):.1f}", f"{np.mean(frames < 18.0):.0%}"]
            numbers += [f"{np.median(told[which]):.1f}" for which in ("page", "solver")]
            numbers.append(f"{told['processor']:.0f}")
            print(f"| {case} | {' | '.join(numbers)} | {told['sharpness']:.0%} |", flush=True)


if __name__ == "__main__":
    main()
