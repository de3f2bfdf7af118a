"""Building the library: what is compiled again, how it is linked, what its wheel is called."""

from __future__ import annotations

import ast
import dataclasses
import importlib.metadata
import importlib.util
import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
import time
import tomllib
from pathlib import Path

import pytest

from build_kernels import c_library, linking
from build_kernels import library as build
from build_kernels.linking import BuildError
from build_kernels.targets import AVX2, EMITTED, HERE, TARGETS, WIDE_KERNELS
from jacokin.kernels import library
from jacokin.kernels.contact.cloud_tree import build_cloud
from jacokin.kernels.entries import ENTRIES, Entry
from jacokin.kernels.rest_to_rest import fit_rest_to_rest
from jacokin.kernels.solution_set.run import solve_set
from jacokin.kernels.speeds import fit_speeds

REPOSITORY = Path(__file__).parents[2]


def test_every_kernel_is_part_of_some_entry() -> None:
    used = {file.resolve() for entry in ENTRIES for file in build.sources_of(entry)}
    package = build.PACKAGE / "kernels"
    apart = {"__init__.py", "entries.py", "library.py"}
    assert used == {file.resolve() for file in package.rglob("*.py") if file.name not in apart}


@pytest.mark.slow
def test_an_object_file_is_kept_until_its_kernel_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    speeds, curves = ((next(entry for entry in ENTRIES if entry.run is run),) for run in (fit_speeds, solve_set))
    before = build.object_key(speeds), build.object_key(curves)
    assert before[0] != before[1]
    parse = ast.parse

    def changed(source: str) -> ast.Module:
        return parse(source.replace("ROUNDS", "TURNS") if "def solve_set" in source else source)

    monkeypatch.setattr(ast, "parse", changed)
    assert build.object_key(speeds) == before[0]
    assert build.object_key(curves) != before[1]
    monkeypatch.setattr(ast, "parse", lambda source: parse(f"# a comment\n{source}"))
    assert build.object_key(speeds) == before[0]
    assert len({build.object_key(speeds, target) for target in EMITTED.values()}) == len(EMITTED) >= 1 + len(TARGETS)
    monkeypatch.setattr(platform, "machine", lambda: "other")
    assert build.object_key(speeds) != before[0]


def test_another_machine_gets_the_kernels_that_the_c_files_call() -> None:
    text = (build.PACKAGE / "kernels" / "c" / "common.h").read_text(encoding="utf-8")
    called = set(re.findall(r"^int64_t jacokin_(\w+)\(entry \*table\);", text, re.MULTILINE))
    assert called == set(c_library.KERNELS)
    assert [entry.run.__name__ for entry in build.C_ENTRIES] == list(c_library.KERNELS)


