"""The package as a whole: layers, public names, light imports, what the wheel carries."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import jacokin
from jacokin import errors
from jacokin.model import bundled

PACKAGE = Path(jacokin.__file__).parent
LAYERS = {"model": 0, "ik": 1, "mujoco_bridge": 2, "cli": 3}
HEAVY = ("mujoco", "mink", "numba", "pinocchio", "yourdfpy", "qpsolvers", "scipy", "typer", "rich", "matplotlib")


def imported_names(path: Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return names


@pytest.mark.parametrize("layer", LAYERS)
def test_no_layer_imports_a_higher_one(layer: str) -> None:
    files = list((PACKAGE / layer).rglob("*.py"))
    assert files
    for path in files:
        for name in imported_names(path):
            parts = name.split(".")
            if parts[0] == "jacokin" and len(parts) > 1 and parts[1] in LAYERS:
                assert LAYERS[parts[1]] <= LAYERS[layer], f"{path.name} imports {name}"


def test_no_module_is_longer_than_400_lines() -> None:
    root = PACKAGE if (PACKAGE / "urdf").is_dir() else PACKAGE.parent
    for path in [*PACKAGE.rglob("*.py"), *(root / "urdf").rglob("*.py")]:
        assert len(path.read_text().splitlines()) <= 400, path


def test_public_names_are_exactly_these() -> None:
    assert jacokin.__all__ == [
        "IKResult",
        "IKSolver",
        "JacokinError",
        "Robot",
        "Status",
        "Tracker",
        "__version__",
        "crosscheck",
        "load_robot",
        "pose",
        "solve_ik",
    ]
    for name in jacokin.__all__:
        assert getattr(jacokin, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'Robo'; public names"):
        _ = jacokin.Robo


def test_importing_jacokin_loads_nothing_heavy() -> None:
    code = "import json, sys; import jacokin; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    loaded = set(json.loads(done.stdout))
    assert not loaded & set(HEAVY)


def test_solving_one_pose_needs_no_mink_and_no_mujoco() -> None:
    code = (
        "import sys, jacokin; robot = jacokin.load_robot();"
        "result = jacokin.solve_ik(robot.forward_kinematics(robot.home), robot);"
        "print(result.success, sorted({'mujoco', 'mink', 'yourdfpy', 'scipy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split(maxsplit=1) == ["True", "[]\n"]


def test_every_error_has_one_base() -> None:
    classes = [value for value in vars(errors).values() if isinstance(value, type) and issubclass(value, Exception)]
    assert len(classes) >= 9
    for error in classes:
        assert issubclass(error, errors.JacokinError)
        assert error.__name__ in (errors.__doc__ or "")
    assert issubclass(errors.InvalidInputError, ValueError)
    assert issubclass(errors.ModelError, ValueError)
    assert issubclass(errors.PhysicsError, RuntimeError)


def test_errors_carry_what_they_say() -> None:
    unknown = errors.UnknownNameError("frame", "gripste", ["gripsite", "link_6"])
    assert (unknown.kind, unknown.given, unknown.valid) == ("frame", "gripste", ("gripsite", "link_6"))
    assert str(unknown) == "unknown frame 'gripste'. Did you mean 'gripsite'? Valid: gripsite, link_6"
    missing = errors.MissingExtraError("ruckig", "motion")
    assert "pip install 'jacokin[motion]'" in str(missing)


def test_the_descriptions_come_with_the_package() -> None:
    folder = bundled.urdf_folder()
    wanted = [f"{name}.{suffix}" for name in bundled.NAMES for suffix in ("urdf", "xml")]
    for name in [*wanted, "jaco_arm.xml", "jaco_hand.xml", "jaco.toml"]:
        assert (folder / name).is_file(), name
    assert (PACKAGE / "py.typed").is_file()
