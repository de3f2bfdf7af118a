"""What would be uploaded is refused where it is not fit for it."""

from __future__ import annotations

import io
import platform
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[2]))  # last: the installed package is what gets tested

import release_check  # found by the line above
from release_check import ReleaseError

WHEEL = "jacokin-1.0-py3-none-manylinux_2_17_x86_64.whl"
PACKED = (
    "jacokin-1.0.dist-info/licenses/LICENSE",
    "jacokin-1.0.dist-info/licenses/NOTICE",
    "jacokin/urdf/j2n6s300.urdf",
    "jacokin/py.typed",
    "jacokin/kernels/libjacokin.so",
)
SOURCES = ("LICENSE", "NOTICE", "build_kernels/hook.py", "constraints.txt", "tests/conftest.py")


def made(folder: Path, name: str = WHEEL, without: str = "") -> tuple[Path, Path]:
    """A wheel and an sdist of empty files, one of them missing."""
    wheel, sdist = folder / name, folder / "jacokin-1.0.tar.gz"
    with zipfile.ZipFile(wheel, "w") as packed:
        for file in PACKED:
            if file != without:
                packed.writestr(file, "")
    with tarfile.open(sdist, "w:gz") as archive:
        for file in SOURCES:
            if file != without:
                archive.addfile(tarfile.TarInfo(f"jacokin-1.0/{file}"), io.BytesIO())
    return wheel, sdist


def test_what_is_complete_passes(tmp_path: Path) -> None:
    release_check.check_contents(*made(tmp_path))


@pytest.mark.parametrize("missing", [*PACKED, *SOURCES])
def test_what_is_missing_is_named(tmp_path: Path, missing: str) -> None:
    with pytest.raises(ReleaseError, match="lacks"):
        release_check.check_contents(*made(tmp_path, without=missing))


def test_a_wheel_of_this_machine_alone_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReleaseError, match="linux_x86_64 is refused by an index"):
        release_check.check_contents(*made(tmp_path, "jacokin-1.0-py3-none-linux_x86_64.whl"))


def test_there_must_be_one_file_of_a_kind(tmp_path: Path) -> None:
    with pytest.raises(ReleaseError, match=r"one \*\.whl, found 0"):
        release_check.one(tmp_path, "*.whl")
    wheel, _ = made(tmp_path)
    assert release_check.one(tmp_path, "*.whl") == wheel.resolve()
    made(tmp_path, "jacokin-2.0-py3-none-any.whl")
    with pytest.raises(ReleaseError, match=r"one \*\.whl, found 2"):
        release_check.one(tmp_path, "*.whl")


def test_the_wheel_of_this_machine_is_the_one_that_is_installed(tmp_path: Path) -> None:
    machines = ("manylinux_2_17_x86_64", "manylinux_2_17_aarch64", "macosx_11_0_x86_64", "macosx_11_0_arm64")
    wheels = [tmp_path / f"jacokin-1.0-py3-none-{machine}.whl" for machine in machines]
    assert release_check.fitting(wheels).name.endswith(f"_{platform.machine()}.whl")
    with pytest.raises(ReleaseError, match="found 0"):
        release_check.fitting([])


def test_every_component_says_its_licence() -> None:
    named = {"name": "a", "version": "1", "licenses": [{"license": {"id": "MIT"}}, {"license": {"name": "MIT"}}]}
    expressed = {"name": "b", "version": "2", "licenses": [{"expression": "MPL-2.0 AND (Apache-2.0 OR MIT)"}]}
    found = release_check.licences({"components": [named, expressed]})
    assert found == {"a 1": "MIT", "b 2": "MPL-2.0 AND (Apache-2.0 OR MIT)"}
    silent: dict[str, object] = {"name": "vhacdx", "version": "4"}
    assert release_check.licences({"components": [silent]}) == {"vhacdx 4": "MIT"}
    assert silent["licenses"] == [{"license": {"id": "MIT"}}]
    with pytest.raises(ReleaseError, match="c 3 does not say its licence"):
        release_check.licences({"components": [named, {"name": "c", "version": "3"}]})


def test_a_python_that_is_not_there_is_none() -> None:
    running = f"{sys.version_info.major}.{sys.version_info.minor}"
    assert release_check.interpreter(running) == sys.executable
    assert release_check.interpreter("3.99") is None
