"""`export_c`: a solver for the C library: its file, header, library and CMake package in one folder.

``jacokin/include/jacokin_ik.h`` says what the library does. The layout of the file stands in
``jacokin/kernels/c/solver.c``, beside the function that reads it.
"""

from __future__ import annotations

import shlex
import shutil
import struct
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from jacokin import __version__
from jacokin.errors import InvalidInputError, JacokinError, StructureError
from jacokin.files import reason, replacing
from jacokin.ik.fixed_joints import SIX
from jacokin.ik.solutions import curve_arm
from jacokin.ik.solver import IKSolver
from jacokin.kernels import library
from jacokin.model import checks

#: The folder with the headers.
INCLUDE = Path(__file__).parents[1] / "include"
#: The file begins with this; the version is that of its layout.
MAGIC, VERSION = b"jacokin\0", 3
#: Other machines that a clone compiles the library for: their names there, and what their library is called.
TARGETS = {
    "linux-aarch64": ("aarch64-linux", "libjacokin.so"),
    "macos": ("macos", "libjacokin.dylib"),
    "windows": ("x86_64-windows", "jacokin.dll"),
    "wasm": ("wasm32", "jacokin.wasm"),
}
#: The clone that this file is in, unless it is part of an installed package.
CLONE = Path(__file__).parents[2]
#: Where CMake looks for a package, below the folder that it is told.
CMAKE = Path("lib", "cmake", "jacokin_ik")

_CONFIG = """\
# find_package(jacokin_ik), with the folder that `jacokin export-c` filled in CMAKE_PREFIX_PATH, brings the target
# jacokin::ik: `target_link_libraries(mine PRIVATE jacokin::ik)`.
get_filename_component(_jacokin_root "${{CMAKE_CURRENT_LIST_DIR}}/../../.." ABSOLUTE)
if(NOT TARGET jacokin::ik)
  add_library(jacokin::ik SHARED IMPORTED)
  set_target_properties(jacokin::ik PROPERTIES
    IMPORTED_LOCATION "${{_jacokin_root}}/lib/{library}"{import_library}
    INTERFACE_INCLUDE_DIRECTORIES "${{_jacokin_root}}/include")
endif()
unset(_jacokin_root)
set(jacokin_ik_FOUND TRUE)
"""
_CONFIG_VERSION = """\
set(PACKAGE_VERSION "{version}")
if(PACKAGE_FIND_VERSION VERSION_GREATER PACKAGE_VERSION)
  set(PACKAGE_VERSION_COMPATIBLE FALSE)
else()
  set(PACKAGE_VERSION_COMPATIBLE TRUE)
  if(PACKAGE_FIND_VERSION VERSION_EQUAL PACKAGE_VERSION)
    set(PACKAGE_VERSION_EXACT TRUE)
  endif()
endif()
"""


def export_c(solver: IKSolver, folder: str | Path, *, target: str | None = None) -> Path:
    """Fill a folder with all that a C program needs to solve with the same numbers.

    Args:
        solver: a solver whose robot has a closed form, without a scene. The library does not look for contact.
        folder: made where it is not there; files of an earlier export are replaced.
        target: another machine than this one: "linux-aarch64", "macos", "windows" or "wasm". Its library is compiled,
            which only a clone can do, and takes a few minutes the first time.

    Returns:
        The solver's file: ``<robot>.jacokin``. Beside it are ``include``, ``lib`` and in it the CMake package.

    Raises:
        InvalidInputError: no solver, or one that looks for contact or solves by the QP only; a file cannot be written;
            an unknown target, or one that is asked of an installed package.
        JacokinError: the library of the target cannot be compiled; says what is missing.
        StructureError: the robot has no closed form, or fewer than six joints.
    """
    solver = checks.instance("solver", solver, IKSolver, "an IKSolver")
    folder = checks.path("folder", folder)
    contents = solver_file(solver)
    libraries = [library.PATH] if target is None else _libraries_for(checks.choice("target", target, TARGETS))
    texts = _cmake_package([file.name for file in libraries])
    copies = {
        **{Path("lib", file.name): file for file in libraries},
        **{Path("include", name): INCLUDE / name for name in ("jacokin_ik.h", "jacokin_ik.hpp")},
    }
    for place in (*texts, *copies):
        try:
            (folder / place).parent.mkdir(parents=True, exist_ok=True)
        except (OSError, ValueError) as error:
            raise InvalidInputError(f"{folder}: cannot be written: {reason(error)}") from error
    for place, text in texts.items():
        with replacing(folder / place) as path:
            path.write_text(text, encoding="utf-8")
    for place, source in copies.items():
        with replacing(folder / place) as path:
            shutil.copyfile(source, path)
    # What the file of a solver is called: the robot's name and this.
    file = folder / (Path(solver.robot.name).name + ".jacokin")
    with replacing(file) as path:
        path.write_bytes(contents)
    return file


