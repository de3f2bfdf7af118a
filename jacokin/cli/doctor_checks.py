"""What `jacokin doctor` looks at. Packages are imported in a process of their own: a broken one may crash it."""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

OK = "ok"
MISSING = "missing"  # optional, and not there
WARNING = "warning"
FAILED = "FAILED"  # needed, and does not work

OLDEST_PYTHON = (3, 11)
PROBE_TIMEOUT = 120.0  # [s] for imports or one rendered picture on a slow machine

# Import name -> name of the distribution.
NEEDED = {
    "numpy": "numpy",
    "scipy": "scipy",
    "pinocchio": "pin",
    "mujoco": "mujoco",
    "mink": "mink",
    "numba": "numba",
    "qpsolvers": "qpsolvers",
    "daqp": "daqp",
    "quadprog": "quadprog",
    "osqp": "osqp",
    "yourdfpy": "yourdfpy",
    "typer": "typer",
    "rich": "rich",
}
# Import name -> distribution, extra of jacokin that brings it.
OPTIONAL = {
    "proxsuite": ("proxsuite", "proxqp"),
    "ruckig": ("ruckig", "motion"),
    "matplotlib": ("matplotlib", "plot"),
}

# Back end of MuJoCo's renderer -> what installs it on Debian and Ubuntu.
RENDERERS = {
    "egl": "apt install libegl1 libgl1-mesa-dri",
    "osmesa": "apt install libosmesa6",
    "glfw": "a display and libglfw3",
}

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

_RENDER_PROBE = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><light pos='0 0 2'/><geom size='1'/></worldbody></mujoco>")
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 32, 32) as renderer:
    renderer.update_scene(data)
    assert renderer.render().any()
"""


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


def all_findings() -> list[Finding]:
    """Every check, in the order shown."""
    return [python_version(), *packages(), shadows(), *qp_solvers(), *renderers(), kernel_cache(), robots()]


def python_version() -> Finding:
    """Is this Python new enough?"""
    state = OK if sys.version_info >= OLDEST_PYTHON else FAILED
    return Finding("python", "python", state, f"{platform.python_version()}, {sys.executable}")


def packages() -> list[Finding]:
    """Versions and places of the packages, as a fresh process imports them."""
    found = _import_in_child([*NEEDED, *OPTIONAL])
    findings = []
    for module, distribution in NEEDED.items():
        place, error = found.get(module, (None, "the process crashed while importing it"))
        version = _version(distribution)
        detail = f"{version}, {place}" if error is None else error
        findings.append(Finding("package", distribution, OK if error is None else FAILED, detail))
    for module, (distribution, extra) in OPTIONAL.items():
        place, error = found.get(module, (None, "the process crashed while importing it"))
        if error is None:
            findings.append(Finding("package", distribution, OK, f"{_version(distribution)}, {place}"))
        else:
            findings.append(Finding("package", distribution, MISSING, f"pip install 'jacokin[{extra}]'"))
    return findings


def shadows() -> Finding:
    """Does Python find a Pinocchio other than the one pip installed, such as that of a ROS installation?"""
    place = _import_in_child(["pinocchio"]).get("pinocchio", (None, None))[0]
    return shadow_of_pinocchio(place, _installed_pinocchio(), os.environ.get("PYTHONPATH", ""))


def shadow_of_pinocchio(place: str | None, installed: str | None, python_path: str) -> Finding:
    """As `shadows`, from the place it is imported from, the place pip put it, and PYTHONPATH."""
    name = "ROS and PYTHONPATH"
    if place is not None and installed is not None and Path(place).resolve() != Path(installed).resolve():
        return Finding(
            "environment",
            name,
            FAILED,
            f"pinocchio is imported from {place}, not from {installed}: unset PYTHONPATH or leave the ROS shell",
        )
    suspects = [entry for entry in python_path.split(os.pathsep) if "/opt/ros" in entry or "/ros" in entry.lower()]
    if suspects:
        return Finding("environment", name, WARNING, f"PYTHONPATH holds {', '.join(suspects)}: its packages come first")
    return Finding("environment", name, OK, "nothing shadows pinocchio")


def qp_solvers() -> list[Finding]:
    """What qpsolvers can use; daqp is needed."""
    probe = "import json, qpsolvers; print('\\n' + json.dumps(qpsolvers.available_solvers))"
    output, _ = _run(probe)
    try:
        names = json.loads(output.strip().splitlines()[-1])
    except (ValueError, IndexError):
        return [Finding("qp", "solvers", FAILED, "qpsolvers does not work, see above")]
    state = OK if "daqp" in names else FAILED
    return [Finding("qp", "solvers", state, ", ".join(sorted(names)) + ("" if state == OK else "; daqp is needed"))]


def renderers() -> list[Finding]:
    """Which back ends of MuJoCo can draw a picture here; none is needed for kinematics."""
    findings = []
    for backend, remedy in RENDERERS.items():
        if backend == "glfw" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            findings.append(Finding("rendering", backend, MISSING, "no display"))
            continue
        _, error = _run(_RENDER_PROBE, MUJOCO_GL=backend)
        detail = f"works with MUJOCO_GL={backend}" if error is None else f"{remedy} ({error})"
        findings.append(Finding("rendering", backend, OK if error is None else MISSING, detail))
    return findings


def kernel_cache() -> Finding:
    """Does the compiled closed form wait on disk?"""
    from jacokin.ik.closed_form import compilation

    folder = compilation.cache_folder()
    if folder is None:
        return Finding("closed form", "cache", WARNING, "no home folder to cache in: set NUMBA_CACHE_DIR to a folder")
    if compilation.is_cached():
        return Finding("closed form", "cache", OK, f"compiled, in {folder}")
    existing = next(parent for parent in (folder, *folder.parents) if parent.exists())
    if not os.access(existing, os.W_OK):
        detail = f"{existing} cannot be written, so each process compiles anew: set NUMBA_CACHE_DIR to another folder"
        return Finding("closed form", "cache", WARNING, detail)
    return Finding("closed form", "cache", MISSING, f"not compiled yet: `jacokin warmup` compiles it into {folder}")


def robots() -> Finding:
    """Are the bundled robots there?"""
    from jacokin.errors import JacokinError
    from jacokin.model import bundled

    try:
        from jacokin.model.loading import load_robot

        for name in bundled.NAMES:
            load_robot(name)
    except (JacokinError, ImportError, OSError) as error:
        return Finding("robots", "bundled", FAILED, f"{error}")
    return Finding("robots", "bundled", OK, f"{', '.join(bundled.NAMES)} in {bundled.urdf_folder()}")


def _import_in_child(modules: list[str]) -> dict[str, tuple[str | None, str | None]]:
    """Place and error of each module that was tried before the process ended."""
    output, _ = _run(_IMPORT_PROBE, *modules)
    found = {}
    for line in output.splitlines():
        if line.startswith('["'):
            name, place, error = json.loads(line)
            found[name] = (place, error)
    return found


def _run(program: str, *words: str, **environment: str) -> tuple[str, str | None]:
    """Output of a Python program in a process of its own, and the last line of its complaint if it failed."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", program, *words],
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


def _version(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "version unknown"


def _installed_pinocchio() -> str | None:
    """Where pip put Pinocchio's `__init__.py`."""
    try:
        files = importlib.metadata.files("pin") or []
    except importlib.metadata.PackageNotFoundError:
        return None
    for file in files:
        if file.parts[-2:] == ("pinocchio", "__init__.py"):
            return str(file.locate())
    return None
