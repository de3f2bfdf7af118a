"""`jacokin doctor`: is everything that is needed installed, and does it work?"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from dataclasses import dataclass

import click

from jacokin.cli import display, doctor_packages, options
from jacokin.cli.entry import NOT_SOLVED


def doctor(json: options.JsonOption = False) -> None:
    """Check the installation.

    Versions and places of the packages, QP solvers, shadowed packages, rendering, cache of the kernels.

    Exit code: 0 when everything needed works, 1 otherwise.

    Examples:
      jacokin doctor
    """
    findings = all_findings()
    well = not any(finding.state == FAILED for finding in findings)
    if json:
        display.print_json(
            {
                "ok": well,
                "findings": [
                    {"area": finding.area, "name": finding.name, "state": finding.state, "detail": finding.detail}
                    for finding in findings
                ],
            }
        )
    else:
        rows = [(finding.area, finding.name, finding.state, finding.detail) for finding in findings]
        display.say(display.table(None, ("area", "what", "state", "detail"), rows, text=4))
        display.say("Everything needed works." if well else "Something that is needed does not work, see FAILED above.")
    if not well:
        raise SystemExit(NOT_SOLVED)


OK = "ok"
MISSING = "missing"  # optional, and not there
WARNING = "warning"
FAILED = "FAILED"  # needed, and does not work


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report.

    Attributes:
        area: heading.
        name: what was looked at.
        state: one of the constants above.
        detail: version and place, or what is wrong and what to do.
    """

    area: str
    name: str
    state: str
    detail: str


def kernel_cache() -> Finding:
    """Does the compiled closed form wait on disk, and does it load?"""
    state, detail = _state()
    return Finding("closed form", "cache", state, detail)


def _state() -> tuple[str, str]:
    from jacokin.kernels.compiled import cache, loading
    from jacokin.kernels.compiled.library import KernelLibrary

    if loading.is_disabled():
        return WARNING, loading.DISABLED
    file = cache.path()
    if file is None:
        return WARNING, "no home folder to cache in: set NUMBA_CACHE_DIR to a folder of your own"
    found = cache.read()
    if found.code is not None:
        try:
            KernelLibrary(found.code)
        except RuntimeError as error:
            return WARNING, f"{file} does not load: {error}; `jacokin warmup` compiles it anew"
        return OK, f"compiled, in {file}"
    if found.problem:
        return WARNING, found.problem
    existing = next(parent for parent in file.parents if parent.exists())
    if not os.access(existing, os.W_OK):
        return WARNING, (
            f"{file.parent} cannot be written, so each process compiles anew: "
            "set NUMBA_CACHE_DIR to a folder of your own"
        )
    return MISSING, f"not compiled yet: `jacokin warmup` compiles it into {file.parent}"


PROBE_TIMEOUT = 120.0  # [s] for imports or one rendered picture on a slow machine

# One line of JSON for each module, written as it goes: after a crash the first one missing is at fault.
_IMPORT_PROBE = """
import importlib, json, sys
for name in sys.argv[1:]:
    try:
        module = importlib.import_module(name)
        line = [name, getattr(module, "__file__", None), None]
    except BaseException as error:
        line = [name, None, f"{type(error).__name__}: {error}"]
    print("\\n" + json.dumps(line), flush=True)
"""


def imported(modules: list[str]) -> dict[str, tuple[str | None, str | None]]:
    """Place and error of each module that was tried before the process ended."""
    output, _ = run(_IMPORT_PROBE, *modules)
    found = {}
    for line in output.splitlines():
        if line.startswith('["'):
            name, place, error = json.loads(line)
            found[name] = (place, error)
    return found


def run(program: str, *words: str, **environment: str) -> tuple[str, str | None]:
    """Output of a Python program in a process of its own, and the last line of its complaint if it failed.

    The current folder is not searched for modules.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", program, *words],
            env={**os.environ, **environment},
            capture_output=True,
            text=True,
            timeout=PROBE_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "", f"no answer within {PROBE_TIMEOUT:.0f} s"
    if done.returncode == 0:
        return done.stdout, None
    lines = done.stderr.strip().splitlines()
    return done.stdout, lines[-1] if lines else f"ended with code {done.returncode}"


# Back end of MuJoCo's renderer -> what installs it on Debian and Ubuntu.
RENDERERS = {
    "egl": "apt install libegl1 libgl1-mesa-dri",
    "osmesa": "apt install libosmesa6",
    "glfw": "a display and libglfw3",
}

RENDER_PROBE = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><light pos='0 0 2'/><geom size='1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 32, 32) as renderer:
    renderer.update_scene(data)
    assert renderer.render().any()
"""


def renderers() -> list[Finding]:
    """Which back ends of MuJoCo can draw a picture here; none is needed for kinematics."""
    findings = []
    for backend, remedy in RENDERERS.items():
        if backend == "glfw" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            findings.append(Finding("rendering", backend, MISSING, "no display"))
            continue
        _, error = run(RENDER_PROBE, MUJOCO_GL=backend)
        detail = f"works with MUJOCO_GL={backend}" if error is None else f"{remedy} ({error})"
        findings.append(Finding("rendering", backend, OK if error is None else MISSING, detail))
    return findings


OLDEST_PYTHON = (3, 11)


def all_findings() -> list[Finding]:
    """Every check, in the order shown."""
    return [
        python_version(),
        *doctor_packages.packages(),
        doctor_packages.shadows(),
        *doctor_packages.qp_solvers(),
        *renderers(),
        kernel_cache(),
        robots(),
    ]


def python_version() -> Finding:
    """Is this Python new enough?"""
    state = OK if sys.version_info >= OLDEST_PYTHON else FAILED
    return Finding("python", "python", state, f"{platform.python_version()}, {sys.executable}")


def robots() -> Finding:
    """Are the bundled robots there?"""
    from jacokin.errors import JacokinError
    from jacokin.model.descriptions import bundled

    try:
        from jacokin.model.loading import load_robot

        for name in bundled.NAMES:
            load_robot(name)
    except (JacokinError, ImportError, OSError) as error:
        return Finding("robots", "bundled", FAILED, f"{error}")
    return Finding("robots", "bundled", OK, f"{', '.join(bundled.NAMES)} in {bundled.urdf_folder()}")


NOT_COMPILED = 1  # exit code


def warmup() -> None:
    """Compile the closed form ahead of the first solve.

    The machine code goes into a cache on disk, so that no later command waits for the compiler.

    Exit code: 0 when the compiled closed form is ready, 1 when NUMBA_DISABLE_JIT keeps it in plain Python.

    Examples:
      jacokin warmup
    """
    from jacokin.kernels.compiled import loading

    seconds = loading.warmup()
    if loading.is_disabled():
        raise SystemExit(NOT_COMPILED)
    click.echo(f"the closed form is ready ({seconds:.1f} s)")
