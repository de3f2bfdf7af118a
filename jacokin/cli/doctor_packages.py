"""Are the packages installed, and are they the ones pip installed?"""

from __future__ import annotations

import importlib.metadata
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

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

# Import name -> name of the distribution.
NEEDED = {
    "numpy": "numpy",
    "scipy": "scipy",
    "pinocchio": "pin",
    "mujoco": "mujoco",
    "mink": "mink",
    "numba": "numba",
    "llvmlite": "llvmlite",
    "qpsolvers": "qpsolvers",
    "daqp": "daqp",
    "orjson": "orjson",
    "osqp": "osqp",
    "yaml": "PyYAML",
    "yourdfpy": "yourdfpy",
    "click": "click",
}
# Import name -> distribution, extra of jacokin that brings it.
OPTIONAL = {
    "proxsuite": ("proxsuite", "proxqp"),
    "quadprog": ("quadprog", "quadprog"),
    "ruckig": ("ruckig", "motion"),
    "matplotlib": ("matplotlib", "plot"),
    "dm_env": ("dm-env", "tasks"),
    "gymnasium": ("gymnasium", "tasks"),
    "pyarrow": ("pyarrow", "parquet"),
    "distributed": ("distributed", "cluster"),
    "imageio_ffmpeg": ("imageio-ffmpeg", "video"),
    "viser": ("viser", "viewer"),
}


def packages() -> list[Finding]:
    """Versions and places of the packages, as a fresh process imports them."""
    found = imported([*NEEDED, *OPTIONAL])
    findings = []
    for module, distribution in NEEDED.items():
        place, error = found.get(module, (None, "the process crashed while importing it"))
        if error is None:
            findings.append(_present(distribution, place, FAILED, f"pip install '{_requirement(distribution)}'"))
        else:
            findings.append(Finding("package", distribution, FAILED, error + _advice(module, error)))
    for module, (distribution, extra) in OPTIONAL.items():
        place, error = found.get(module, (None, "the process crashed while importing it"))
        if error is None:
            findings.append(_present(distribution, place, WARNING, f"pip install 'jacokin[{extra}]'"))
        else:
            findings.append(Finding("package", distribution, MISSING, f"pip install 'jacokin[{extra}]'"))
    return findings


def _present(distribution: str, place: str | None, too_old: str, remedy: str) -> Finding:
    """A package that can be imported, held against the oldest version that jacokin supports."""
    version, oldest = _version(distribution), oldest_version(distribution, _requirements())
    if oldest is not None and _numbers(version) < _numbers(oldest):
        return Finding(
            "package", distribution, too_old, f"{version} is older than {oldest}, the oldest supported: {remedy}"
        )
    return Finding("package", distribution, OK, f"{version}, {place}")


def oldest_version(distribution: str, requirements: Iterable[str]) -> str | None:
    """The bound of a distribution in requirements such as "viser>=1.1; extra == 'viewer'"; None without one."""
    for requirement in requirements:
        match = re.match(rf"{re.escape(distribution)}\s*(?:\[[^\]]*\])?\s*>=\s*([0-9.]+)", requirement, re.IGNORECASE)
        if match:
            return match[1]
    return None


def _requirement(distribution: str) -> str:
    return f"{distribution}>={oldest_version(distribution, _requirements())}"


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


def shadows() -> Finding:
    """Does Python find a Pinocchio other than the one pip installed, such as that of a ROS installation?"""
    place = imported(["pinocchio"]).get("pinocchio", (None, None))[0]
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
    output, _ = run(probe)
    try:
        names = json.loads(output.strip().splitlines()[-1])
    except (ValueError, IndexError):
        return [Finding("qp", "solvers", FAILED, "qpsolvers does not work, see above")]
    state = OK if "daqp" in names else FAILED
    return [Finding("qp", "solvers", state, ", ".join(sorted(names)) + ("" if state == OK else "; daqp is needed"))]


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
