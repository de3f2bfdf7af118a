"""`jacokin demo`: every branch of a pose, a motion around a crate, drawn, and advice where there is no answer."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from jacokin import files, ik, model, motion
from jacokin.cli.command import command, option
from jacokin.cli.display import say, show_table
from jacokin.cli.doctor import RENDERERS
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    from jacokin.arrays import Array

PICTURE = Path("jaco.png")
BACKENDS = ("egl", "osmesa")  # of MuJoCo, that need no display
CRATE = (0.25, 0.12, 0.35)  # [m] stands on the floor between the ends of the motion
CRATE_AT = (0.42, -0.02, 0.175)  # [m]
CLEAR = 0.01  # [m] kept from the crate


@dataclass(frozen=True, slots=True)
class DemoOptions:
    """Where the picture goes."""

    output: Path = option("--output", default=PICTURE, metavar="FILE.png", help="Where the picture goes.")


@command()
def demo(given: DemoOptions) -> None:
    """Show what the arm can do: every way to a pose, a way around a crate, and advice where there is none.

    Draws the motion around the crate, which needs EGL or OSMesa.

    Examples:
      jacokin demo
      jacokin demo --output out/jaco.png
    """
    if given.output.suffix != ".png":
        raise InvalidInputError(f"--output must end in .png, got {str(given.output)!r}")
    robot = model.load_robot()
    show_branches(robot)
    way = show_motion(robot)
    show_advice(robot)
    show_batch(robot)
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / PICTURE
        drawn = _draw(way, picture)
        if drawn is not None:
            given.output.parent.mkdir(parents=True, exist_ok=True)
            with files.replacing(given.output) as replacement:
                shutil.copyfile(picture, replacement)
    if drawn is None:
        remedies = ", or: ".join(RENDERERS[backend] for backend in BACKENDS)
        say(f"No picture: MuJoCo found neither EGL nor OSMesa. On Debian and Ubuntu: {remedies}")
    else:
        say(f"Picture of the motion: {given.output.resolve()}")


def show_branches(robot: model.Robot) -> None:
    """Every configuration that reaches a pose."""
    import numpy as np

    # With the tool pointing along x here, every second branch breaks a limit or touches.
    target = model.pose((0.25, 0.15, 0.35), rpy=(0.0, np.pi / 2.0, 0.0))  # [m], [rad]
    solver = ik.IKSolver(robot, collision="ignore")
    seconds = []
    for _ in range(100):
        started = time.perf_counter()
        solver.solve_all(target)
        seconds.append(time.perf_counter() - started)
    branches = ik.IKSolver(robot, collision="report").solve_all(target)
    rows = []
    for q, within, pairs in zip(branches.q, branches.within_limits, branches.touching or (), strict=True):
        verdict = "outside the limits" if not within else f"touches: {' and '.join(pairs[0])}" if pairs else "free"
        rows.append((verdict, *(f"{angle:.1f}" for angle in np.degrees(q))))
    say(f"1. Every way to reach one pose: {len(branches)} branches, in {1e6 * np.median(seconds):.0f} us")
    show_table(None, ("angles in degrees", *robot.joint_names), rows)


def show_motion(robot: model.Robot) -> Array:
    """A motion from one side of a crate to the other; returns its rows (n, 6) [rad]."""
    import numpy as np

    scene = model.Scene([model.Floor(0.0), model.Box("crate", CRATE, CRATE_AT)])
    solver = ik.IKSolver(robot, scene=scene, clearance=CLEAR)
    start, goal = (model.pose([0.42, y, 0.12], down=True) for y in (0.28, -0.30))  # [m]
    q = solver.solve(start).raise_for_status().q
    started = time.perf_counter()
    way = motion.plan_motion(solver, q, goal)
    seconds = time.perf_counter() - started
    straight = robot.clearance(np.linspace(q, way.q[-1], 200), scene)
    say("2. From one side of a crate to the other")
    say(f"   straight there, the arm would be {-1e3 * np.min(straight):.0f} mm deep in it")
    say(f"   around it: {way.duration:.1f} s, {1e3 * np.min(way.clearance):.0f} mm clear, found in {seconds:.3f} s")
    say("")
    return way.q


def show_advice(robot: model.Robot) -> None:
    """What is said of a pose that cannot be reached."""
    import numpy as np

    result = ik.IKSolver(robot).solve(model.pose((0.9, 0.0, 0.5), down=True))  # [m], too far away
    away = f"{1e3 * result.position_error:.0f} mm and {np.degrees(result.orientation_error):.0f} degrees away"
    say(f"3. Where there is no answer: {result.status.name}")
    say(f"   {result.status.value}")
    say(f"   the closest configuration within the limits is {away}")
    say("")


def show_batch(robot: model.Robot) -> None:
    """How many of the example poses are solved."""
    targets = ik.read_targets(targets_file())
    solver = ik.IKSolver(robot)
    started = time.perf_counter()
    batch = solver.solve_batch(targets.targets, closest=False)
    seconds = time.perf_counter() - started
    worst = batch.position_error[batch.success].max()
    say(f"4. {int(batch.success.sum())} of {len(batch)} example poses solved in {seconds:.3f} s, to {worst:.0e} m")
    say("   the others are out of reach: `jacokin ik --targets` says so row by row")
    say("")


def targets_file() -> Path:
    """The example targets: in the package, or in a clone beside it."""
    packed = Path(__file__).with_name("targets.csv")
    return packed if packed.is_file() else Path(__file__).resolve().parents[2] / "examples" / "targets.csv"


def _draw(way: Array, picture: Path) -> str | None:
    """Draw in a process of its own: MuJoCo chooses its back end when imported. Returns the one that worked."""
    import numpy as np

    shown = picture.with_name("shown.npz")
    # The last one, and five before it that are seen through.
    some = np.linspace(0, len(way) - 1, 6).round().astype(int)
    np.savez(shown, q=way[some[::-1]], size=CRATE, position=CRATE_AT)
    words = [sys.executable, "-P", "-m", "jacokin.cli.picture", str(picture), str(shown)]
    for backend in BACKENDS:
        done = subprocess.run(words, env={**os.environ, "MUJOCO_GL": backend}, capture_output=True, check=False)
        if done.returncode == 0:
            return backend
    return None
