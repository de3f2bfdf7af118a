"""What hatchling is told about a wheel: its library and its tag, for this machine and for others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from build_kernels import library, linking
from build_kernels.hook import KernelHook


def told(monkeypatch: pytest.MonkeyPatch, made: Path) -> dict[str, Any]:
    """The data of a build whose library is that file."""
    monkeypatch.setattr(library, "build_or_exit", lambda names=(), *, whole=False: [made])
    data: dict[str, Any] = {"artifacts": [], "force_include": {}}
    KernelHook.__new__(KernelHook).initialize("standard", data)
    return data


def test_a_wheel_for_another_machine_has_its_library_and_tag(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    made = tmp_path / "libjacokin.dylib"
    made.touch()
    monkeypatch.setenv("JACOKIN_TARGET", "aarch64-macos")
    assert told(monkeypatch, made) == {
        "artifacts": [],
        "force_include": {str(made): "jacokin/kernels/libjacokin.dylib"},
        "pure_python": False,
        "tag": "py3-none-macosx_11_0_arm64",
    }
    assert KernelHook.__new__(KernelHook).dependencies() == [linking.ZIG_REQUIREMENT]


def test_a_wheel_for_this_machine_has_the_library_of_the_clone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    made = tmp_path / "jacokin" / "kernels" / "libjacokin.so"
    made.parent.mkdir(parents=True)
    made.write_bytes(b"\0GLIBC_2.17\0")
    monkeypatch.delenv("JACOKIN_TARGET", raising=False)
    monkeypatch.setattr(library, "ROOT", tmp_path)
    data = told(monkeypatch, made)
    assert data["artifacts"] == ["jacokin/kernels/libjacokin.so"]
    assert data["force_include"] == {}
    assert data["tag"] == linking.wheel_tag(made.read_bytes())


@pytest.mark.parametrize("name", ["windows", "wasm32", "macos"])
def test_a_machine_without_wheels_is_refused_in_a_sentence(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setenv("JACOKIN_TARGET", name)
    with pytest.raises(
        SystemExit, match=rf"^jacokin cannot be built: \$JACOKIN_TARGET is {name}; there are wheels for aarch64-linux, "
    ):
        KernelHook.__new__(KernelHook).initialize("standard", {})
