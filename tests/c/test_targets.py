"""Libraries for other machines: what `jacokin export-c --target` writes, and programs that use it under emulation."""

from __future__ import annotations

import shutil
import struct
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

import jacokin
from build_kernels.universal import universal
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, JacokinError, UnknownNameError
from jacokin.ik import IKSolver, c_library, export_c
from jacokin.kernels import library
from tests.c.binding import make_targets
from tests.programs import execute

HERE, REPOSITORY = Path(__file__).parent, Path(__file__).parents[2]
#: Poses of six joints, and targets of seven.
MANY = {"j2n6s300": 2_000, "gen3_lite": 500, "j2s7s300": 50}
#: [rad] Machines differ in their functions of trigonometry, and branches that are nearly double amplify that.
SAME = 1e-10
#: Where Debian's libc6-arm64-cross puts the C library of AArch64.
ARM_LIBRARIES = Path("/usr/aarch64-linux-gnu")
#: Without symbols, as `python -m build_kernels` links: else zig makes the C library of each machine again, for minutes.
ZIG = (sys.executable, "-P", "-m", "ziglang", "cc", "-s")
needs_zig = pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed")
needs_wine = pytest.mark.skipif(
    shutil.which("wine") is None, reason="Wine is not installed (Debian: apt-get install wine wine64)"
)
needs_qemu = pytest.mark.skipif(
    shutil.which("qemu-aarch64") is None or not ARM_LIBRARIES.is_dir(),
    reason="AArch64 is not emulated (Debian: apt-get install qemu-user libc6-arm64-cross)",
)


def export(folder: Path, target: str | None) -> Path:
    """Both kinds of arm and the library of a machine, from this clone, whichever package is tested."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(c_library, "CLONE", REPOSITORY)
        for name, n in MANY.items():
            solver = IKSolver(jacokin.load_robot(name), collision="ignore")
            export_c(solver, folder, target=target)
            make_targets(solver.robot, n, 44)[0].tofile(folder / f"{name}.f64")
    return folder


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What the library of this machine answers, by robot."""
    folder = export(tmp_path_factory.mktemp("here"), None)
    program = compiled(folder, library.PATH.name, f"-Wl,-rpath,{folder / 'lib'}", "-lm")
    return {name: execute(program, *files(name, folder)).stdout for name in MANY}


def compiled(folder: Path, made: str, *words: str, target: str | None = None, name: str = "answers") -> Path:
    """The program that answers by an exported library."""
    program = folder / "lib" / name
    machine = () if target is None else ("-target", target)
    sources = (f"-I{folder / 'include'}", HERE / "answers.c", folder / "lib" / made)
    execute(*ZIG, *machine, "-O2", *sources, *words, "-o", program)
    return program


def check_answers(
    here: dict[str, str], folder: Path, *words: str | Path, environment: Mapping[str, str] = MappingProxyType({})
) -> None:
    """A program with these words answers as one here."""
    for name, answers in here.items():
        difference = apart(answers, execute(*words, *files(name, folder), environment=environment).stdout)
        print(f"{name}: {len(parsed(answers))} poses, {difference:.1e} rad")
        assert difference < SAME


def files(name: str, folder: Path) -> tuple[Path, Path]:
    return folder / f"{name}.jacokin", folder / f"{name}.f64"


def apart(ours: str, theirs: str) -> float:
    """The largest difference [rad] of joints, once statuses, numbers of branches and completeness are equal."""
    a, b = parsed(ours), parsed(theirs)
    assert [head for head, _ in a] == [head for head, _ in b]
    # Which of two branches comes first that are as far from home as each other, rounding decides.
    return max(
        float(np.abs(p[:, None] - q).max(axis=2).min(axis=1).max(initial=0.0))
        for (_, p), (_, q) in zip(a, b, strict=True)
        if len(p)
    )


def parsed(text: str) -> list[tuple[str, Array]]:
    """The first line of each pose, and its configurations (n, dof)."""
    lines = iter(text.splitlines())
    rows = [(head, [next(lines).split() for _ in range(int(head.split()[1]))]) for head in lines]
    return [(head, np.array(q, dtype=np.float64)) for head, q in rows]


