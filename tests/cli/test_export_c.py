"""`jacokin export-c`: a robot for C programs, and what their compiler is told."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import jacokin
from jacokin.ik import IKSolver
from jacokin.ik.c_library import solver_file
from jacokin.kernels import library
from tests.cli.run import Run
from tests.programs import execute

EXAMPLE = Path(__file__).parents[2] / "examples" / "c" / "nearest.c"


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_a_program_finds_the_installed_library_by_cflags(run: Run, tmp_path: Path) -> None:
    flags = run("export-c", "--cflags").out.split()
    run("export-c", "--robot", "j2n6s300", "--output", tmp_path)
    execute("cc", EXAMPLE, *flags, "-o", tmp_path / "use")
    assert "branch 4: within the limits" in execute(tmp_path / "use", tmp_path / "j2n6s300.jacokin").stdout


def test_export_c_writes_a_robot_with_its_tool_and_limits(run: Run, tmp_path: Path) -> None:
    words = ["--tool", "0", "0", "0.1", "--limit", "joint_2=1,5", "--output", str(tmp_path / "new" / "arm")]
    run("export-c", "j2n6s300", *words)
    written = {path.relative_to(tmp_path / "new" / "arm").as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert written == {
        "j2n6s300.jacokin",
        "include/jacokin_ik.h",
        "include/jacokin_ik.hpp",
        f"lib/{library.PATH.name}",
        "lib/cmake/jacokin_ik/jacokin_ikConfig.cmake",
        "lib/cmake/jacokin_ik/jacokin_ikConfigVersion.cmake",
    }
    robot = jacokin.load_robot("j2n6s300", limits={"joint_2": (1.0, 5.0)})
    expected = solver_file(IKSolver(robot, tool=jacokin.pose([0.0, 0.0, 0.1])))
    assert (tmp_path / "new" / "arm" / "j2n6s300.jacokin").read_bytes() == expected


def test_export_c_refuses_in_a_sentence(run: Run, tmp_path: Path) -> None:
    assert "--output must be given" in run("export-c", code=2).err
    assert "give the robot once" in run("export-c", "gen3", "--robot", "gen3", "--output", tmp_path, code=2).err
    (tmp_path / "file").write_text("")
    assert "cannot be written" in run("export-c", "--output", tmp_path / "file" / "arm", code=2).err
    run("export-c", "--limit", "joint_2=3", "--output", tmp_path, code=2)
