"""`jacokin doctor`: does everything needed work? `jacokin warmup`: load the compiled kernels."""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import re
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from jacokin import model
from jacokin.cli import display, options
from jacokin.cli.command import command, switch
from jacokin.cli.process import NOT_SOLVED
from jacokin.errors import JacokinError, install_command
from jacokin.showing import has_display

OK = "ok"
MISSING = "missing"  # optional, and not there
WARNING = "warning"
FAILED = "FAILED"  # needed, and does not work

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
# Import name -> distribution, and the extra of jacokin that brings it; None where it is needed.
PACKAGES = {
    "numpy": ("numpy", None),
    "scipy": ("scipy", None),
    "pinocchio": ("pin", None),
    "mujoco": ("mujoco", None),
    "mink": ("mink", None),
    "qpsolvers": ("qpsolvers", None),
    "daqp": ("daqp", None),
    "orjson": ("orjson", None),
    "osqp": ("osqp", None),
    "yaml": ("PyYAML", None),
    "yourdfpy": ("yourdfpy", None),
    "click": ("click", None),
    "proxsuite": ("proxsuite", "proxqp"),
    "quadprog": ("quadprog", "quadprog"),
    "matplotlib": ("matplotlib", "plot"),
    "dm_env": ("dm-env", "tasks"),
    "gymnasium": ("gymnasium", "tasks"),
    "pyarrow": ("pyarrow", "parquet"),
    "distributed": ("distributed", "cluster"),
    "h5py": ("h5py", "data"),
    "imageio_ffmpeg": ("imageio-ffmpeg", "video"),
    "rosbags": ("rosbags", "logs"),
    "pyspacemouse": ("pyspacemouse", "spacemouse"),
    "viser": ("viser", "viewer"),
}
# Back end of MuJoCo's renderer -> what it needs, on Debian and Ubuntu.
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


@dataclass(frozen=True, slots=True)
class DoctorOptions:
    """How much is shown."""

    everything: bool = switch("--all", help="Every check, with versions and places.")
    json: bool = options.json()


@command()
def doctor(given: DoctorOptions) -> None:
    """Check the installation.

    What works, what does not and what to do, and which optional parts are there.

    Exit code: 0 when everything needed works, 1 otherwise.

    Examples:
      jacokin doctor
      jacokin doctor --all      versions and places of the packages, QP solvers, rendering
    """
    findings = check_all()
    well = not any(finding.state == FAILED for finding in findings)
    if given.json:
        display.print_json(
            {
                "ok": well,
                "findings": [asdict(finding) for finding in findings],
            }
        )
    else:
        shown = [finding for finding in findings if given.everything or finding.state in (FAILED, WARNING)]
        if shown:
            rows = [(finding.area, finding.name, finding.state, finding.detail) for finding in shown]
            display.show_table(None, ("area", "what", "state", "detail"), rows, text=4)
        display.say("Everything needed works." if well else "Something that is needed does not work, see FAILED above.")
        if not given.everything:
            show_optional(findings)
    if not well:
        raise SystemExit(NOT_SOLVED)


@command()
def warmup() -> None:
    """Load the compiled kernels, to see that they work here.

    They come with the package: nothing needs to be compiled, and no command waits for it.

    Exit code: 0 when they load, 2 when they do not.

    Examples:
      jacokin warmup
    """
    from jacokin.kernels import library  # not for --help: it loads NumPy

    seconds = library.warmup()
    display.echo(f"the compiled kernels are ready ({1e3 * seconds:.1f} ms)")


def show_optional(findings: list[Finding]) -> None:
    """Print which optional parts are there, and how to get the others."""
    optional = {distribution for distribution, extra in PACKAGES.values() if extra is not None}
    parts = [each for each in findings if each.area == "rendering" or each.name in optional]
    there = [each.name for each in parts if each.state in (OK, WARNING)]
    if there:
        display.say(f"Optional and there: {', '.join(there)}.")
    for each in parts:
        if each.state == MISSING:
            display.say(f"Optional and not there: {each.name}; {each.detail}")


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


def check_all() -> list[Finding]:
    """Every check, in the order shown."""
    return [
        check_python(),
        *check_packages(),
        check_shadowing(),
        *check_qp_solvers(),
        *check_renderers(),
        check_kernels(),
        check_robots(),
    ]


def check_python() -> Finding:
    """Is this Python new enough?"""
    state = OK if sys.version_info >= (3, 11) else FAILED
    return Finding("python", "python", state, f"{platform.python_version()}, {sys.executable}")


def check_robots() -> Finding:
    """Are the bundled robots there?"""
    try:
        for name in model.NAMES:
            model.load_robot(name)
    except (JacokinError, ImportError, OSError) as error:
        return Finding("robots", "bundled", FAILED, f"{error}")
    return Finding("robots", "bundled", OK, f"{', '.join(model.NAMES)} in {model.urdf_folder()}")


