"""Programs in C, C++ and Rust that use the library, compiled strictly, under sanitizers, and as the examples are."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import jacokin
from build_kernels import c_library
from build_kernels.linking import OLDEST_GLIBC
from jacokin.ik import IKSolver, export_c
from jacokin.ik.c_library import INCLUDE
from jacokin.kernels import library
from tests.programs import execute

HERE, EXAMPLES = Path(__file__).parent, Path(__file__).parents[2] / "examples" / "c"
NAMES = "j2n6s300", "j2s7s300"
WARNINGS = ("-Wall", "-Wextra", "-Werror", "-pedantic", "-Wshadow", "-Wconversion")
needs_cc = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
needs_cxx = pytest.mark.skipif(shutil.which("c++") is None, reason="needs a C++ compiler")


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of an export of both kinds of arm."""
    folder = tmp_path_factory.mktemp("arm")
    for name in NAMES:
        assert export_c(IKSolver(jacokin.load_robot(name)), folder) == folder / f"{name}.jacokin"
    return folder


def linked(arm: Path) -> list[str]:
    """What a linker is told to find the exported library."""
    return [f"-I{arm / 'include'}", str(arm / "lib" / library.PATH.name), f"-Wl,-rpath,{arm / 'lib'}", "-lm"]


@needs_cc
@pytest.mark.parametrize("compiler", ["cc -std=c99", "c++ -std=c++17"])
def test_the_headers_compile_without_a_warning(compiler: str, tmp_path: Path) -> None:
    command, standard = compiler.split()
    if shutil.which(command) is None:
        pytest.skip(f"needs {command}")
    header = "jacokin_ik.h" if command == "cc" else "jacokin_ik.hpp"
    source = tmp_path / ("use.c" if command == "cc" else "use.cpp")
    source.write_text(f'#include "{header}"\n#include "{header}"\nint main(void) {{ return 0; }}\n')
    execute(command, standard, *WARNINGS, f"-I{INCLUDE}", "-c", source, "-o", tmp_path / "use.o")


@pytest.mark.slow
@needs_cc
def test_the_library_compiles_without_a_warning(tmp_path: Path) -> None:
    c_library.write_header(tmp_path)
    for source in c_library.sources():
        execute("cc", *c_library.flags(tmp_path), *WARNINGS, "-c", source, "-o", tmp_path / "part.o")


def test_the_header_of_the_arrays_names_each_kernel_and_constant() -> None:
    text = c_library.header()
    assert "#define JACOKIN_SOLVE_TARGETS(ARRAY, FREE)" in text
    assert "    FREE(T, 16)" in text
    assert "    ARRAY(pose_branches_rows, 408)" in text
    assert "#define JACOKIN_LOST -3" in text


@pytest.mark.slow
@needs_cc
def test_eight_threads_share_a_solver(arm: Path, tmp_path: Path) -> None:
    source, program = HERE / "exercise.c", tmp_path / "exercise"
    execute("cc", "-std=c99", "-O2", *WARNINGS, source, *linked(arm), "-lpthread", "-o", program)
    for name in NAMES:
        alone = execute(program, arm / f"{name}.jacokin", "10", "1").stdout
        assert execute(program, arm / f"{name}.jacokin", "10", "8").stdout.splitlines() == alone.splitlines() * 8


@needs_cc
@pytest.mark.slow
@pytest.mark.parametrize("sanitizer", ["address,undefined", "thread"])
def test_sanitizers_find_nothing(sanitizer: str, arm: Path, tmp_path: Path) -> None:
    """The C files are compiled with them; the kernels are those of the library."""
    empty, program = tmp_path / "empty.c", tmp_path / "exercise"
    empty.write_text("int main(void) { return 0; }\n")
    sanitize = [f"-fsanitize={sanitizer}", "-fno-sanitize-recover=all", "-g", "-O1"]
    if subprocess.run(["cc", *sanitize, empty, "-o", program], capture_output=True, check=False).returncode != 0:
        pytest.skip(f"this compiler has no -fsanitize={sanitizer}")
    if subprocess.run([program], capture_output=True, check=False).returncode != 0:
        pytest.skip(f"-fsanitize={sanitizer} does not run here")
    c_library.write_header(tmp_path)
    files = [HERE / "exercise.c", *c_library.sources()]
    flags = [*c_library.flags(tmp_path), *sanitize, f"-I{tmp_path}"]
    execute("cc", *flags, *files, *linked(arm), "-lpthread", "-o", program)
    for name in NAMES:
        execute(program, arm / f"{name}.jacokin", "8", "2")


@needs_cc
def test_the_example_in_c(arm: Path, tmp_path: Path) -> None:
    program = tmp_path / "nearest"
    execute("cc", "-std=c99", *WARNINGS, EXAMPLES / "nearest.c", *linked(arm), "-o", program)
    assert "branch 4: within the limits" in execute(program, arm / "j2n6s300.jacokin").stdout


@pytest.mark.slow
@needs_cxx
def test_the_example_in_cpp(arm: Path, tmp_path: Path) -> None:
    program = tmp_path / "intervals"
    execute("c++", "-std=c++17", *WARNINGS, EXAMPLES / "intervals.cpp", *linked(arm), "-o", program)
    assert "8 intervals, none is missing" in execute(program, arm / "j2n6s300.jacokin").stdout
    assert "16 intervals" in execute(program, arm / "j2s7s300.jacokin").stdout


@pytest.mark.slow
@needs_cxx
def test_the_wrapper_has_a_batch_and_memory_for_every_call(arm: Path, tmp_path: Path) -> None:
    program = tmp_path / "wrapper"
    execute("c++", "-std=c++17", *WARNINGS, HERE / "wrapper.cpp", *linked(arm), "-o", program)
    for name in NAMES:
        assert "20 of 21 reached" in execute(program, arm / f"{name}.jacokin").stdout


@pytest.mark.skipif(sys.platform != "linux", reason="needs the GNU C library")
def test_an_export_runs_on_old_systems(arm: Path) -> None:
    """Names of the C library that are younger than ten years are not asked for, whatever compiler linked it."""
    contents = (arm / "lib" / library.PATH.name).read_bytes()
    versions = {int(minor) for minor in re.findall(rb"GLIBC_2\.(\d+)", contents)}
    assert max(versions, default=0) <= OLDEST_GLIBC


@pytest.mark.skipif(shutil.which("rustc") is None, reason="needs rustc")
def test_the_example_in_rust(arm: Path, tmp_path: Path) -> None:
    program = tmp_path / "nearest"
    rpath = f"link-arg=-Wl,-rpath,{arm / 'lib'}"
    execute("rustc", EXAMPLES / "nearest.rs", "-D", "warnings", "-L", arm / "lib", "-C", rpath, "-o", program)
    assert "the pose is reached" in execute(program, arm / "j2n6s300.jacokin").stdout


@needs_cc
@pytest.mark.skipif(shutil.which("cmake") is None, reason="needs cmake")
def test_cmake_finds_the_exported_package(arm: Path, tmp_path: Path) -> None:
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.16)\nproject(use C)\nfind_package(jacokin_ik 0.1 REQUIRED)\n"
        f'add_executable(use "{EXAMPLES / "nearest.c"}")\ntarget_link_libraries(use PRIVATE jacokin::ik)\n'
    )
    execute("cmake", "-S", tmp_path, "-B", tmp_path / "build", f"-DCMAKE_PREFIX_PATH={arm}")
    execute("cmake", "--build", tmp_path / "build")
    assert "j2n6s300" in execute(tmp_path / "build" / "use", arm / "j2n6s300.jacokin").stdout