def _cmake_package(libraries: Sequence[str]) -> dict[Path, str]:
    """Its files; none for WebAssembly, which is not linked with C."""
    shared = next((name for name in libraries if name.endswith((".so", ".dylib", ".dll"))), None)
    if shared is None:
        return {}
    imports = [f'\n    IMPORTED_IMPLIB "${{_jacokin_root}}/lib/{name}"' for name in libraries if name.endswith(".lib")]
    return {
        CMAKE / "jacokin_ikConfig.cmake": _CONFIG.format(library=shared, import_library="".join(imports)),
        CMAKE / "jacokin_ikConfigVersion.cmake": _CONFIG_VERSION.format(version=__version__),
    }


def _libraries_for(target: str) -> list[Path]:
    """The library of another machine, and on Windows the one that linkers read, compiled by this clone."""
    name, made = TARGETS[target]
    if not (CLONE / "build_kernels").is_dir():
        raise InvalidInputError(
            f"target {target!r}: an installed package has the library of its own machine only; "
            "export for others from a clone of the repository, whose compilers make them"
        )
    command = [sys.executable, "-m", "build_kernels", "--target", name]
    done = subprocess.run(command, cwd=CLONE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        raise JacokinError(f"target {target!r}: {done.stderr.strip() or 'the build was stopped'}")
    folder = CLONE / "build" / "targets" / name
    return [folder / made, *folder.glob("*.lib")]


def compiler_flags() -> str:
    """What a C compiler is told to use the installed package's header and library, quoted for a shell."""
    place = str(library.PATH.parent)
    words = [f"-I{INCLUDE}", f"-L{place}", f"-l{library.PATH.stem.removeprefix('lib')}", f"-Wl,-rpath,{place}", "-lm"]
    return shlex.join(words)


def solver_file(solver: IKSolver) -> bytes:
    """The numbers of a solver's robot, frame, tool, limits and tolerances, as the C library reads them.

    Raises:
        InvalidInputError: the solver looks for contact, or solves by the QP only, which the C library does not do.
        StructureError: the robot has no closed form, or fewer than six joints.
    """
    robot, verifier = solver.robot, solver.verifier
    options = verifier.options
    if verifier.options.collision not in ("prefer", "ignore") or verifier.options.scene is not None:
        raise InvalidInputError("the C library does not look for contact; use collision='ignore'")
    if solver.method == "qp":
        raise InvalidInputError("the C library solves by the closed form only; use method='auto'")
    if not SIX <= robot.dof <= SIX + 1:
        raise StructureError(f"the C library solves arms of six or seven joints; {robot.label} has {robot.dof}")
    at_poses = solver.dimension() == 1
    arm = curve_arm.at_poses(verifier) if at_poses else curve_arm.about_axis(solver.closed_form(), robot)
    kind, chain, constants = arm.constants
    tolerances = [options.limit_snap, options.position_tolerance, options.orientation_tolerance]
    numbers = np.concatenate([chain.ravel(), constants, robot.lower, robot.upper, robot.home, tolerances])
    names = [robot.name, robot.base, solver.frame, *robot.joint_names]
    text = b"".join(name.encode() + b"\0" for name in names)
    head = MAGIC + struct.pack("<4I", VERSION, robot.dof, kind, len(text))
    contents = head + numbers.astype("<f8").tobytes() + text
    return contents + struct.pack("<Q", check_sum(contents))


def check_sum(contents: bytes) -> int:
    """FNV-1a, 64 bits."""
    value = 14695981039346656037
    for byte in contents:
        value = (value ^ byte) * 1099511628211 & 0xFFFFFFFFFFFFFFFF
    return value
