"""`jacokin doctor`: is everything that is needed installed, and does it work?"""

from __future__ import annotations

import os
import platform
import sys

import click

from jacokin.cli import display, doctor_packages, options
from jacokin.cli.doctor_packages import FAILED, MISSING, OK, WARNING, Finding
from jacokin.cli.exit_codes import NOT_SOLVED


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
        _, error = doctor_packages.run(RENDER_PROBE, MUJOCO_GL=backend)
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