@needs_zig
@needs_wine
@pytest.mark.slow
def test_a_program_for_windows_answers_as_one_here(here: dict[str, str], tmp_path: Path) -> None:
    folder = export(tmp_path, "windows")
    program = compiled(folder, "jacokin.lib", target="x86_64-windows-gnu", name="answers.exe")
    quiet = {"WINEPREFIX": str(tmp_path / "wine"), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree,mshtml="}
    check_answers(here, folder, "wine", program, environment=quiet)


@needs_zig
@needs_qemu
@pytest.mark.slow
def test_a_program_for_aarch64_answers_as_one_here(here: dict[str, str], tmp_path: Path) -> None:
    folder = export(tmp_path, "linux-aarch64")
    linked = (f"-Wl,-rpath,{folder / 'lib'}", "-lm")
    program = compiled(folder, "libjacokin.so", *linked, target="aarch64-linux-gnu.2.17")
    check_answers(here, folder, "qemu-aarch64", "-L", ARM_LIBRARIES, program)


@needs_zig
@pytest.mark.slow
def test_a_library_for_macos_has_both_processors_and_the_functions(tmp_path: Path) -> None:
    folder = export(tmp_path, "macos")
    made = folder / "lib" / "libjacokin.dylib"
    contents = made.read_bytes()
    kinds = [struct.unpack_from(">5I", contents, 8 + 20 * i)[0] for i in range(2)]
    assert kinds == [0x0100000C, 0x01000007], "AArch64 and x86-64"
    for name in ("_jacokin_ik_all", "_jacokin_fk", "@rpath/libjacokin.dylib"):
        assert contents.count(name.encode() + b"\0") >= 2
    assert "libjacokin.dylib" in (folder / c_library.CMAKE / "jacokin_ikConfig.cmake").read_text()
    compiled(folder, made.name, target="aarch64-macos")


@needs_zig
@pytest.mark.slow
def test_an_export_for_webassembly_is_one_module(tmp_path: Path) -> None:
    folder = export(tmp_path, "wasm")
    assert (folder / "lib" / "jacokin.wasm").read_bytes()[:4] == b"\0asm"
    assert [path.name for path in (folder / "lib").iterdir()] == ["jacokin.wasm"]


def test_an_installed_package_says_that_it_cannot(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(c_library, "CLONE", tmp_path)
    solver = IKSolver(jacokin.load_robot("j2n6s300"))
    with pytest.raises(
        InvalidInputError, match="'windows': an installed package has the library of its own machine only"
    ):
        export_c(solver, tmp_path / "arm", target="windows")
    with pytest.raises(UnknownNameError, match="linux-aarch64"):
        export_c(solver, tmp_path / "arm", target="amiga")
    assert not (tmp_path / "arm").exists()


def test_a_build_that_fails_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "build_kernels").mkdir()
    (tmp_path / "build_kernels" / "__init__.py").touch()
    (tmp_path / "build_kernels" / "__main__.py").write_text("raise SystemExit('no compiler')")
    monkeypatch.setattr(c_library, "CLONE", tmp_path)
    with pytest.raises(JacokinError, match="^target 'wasm': no compiler$"):
        export_c(IKSolver(jacokin.load_robot("j2n6s300")), tmp_path / "arm", target="wasm")


def test_a_universal_library_is_a_table_and_its_parts() -> None:
    parts = [b"\xcf\xfa\xed\xfe" + bytes([kind]) * 8 + b"code" for kind in (1, 2)]
    made = universal(parts)
    assert made[:8] == bytes.fromhex("cafebabe00000002")
    for i, part in enumerate(parts):
        kind, _, at, size, alignment = struct.unpack_from(">5I", made, 8 + 20 * i)
        assert kind == 0x01010101 * (i + 1)
        assert at % (1 << alignment) == 0
        assert made[at : at + size] == part
    with pytest.raises(ValueError, match="Mach-O"):
        universal([b"\x7fELF"])