def check_packages() -> list[Finding]:
    """Versions and places of the packages, as a fresh process imports them."""
    found = import_modules(list(PACKAGES))
    requirements = _requirements()
    findings = []
    for module, (distribution, extra) in PACKAGES.items():
        place, error = found.get(module, (None, "the process crashed while importing it"))
        oldest = oldest_version(distribution, requirements)
        remedy = f"pip install '{distribution}>={oldest}'" if extra is None else install_command(extra)
        version = _installed_version(distribution)
        if error is not None and extra is None:
            state, detail = FAILED, error + _advice(module, error)
        elif error is not None:
            state, detail = MISSING, remedy
        elif oldest is not None and _numbers(version) < _numbers(oldest):
            state = FAILED if extra is None else WARNING
            detail = f"{version} is older than {oldest}, the oldest supported: {remedy}"
        else:
            state, detail = OK, f"{version}, {place}"
        findings.append(Finding("package", distribution, state, detail))
    return findings


def oldest_version(distribution: str, requirements: Iterable[str]) -> str | None:
    """The bound of a distribution in requirements such as "viser>=1.1; extra == 'viewer'"; None without one."""
    for requirement in requirements:
        match = re.match(rf"{re.escape(distribution)}\s*(?:\[[^\]]*\])?\s*>=\s*([0-9.]+)", requirement, re.IGNORECASE)
        if match:
            return match[1]
    return None


def _requirements() -> list[str]:
    try:
        return importlib.metadata.requires("jacokin") or []
    except importlib.metadata.PackageNotFoundError:  # run from a folder, never installed
        return []


def _numbers(version: str) -> tuple[int, ...]:
    """The leading numbers of a version, by which releases are ordered."""
    match = re.match(r"[0-9]+(?:\.[0-9]+)*", version)
    if match is None:
        return (sys.maxsize,)  # unknown: not judged
    numbers = [int(number) for number in match[0].split(".")]
    while numbers and numbers[-1] == 0:
        numbers.pop()
    return tuple(numbers)


def _advice(module: str, error: str) -> str:
    """What helps where MuJoCo does not load; mink loads it."""
    if module not in ("mujoco", "mink"):
        return ""
    backend = os.environ.get("MUJOCO_GL")
    if error.startswith(("ImportError", "ModuleNotFoundError")):
        # pip may remove mujoco-core, which shares its folder with mujoco, when it changes versions.
        return "; pip install --force-reinstall mujoco mujoco-core"
    return f"; MUJOCO_GL={backend} asks for a back end that is not there: unset it, or see below" if backend else ""


def check_shadowing() -> Finding:
    """Does Python find a Pinocchio other than the one pip installed, such as that of a ROS installation?"""
    place = import_modules(["pinocchio"]).get("pinocchio", (None, None))[0]
    return find_shadow(place, _installed_pinocchio(), os.environ.get("PYTHONPATH", ""))


def find_shadow(place: str | None, installed: str | None, python_path: str) -> Finding:
    """`check_shadowing` for a place it is imported from, the place where pip put it, and a PYTHONPATH."""
    finding = partial(Finding, "environment", "ROS and PYTHONPATH")
    if place is not None and installed is not None and Path(place).resolve() != Path(installed).resolve():
        return finding(
            FAILED, f"pinocchio is imported from {place}, not from {installed}: unset PYTHONPATH or leave the ROS shell"
        )
    suspects = [entry for entry in python_path.split(os.pathsep) if "/opt/ros" in entry or "/ros" in entry.lower()]
    if suspects:
        return finding(WARNING, f"PYTHONPATH holds {', '.join(suspects)}: its packages come first")
    return finding(OK, "nothing shadows pinocchio")


def check_qp_solvers() -> list[Finding]:
    """What qpsolvers can use; daqp is needed."""
    probe = "import json, qpsolvers; print('\\n' + json.dumps(qpsolvers.available_solvers))"
    output, _ = run_python(probe)
    try:
        names = json.loads(output.strip().splitlines()[-1])
    except (ValueError, IndexError):
        return [Finding("qp", "solvers", FAILED, "qpsolvers does not work, see above")]
    state = OK if "daqp" in names else FAILED
    return [Finding("qp", "solvers", state, ", ".join(sorted(names)) + ("" if state == OK else "; daqp is needed"))]


def _installed_version(distribution: str) -> str:
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


def check_renderers() -> list[Finding]:
    """Which back ends of MuJoCo can draw a picture here; none is needed for kinematics."""
    findings = []
    for backend, remedy in RENDERERS.items():
        if backend == "glfw" and not has_display():
            findings.append(Finding("rendering", backend, MISSING, "no display"))
            continue
        _, error = run_python(RENDER_PROBE, MUJOCO_GL=backend)
        detail = f"works with MUJOCO_GL={backend}" if error is None else f"{remedy}; now {error}"
        findings.append(Finding("rendering", backend, OK if error is None else MISSING, detail))
    return findings


def check_kernels() -> Finding:
    """Do the compiled kernels load?"""
    finding = partial(Finding, "closed form", "kernels")
    try:
        from jacokin.kernels import library

        library.load()
    except (JacokinError, ImportError) as error:
        return finding(FAILED, f"{error}")
    return finding(OK, f"loaded, {library.PATH}")


def import_modules(modules: list[str]) -> dict[str, tuple[str | None, str | None]]:
    """Import modules in a process of their own; returns place and error of each, as far as the process came."""
    output, _ = run_python(_IMPORT_PROBE, *modules)
    found = {}
    for line in output.splitlines():
        if line.startswith('["'):
            name, place, error = json.loads(line)
            found[name] = (place, error)
    return found


def run_python(program: str, *words: str, **environment: str) -> tuple[str, str | None]:
    """Run a Python program in a process of its own; returns its output, and the last line on stderr if it failed.

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
