"""`jacokin doctor`: what it finds here, and what it would say elsewhere; `jacokin warmup`."""

from __future__ import annotations

import importlib.metadata
from pathlib import Path

import pytest

from jacokin.cli import doctor
from jacokin.cli.doctor import FAILED, MISSING, OK, WARNING, Finding
from jacokin.errors import install_command
from jacokin.kernels import library
from tests.cli.run import ENVIRONMENT, Run
from tests.programs import python


@pytest.mark.slow
def test_this_installation_is_well(run: Run) -> None:
    document = run("doctor", "--json").document
    failed = [finding for finding in document["findings"] if finding["state"] == FAILED]
    assert failed == []
    names = {finding["name"] for finding in document["findings"]}
    assert {"python", "pin", "mujoco", "mink", "solvers", "egl", "osmesa", "kernels", "bundled"} <= names
    solvers = next(finding["detail"] for finding in document["findings"] if finding["name"] == "solvers")
    assert "daqp" in solvers


def test_a_failure_is_shown_and_the_code_is_1(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    findings = [Finding("package", "pin", FAILED, "ImportError: libboost"), Finding("rendering", "egl", MISSING, "no")]
    monkeypatch.setattr(doctor, "check_all", lambda: findings)
    shown = run("doctor", code=1).out
    assert "libboost" in shown
    assert "Optional and not there: egl; no" in shown
    monkeypatch.setattr(doctor, "check_all", lambda: findings[1:])
    assert run("doctor").out.startswith("Everything needed works.\n")
    assert "rendering" in run("doctor", "--all").out


def test_a_package_that_does_not_import_is_a_failure(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "mink.py").write_text("raise OSError('no such library')", encoding="utf-8")
    (tmp_path / "daqp.py").write_text("import os; os.abort()", encoding="utf-8")  # takes the process down
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(doctor, "PACKAGES", {name: (name, None) for name in ("json", "mink", "daqp")})
    states = {finding.name: (finding.state, finding.detail) for finding in doctor.check_packages()}
    assert states["json"][0] == OK
    assert states["mink"] == (FAILED, "OSError: no such library")
    assert states["daqp"] == (FAILED, "the process crashed while importing it")


def test_a_package_that_is_too_old_is_named_with_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    bounds = ["jso>=9", "json>=1.10", "csv>=2.0; extra == 'viewer'", "io>=1.2"]
    monkeypatch.setattr(doctor, "_requirements", lambda: bounds)
    needed = {name: (name, None) for name in ("json", "io", "os")}
    monkeypatch.setattr(doctor, "PACKAGES", {**needed, "csv": ("csv", "viewer")})
    monkeypatch.setattr(
        doctor, "_installed_version", {"json": "1.9.3", "io": "1.2.0", "os": "0.1", "csv": "0.2"}.__getitem__
    )
    found = {finding.name: (finding.state, finding.detail) for finding in doctor.check_packages()}
    assert found["json"] == (FAILED, "1.9.3 is older than 1.10, the oldest supported: pip install 'json>=1.10'")
    assert found["io"][0] == OK
    assert found["os"][0] == OK  # no bound
    assert found["csv"] == (WARNING, f"0.2 is older than 2.0, the oldest supported: {install_command('viewer')}")


def test_every_package_that_is_judged_has_a_bound() -> None:
    names = [distribution for distribution, _ in doctor.PACKAGES.values()]
    requirements = importlib.metadata.requires("jacokin") or []
    assert [name for name in names if doctor.oldest_version(name, requirements) is None] == []


def test_a_ros_copy_of_pinocchio_is_found(tmp_path: Path) -> None:
    ros = "/opt/ros/jazzy/lib/python3/site-packages"
    own = str(tmp_path / "pinocchio" / "__init__.py")
    finding = doctor.find_shadow(f"{ros}/pinocchio/__init__.py", own, ros)
    assert finding.state == FAILED
    assert "unset PYTHONPATH" in finding.detail
    assert ros in finding.detail
    assert doctor.find_shadow(own, own, ros).state == WARNING
    assert doctor.find_shadow(own, own, "").state == OK


def test_a_shadowing_package_is_noticed_in_a_real_process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "pinocchio").mkdir()
    (tmp_path / "pinocchio" / "__init__.py").touch()
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    finding = doctor.check_shadowing()
    assert finding.state == FAILED
    assert str(tmp_path) in finding.detail


def test_the_kernels(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert doctor.check_kernels() == Finding("closed form", "kernels", OK, f"loaded, {library.PATH}")
    monkeypatch.setattr(library, "PATH", tmp_path / "libjacokin.so")
    library.load.cache_clear()  # as in a new process
    finding = doctor.check_kernels()
    assert finding.state == FAILED
    assert f"{tmp_path / 'libjacokin.so'} cannot be read" in finding.detail
    assert "install jacokin again" in finding.detail


def test_a_renderer_that_is_missing_names_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "RENDERERS", {"egl": "apt install libegl1"})
    monkeypatch.setattr(doctor, "RENDER_PROBE", "raise ImportError('no EGL')")
    (finding,) = doctor.check_renderers()
    assert finding.state == MISSING
    assert "no EGL" in finding.detail
    assert "apt install libegl1" in finding.detail


def test_modules_of_the_current_folder_are_not_run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    planted = tmp_path / "numpy.py"
    planted.write_text("open('was_run', 'w')", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    place, error = doctor.import_modules(["numpy"])["numpy"]
    assert error is None
    assert place != str(planted)
    assert not (tmp_path / "was_run").exists()


def test_a_back_end_that_is_not_there_is_named_with_what_helps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "magic")
    monkeypatch.setattr(doctor, "PACKAGES", {"mujoco": ("mujoco", None)})
    (finding,) = doctor.check_packages()
    assert finding.state == FAILED
    assert "MUJOCO_GL=magic" in finding.detail
    assert "unset it" in finding.detail


def test_half_an_installation_of_mujoco_is_named_with_what_helps(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "mujoco.py").write_text("import mujoco_core_that_is_gone", encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(doctor, "PACKAGES", {"mujoco": ("mujoco", None)})
    (finding,) = doctor.check_packages()
    assert finding.state == FAILED
    assert "--force-reinstall mujoco mujoco-core" in finding.detail


def test_commands_that_need_mujoco_point_to_the_doctor() -> None:
    magic = {**ENVIRONMENT, "MUJOCO_GL": "magic"}
    done = python("-m", "jacokin", "crosscheck", "--samples", "1", code=2, environment=magic)
    assert "jacokin doctor" in done.stderr
    assert "MUJOCO_GL" in done.stderr


def test_it_says_that_the_kernels_are_ready(run: Run) -> None:
    answer = run("warmup")
    assert answer.out.startswith("the compiled kernels are ready (")
    assert answer.err == ""


def test_kernels_that_do_not_load_are_one_sentence(run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(library, "PATH", tmp_path / "libjacokin.so")
    library.load.cache_clear()
    answer = run("warmup", code=2)
    monkeypatch.undo()
    library.load.cache_clear()
    assert answer.err.startswith(f"jacokin: the compiled kernels {tmp_path / 'libjacokin.so'} cannot be read")
    assert answer.err.count("\n") == 1