def test_wider_vectors_are_those_of_x86_64(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the machines by name, and of this one by what it is; the kernels that are there twice exist."""
    wide = {name for name, target in TARGETS.items() if target.wide is not None}
    assert wide == {"x86_64-linux", "x86_64-windows", "x86_64-macos"}
    assert {entry.run.__name__ for entry in ENTRIES}.issuperset(WIDE_KERNELS)
    monkeypatch.setattr(platform, "machine", lambda: "x86_64")
    twice = HERE.wide
    assert twice is not None
    assert (twice.name, twice.wide) == (AVX2, None)
    monkeypatch.setattr(platform, "machine", lambda: "arm64")
    assert HERE.wide is None


def test_what_stops_a_build_for_another_machine_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with pytest.raises(BuildError, match=r"^unknown target amiga, vax; known are aarch64-linux, .*wasm32, macos$"):
        build.build_for(["wasm32", "amiga", "vax"])
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(
        BuildError, match=r"^linking for another machine takes ziglang==.*: `pip install -e '\.\[kernels,targets\]'`$"
    ):
        build.build_for(["wasm32"])
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: name)
    (tmp_path / "file").touch()
    with pytest.raises(BuildError, match=r"file.*: Not a directory$"):
        build.build_for(["wasm32"], tmp_path / "file")


def test_kernels_that_share_code_are_in_one_object_file() -> None:
    """Each kernel in one; of some kernels those that share code with each other."""
    together = build.groups(ENTRIES)
    assert sorted(entry.run.__name__ for group in together for entry in group) == sorted(
        entry.run.__name__ for entry in ENTRIES
    )
    for names in build.GROUPS:
        assert names in [tuple(entry.run.__name__ for entry in group) for group in together]
    (first, second) = (names[:2] for names in build.GROUPS)
    some = [entry for entry in ENTRIES if entry.run.__name__ in (*first, *second) or entry.run is fit_speeds]
    assert [tuple(entry.run.__name__ for entry in group) for group in build.groups(some)] == [
        first,
        second,
        ("fit_speeds",),
    ]


@pytest.mark.slow
def test_kernels_are_translated_together_and_emitted_group_by_group(tmp_path: Path) -> None:
    speeds, cloud, rest = (
        next(entry for entry in ENTRIES if entry.run is run) for run in (fit_speeds, build_cloud, fit_rest_to_rest)
    )
    chosen = [(speeds, cloud), (rest,), (speeds,)]
    made = list(build.translated(chosen, tmp_path))
    assert [group for group, _ in made] == chosen
    for group, module in made:
        for target in (TARGETS["wasm32"], HERE):
            file = tmp_path / f"{target.library}.o"
            build.emit_objects(group, module, {target: file})
            for entry in (speeds, cloud, rest):
                assert (f"jacokin_{entry.run.__name__}".encode() in file.read_bytes()) == (entry in group)
    group, module = made[1]
    here, windows = TARGETS["x86_64-linux"], TARGETS["x86_64-windows"]
    files = {target: tmp_path / f"{target.name}.o" for target in (here, windows)}
    build.emit_objects(group, module, files)
    build.emit_objects(group, module, {windows: tmp_path / "alone.o"})
    assert (tmp_path / "alone.o").read_bytes() == files[windows].read_bytes() != files[here].read_bytes()


def test_systems_on_the_same_processor_share_what_is_optimised() -> None:
    files = {target: Path(target.name) for target in EMITTED.values()}
    x86_64 = [f"x86_64-{system}" for system in ("linux", "windows", "macos")]
    assert [[target.name for target in each] for each in build.by_processor(files)] == [
        *([""], [AVX2])[: 1 + (HERE.wide is not None)],
        ["aarch64-linux", "aarch64-macos"],
        x86_64,
        [f"{name}-{AVX2}" for name in x86_64],
        ["wasm32"],
    ]


@pytest.mark.slow
def test_a_kernel_that_does_not_compile_is_named(tmp_path: Path) -> None:
    def unknown(work: object) -> int:
        return 0

    good = next(entry for entry in ENTRIES if entry.run is build_cloud)
    found = build.translated([(good,), (Entry(unknown, tuple),)], tmp_path)
    assert next(found)[0] == (good,)
    with pytest.raises(BuildError, match=r"^unknown does not compile, see above$"):
        next(found)
    (tmp_path / "broken.bc").write_bytes(b"nothing")
    with pytest.raises(BuildError, match=r"^build_cloud does not compile, see above$"):
        build.emit_objects((good,), tmp_path / "broken.bc", {HERE: tmp_path / "broken.o"})
    assert not (tmp_path / "broken.o").exists()


def test_a_c_compiler_is_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "clang -m64")
    assert linking.linkers() == [["clang", "-m64"]]
    monkeypatch.delenv("CC")
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")
    assert linking.linkers()[0] == ["/usr/bin/cc"]
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert linking.linkers() == []
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: name)
    assert linking.linkers() == [linking.ZIG]


def test_without_a_linker_there_is_one_sentence(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(linking, "linkers", lambda target: [])
    with pytest.raises(BuildError, match=r"^the kernels need a C compiler to be linked: install one .*ziglang.*\$CC$"):
        linking.link([], tmp_path / "libjacokin.so")
    monkeypatch.setattr(
        linking,
        "linkers",
        lambda target: [["no-such-compiler"], [sys.executable, "-P", "-c", "raise SystemExit('broken')"]],
    )
    with pytest.raises(BuildError, match=r"need a C compiler(.|\n)*no-such-compiler(.|\n)*broken"):
        linking.link([], tmp_path / "libjacokin.so")
    assert list(tmp_path.iterdir()) == []


def test_what_stops_a_build_is_one_sentence(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(linking, "linkers", lambda: [["cc"]])
    (tmp_path / "file").touch()
    with pytest.raises(BuildError, match=r"file.*: Not a directory; build in a copy of the clone that can be written$"):
        build.build(kept=tmp_path / "file" / "kernels")

    def missing(package: str) -> str:
        raise importlib.metadata.PackageNotFoundError(package)

    monkeypatch.setattr(importlib.metadata, "version", missing)
    with pytest.raises(BuildError, match=r"^compiling the kernels takes numba: `pip install -e '\.\[kernels\]'`$"):
        build.build(kept=tmp_path)
    monkeypatch.undo()
    monkeypatch.setenv("CC", "cc '-m64")
    with pytest.raises(BuildError, match=r"^\$CC is \"cc '-m64\", which is no command: No closing quotation$"):
        build.build(kept=tmp_path)


def test_what_takes_long_is_said_on_the_terminal_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Pip takes the output of a build that succeeds; without a terminal nothing else happens."""
    ours, theirs = os.openpty()
    monkeypatch.setattr(build, "TERMINAL", Path(os.ttyname(theirs)))
    build.tell("jacokin: compiling")
    assert capsys.readouterr().out == "jacokin: compiling\n"
    assert os.read(ours, 100).strip() == b"jacokin: compiling"
    os.close(ours)
    os.close(theirs)
    for nothing in (Path("/dev/nothing/at/all"), Path(__file__).parent):
        monkeypatch.setattr(build, "TERMINAL", nothing)
        build.tell("jacokin: linked")
        assert capsys.readouterr().out == "jacokin: linked\n"


def test_object_files_of_other_builds_stay_for_a_week(tmp_path: Path) -> None:
    """Another Python builds in the same clone, perhaps at the same time."""
    used, other, old = (tmp_path / f"{name}.o" for name in ("used", "other", "old"))
    for file in (used, other, old):
        file.touch()
    a_week_ago = time.time() - 8 * 86400  # [s]
    for file in (used, old):
        os.utime(file, (a_week_ago, a_week_ago))
    build.remove_unused(tmp_path, [used])
    build.remove_unused(tmp_path, [used])
    assert set(tmp_path.iterdir()) == {used, other}
    os.utime(other, (a_week_ago, a_week_ago))
    build.remove_unused(tmp_path, [other])
    assert set(tmp_path.iterdir()) == {used, other}, "used is counted from its last use"


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_a_linked_library_knows_its_size(tmp_path: Path) -> None:
    source, object_file, made = tmp_path / "kernel.c", tmp_path / "kernel.o", tmp_path / "libjacokin.so"
    source.write_text("long long jacokin_solve_targets(const long long *table) { return table[0]; }\n")
    subprocess.run(["cc", "-c", "-fPIC", "-o", object_file, source], check=True)
    linking.link([object_file], made)
    said = library.about(made.read_bytes())
    assert said is not None
    assert said.size == made.stat().st_size
    assert library.Library(made).function("solve_targets") is not None


def test_the_wheel_is_named_for_what_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platform, "machine", lambda: "x86_64")
    linux, macos = (dataclasses.replace(HERE, system=system) for system in ("linux", "darwin"))
    assert linking.wheel_tag(b"\0GLIBC_2.2.5\0GLIBC_2.17\0", linux) == "py3-none-manylinux_2_17_x86_64"
    assert linking.wheel_tag(b"\0GLIBC_2.2.5\0GLIBC_2.35\0", linux) == "py3-none-linux_x86_64"
    assert linking.wheel_tag(b"\0GLIBC_2.17\0", TARGETS["aarch64-linux"]) == "py3-none-manylinux_2_17_aarch64"
    assert linking.wheel_tag(b"", TARGETS["aarch64-macos"]) == "py3-none-macosx_11_0_arm64"
    assert linking.wheel_tag(b"", TARGETS["x86_64-macos"]) == "py3-none-macosx_11_0_x86_64"
    monkeypatch.setattr(sysconfig, "get_platform", lambda: "macosx-14.0-arm64")
    assert linking.wheel_tag(b"", macos) == "py3-none-macosx_14_0_arm64"


def test_the_compilers_are_the_same_everywhere() -> None:
    """Their versions stand in three places, and the bits of all answers depend on them."""
    document = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
    required = {line for line in document["build-system"]["requires"] if "==" in line}
    assert {line.partition("==")[0] for line in required} == set(build.COMPILERS)
    assert set(document["project"]["optional-dependencies"]["kernels"]) < required
    constraints = (REPOSITORY / "constraints.txt").read_text(encoding="utf-8").splitlines()
    assert required <= set(constraints)
