"""Check what would be uploaded, in fresh environments: python -m release_check FOLDER. Uploads nothing.

FOLDER holds one sdist and the wheels of all machines. Beside them it writes, for those who install:

requirements-3.11.txt   what jacokin needs, with hashes, for `pip install --require-hashes -r`; one for each Python
sbom.cdx.json           the same as a bill of materials (CycloneDX), with licences
SHA256SUMS              of all these files, for `sha256sum --check`
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path
from typing import Any

from packaging.tags import sys_tags
from packaging.utils import parse_wheel_filename

ROOT = Path(__file__).parent
PYTHONS = ("3.11", "3.12", "3.13")
UPLOADED = (
    "manylinux_",
    "musllinux_",
    "macosx_",
)  # an index refuses wheels that are bound to the machine they come from
#: Of packages whose metadata says none in a form that is understood, as read in the licence files that they ship.
READ = {"cmeel-qhull": "Qhull", "embreex": "BSD-2-Clause", "pycollada": "BSD-3-Clause", "vhacdx": "MIT"}
SMOKE = """
import jacokin
robot = jacokin.load_robot()
result = jacokin.solve_ik(jacokin.pose([0.3, -0.2, 0.4], down=True), robot)
assert result.success and robot.within_limits(result.q), result
motion = jacokin.plan_motion(jacokin.IKSolver(robot), robot.home, result.q)
assert motion.success, motion
"""


class ReleaseError(Exception):
    """What would be uploaded is not fit for it."""


def main(folder: Path) -> None:
    """Check a folder.

    Raises:
        ReleaseError: says what is wrong.
    """
    sdist = one(folder, "*.tar.gz")
    wheels = sorted(folder.glob("*.whl"))
    for each in wheels:
        check_contents(each, sdist)
    wheel = fitting(wheels)
    tried = []
    for version in PYTHONS:
        program = interpreter(version)
        if program is None:
            print(f"Python {version}: untried, there is none here")
            continue
        python = folder / f"python-{version}" / "bin" / "python"
        subprocess.run([program, "-m", "venv", "--clear", "--without-pip", str(python.parents[1])], check=True)
        requirements = folder / f"requirements-{version}.txt"
        requirements.write_text(locked(wheel, python), encoding="utf-8")
        pip(python, "install", "--quiet", "--require-hashes", "--no-deps", "-r", str(requirements))
        pip(python, "install", "--quiet", "--no-deps", str(wheel))
        subprocess.run([python, "-P", "-c", SMOKE], check=True, cwd=folder)
        print(f"Python {version}: installed with hashes, solves and plans")
        tried.append(python)
    if not tried:
        raise ReleaseError(f"none of Python {', '.join(PYTHONS)} is here")
    bill = folder / "sbom.cdx.json"
    words = ("environment", "--output-reproducible", "--pyproject", str(ROOT / "pyproject.toml"))
    subprocess.run([sys.executable, "-m", "cyclonedx_py", *words, "-o", str(bill), str(tried[0])], check=True)
    content = json.loads(bill.read_text(encoding="utf-8"))
    for name, licence in licences(content).items():
        print(f"  {name}: {licence}")
    bill.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    sums = [f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.name}\n" for file in written(folder)]
    (folder / "SHA256SUMS").write_text("".join(sums), encoding="utf-8")


def one(folder: Path, pattern: str) -> Path:
    """The file of a folder that matches.

    Raises:
        ReleaseError: there is none, or several.
    """
    found = sorted(folder.glob(pattern))
    if len(found) != 1:
        raise ReleaseError(f"{folder} must hold one {pattern}, found {len(found)}")
    return found[0].resolve()


def fitting(wheels: list[Path]) -> Path:
    """The wheel that this machine installs.

    Raises:
        ReleaseError: there is none, or several.
    """
    tags = set(sys_tags())
    found = [wheel for wheel in wheels if tags & parse_wheel_filename(wheel.name)[3]]
    if len(found) != 1:
        raise ReleaseError(f"one wheel must fit this machine, found {len(found)}")
    return found[0].resolve()


def check_contents(wheel: Path, sdist: Path) -> None:
    """See that the wheel may be uploaded, and that both hold the licence and what it is made from.

    Raises:
        ReleaseError: says what is missing.
    """
    platform = wheel.stem.rpartition("-")[2]
    if not platform.startswith(UPLOADED):
        raise ReleaseError(f"{wheel.name}: {platform} is refused by an index; link with zig, as CONTRIBUTING.md says")
    with zipfile.ZipFile(wheel) as packed:
        names = packed.namelist()
    with tarfile.open(sdist) as archive:
        sources = [name.partition("/")[2] for name in archive.getnames()]
    for wanted in ("licenses/LICENSE", "licenses/NOTICE", "jacokin/urdf/j2n6s300.urdf", "jacokin/py.typed"):
        if not any(name.endswith(wanted) for name in names):
            raise ReleaseError(f"{wheel.name} lacks {wanted}")
    if not any("jacokin/kernels/libjacokin." in name for name in names):
        raise ReleaseError(f"{wheel.name} lacks the compiled kernels")
    for wanted in ("LICENSE", "NOTICE", "build_kernels/hook.py", "constraints.txt", "tests/conftest.py"):
        if wanted not in sources:
            raise ReleaseError(f"{sdist.name} lacks {wanted}")


def interpreter(version: str) -> str | None:
    """The command of a Python of this version that runs here, or None."""
    candidates = [sys.executable] if sys.version_info[:2] == tuple(map(int, version.split("."))) else []
    if (found := shutil.which(f"python{version}")) is not None:
        candidates.append(found)
    for program in candidates:
        if subprocess.run([program, "-c", ""], capture_output=True, check=False).returncode == 0:
            return program
    return None


def pip(python: Path, *words: str) -> str:
    """What pip of this environment prints when it works on another one."""
    command = [sys.executable, "-m", "pip", "--python", str(python), "--disable-pip-version-check", *words]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def locked(wheel: Path, python: Path) -> str:
    """The versions of `constraints.txt` that the wheel needs, with the hash of the file that fits this Python.

    Raises:
        ReleaseError: an index gives no hash.
    """
    constraints = ("--constraint", str(ROOT / "constraints.txt"))
    report = json.loads(pip(python, "install", "--quiet", "--dry-run", "--report", "-", *constraints, str(wheel)))
    lines = []
    for each in report["install"]:
        name, version = each["metadata"]["name"], each["metadata"]["version"]
        if name == "jacokin":
            continue
        hashes = each["download_info"].get("archive_info", {}).get("hashes", {})
        if "sha256" not in hashes:
            raise ReleaseError(f"{name} {version} has no hash")
        lines.append(f"{name}=={version} --hash=sha256:{hashes['sha256']}\n")
    return "".join(sorted(lines, key=str.lower))


def licences(bill: dict[str, Any]) -> dict[str, str]:  # Any: JSON
    """The licence of every component of a bill of materials by its name and version; those of `READ` are filled in.

    Raises:
        ReleaseError: a component does not say its licence.
    """
    found = {}
    for component in bill["components"]:
        said = []
        if not component.get("licenses") and component["name"] in READ:
            component["licenses"] = [{"license": {"id": READ[component["name"]]}}]
        for entry in component.get("licenses", []):
            licence = entry.get("license", {})
            said.append(entry.get("expression") or licence.get("id") or licence.get("name", ""))
        name = f"{component['name']} {component.get('version', '')}"
        if not any(said):
            raise ReleaseError(f"{name} does not say its licence")
        found[name] = ", ".join(dict.fromkeys(filter(None, said)))
    return found


def written(folder: Path) -> list[Path]:
    """The files that are handed out, in order."""
    patterns = ("*.whl", "*.tar.gz", "requirements-*.txt", "sbom.cdx.json")
    return sorted(file for pattern in patterns for file in folder.glob(pattern))


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]).resolve())
    except ReleaseError as error:
        sys.exit(f"release_check: {error}")
