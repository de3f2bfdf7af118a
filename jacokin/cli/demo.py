"""`jacokin demo`: solve the example targets, and draw the arm at one of the answers."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from jacokin import files, ik, model
from jacokin.cli import options
from jacokin.cli.command import Command
from jacokin.cli.display import say
from jacokin.cli.doctor import RENDERERS
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    from jacokin.arrays import Array

PICTURE = Path("jaco.png")
BACKENDS = ("egl", "osmesa")  # of MuJoCo, that need no display


@click.command(cls=Command)
@click.option("--output", type=options.FILE, default=PICTURE, metavar="FILE.png", help="Where the picture goes.")
def demo(output: Path) -> None:
    """Solve 206 example poses and draw the arm.

    Says why six of the poses cannot be reached, and how near the arm comes to them. The picture needs EGL or OSMesa.

    Examples:
      jacokin demo
      jacokin demo --output out/jaco.png
    """
    import numpy as np

    if output.suffix != ".png":
        raise InvalidInputError(f"--output must end in .png, got {str(output)!r}")
    targets = ik.read_targets(targets_file())
    solver = ik.IKSolver(model.load_robot())
    started = time.perf_counter()
    batch = solver.solve_batch(targets.targets)
    _report(targets, batch, time.perf_counter() - started)
    distance = np.linalg.norm(batch.q - solver.robot.home, axis=1)
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / PICTURE
        drawn = _draw(batch.q[np.argmin(np.where(batch.success, distance, np.inf))], picture)
        if drawn is not None:
            output.parent.mkdir(parents=True, exist_ok=True)
            with files.replacing(output) as replacement:
                shutil.copyfile(picture, replacement)
    if drawn is None:
        remedies = ", or: ".join(RENDERERS[backend] for backend in BACKENDS)
        say(f"no picture: MuJoCo found neither EGL nor OSMesa. On Debian and Ubuntu: {remedies}")
    else:
        say(f"picture of the arm at an answer: {output} (drawn with {drawn})")


def targets_file() -> Path:
    """The example targets: in the package, or in a clone beside it."""
    packed = Path(__file__).with_name("targets.csv")
    return packed if packed.is_file() else Path(__file__).resolve().parents[2] / "examples" / "targets.csv"


def _report(targets: ik.TargetFile, batch: ik.BatchResult, seconds: float) -> None:
    import numpy as np

    solved = int(batch.success.sum())
    say(f"{solved} of {len(batch)} targets solved ({100 * solved / len(batch):.1f} %) in {seconds:.2f} s")
    say(f"worst position error     {batch.position_error[batch.success].max():.1e} m")
    say(f"worst orientation error  {batch.orientation_error[batch.success].max():.1e} rad")
    for row in np.flatnonzero(~batch.success):
        say(f"line {targets.lines[row]} is not solved: {batch.status[row].name}: {batch.message[row]}")
        away = f"{batch.position_error[row]:.4f} m and {np.degrees(batch.orientation_error[row]):.2f} deg"
        say(f"    the closest configuration within the limits is {away} away")


def _draw(q: Array, picture: Path) -> str | None:
    """Draw in a process of its own: MuJoCo chooses its back end when imported. Returns the one that worked."""
    module = "jacokin.cli.picture"
    words = [sys.executable, "-P", "-m", module, str(picture), *(repr(float(angle)) for angle in q)]
    for backend in BACKENDS:
        done = subprocess.run(words, env={**os.environ, "MUJOCO_GL": backend}, capture_output=True, check=False)
        if done.returncode == 0:
            return backend
    return None
