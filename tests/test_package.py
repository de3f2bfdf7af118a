"""The package as a whole: layers, public names, light imports, what the wheel carries."""

from __future__ import annotations

import ast
import dataclasses
import functools
import importlib
import inspect
import json
import re
from pathlib import Path

import pytest

import jacokin
from jacokin import errors
from jacokin.model.descriptions import bundled
from tests import robot_files
from tests.programs import python

PACKAGE = Path(jacokin.__file__).parent
INTERNAL = ("jacokin.cli", "jacokin.viewer", "jacokin.calibration.alignment", "jacokin.tasks.experts")  # not handed out
REPOSITORY = Path(__file__).parents[1]
LAYERS = {
    "chunks": 0,
    "kernels": 0,
    "model": 1,
    "ik": 2,
    "motion": 3,
    "mujoco_bridge": 3,
    "logs": 3,
    "torch": 3,
    "jax": 3,
    "reachability": 4,
    "calibration": 4,
    "teleop": 4,
    "tasks": 4,
    "twin": 4,
    "runner": 5,
    "viewer": 6,
    "cli": 7,
}
DOORS = (
    "jacokin",
    "jacokin.model",
    "jacokin.ik",
    "jacokin.motion",
    "jacokin.reachability",
    "jacokin.calibration",
    "jacokin.logs",
    "jacokin.mujoco_bridge",
    "jacokin.mujoco_bridge.props",
    "jacokin.runner",
    "jacokin.tasks",
    "jacokin.teleop",
    "jacokin.twin",
    "jacokin.viewer",
)
HEAVY = (
    "mujoco",
    "mink",
    "numba",
    "pinocchio",
    "yourdfpy",
    "qpsolvers",
    "scipy",
    "click",
    "orjson",
    "matplotlib",
    "dm_env",
    "gymnasium",
    "viser",
    "torch",
    "jax",
    "rosbags",
)


def module_files() -> dict[str, Path]:
    """Every module of the package by its full name; a package stands for its ``__init__``."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = ("jacokin", *path.relative_to(PACKAGE).with_suffix("").parts)
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = module_files()


@functools.cache
def nodes(name: str) -> list[ast.AST]:
    """All parts of the program text of a module."""
    return list(ast.walk(ast.parse(MODULES[name].read_text())))


@functools.cache
def imports(name: str) -> set[str]:
    """The modules of this package that a module names in imports, in functions and for type checkers too."""
    found: set[str] = set()
    for node in nodes(name):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            found.update(names & set(MODULES) or {node.module})
    return {other for other in found if other in MODULES and other != name}


@pytest.mark.parametrize("layer", LAYERS)
def test_no_layer_imports_a_higher_one(layer: str) -> None:
    modules = [name for name in MODULES if name.split(".")[1:2] == [layer]]
    assert modules
    for name in modules:
        for other in imports(name):
            above = other.split(".")[1:2]
            if above and above[0] in LAYERS:
                assert LAYERS[above[0]] <= LAYERS[layer], f"{name} imports {other}"


def test_no_modules_import_each_other_in_a_circle() -> None:
    """Packages count as their ``__init__``, without the stub beside it that names its modules: doors are lazy."""
    graph = {name: sorted(imports(name)) for name in MODULES}
    finished: set[str] = set()
    for start in graph:
        trail: list[tuple[str, list[str]]] = [(start, list(graph[start]))]
        while trail and start not in finished:
            name, ahead = trail[-1]
            if not ahead:
                finished.add(name)
                trail.pop()
                continue
            other = ahead.pop()
            on_trail = [module for module, _ in trail]
            assert other not in on_trail, " -> ".join([*on_trail[on_trail.index(other) :], other])
            if other not in finished:
                trail.append((other, list(graph[other])))


@pytest.mark.parametrize("package", DOORS)
def test_a_door_loads_what_it_names(package: str) -> None:
    module = importlib.import_module(package)
    tree = ast.parse(MODULES[package].with_suffix(".pyi").read_text())
    for_checkers = {
        str(alias.asname): node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert set(module.__all__) - {"__version__"} == set(for_checkers)
    for name, source in for_checkers.items():
        assert getattr(module, name) is getattr(importlib.import_module(str(source)), name)
    assert dir(module) == sorted(module.__all__)


@pytest.mark.parametrize(
    "package", sorted(name for name, path in MODULES.items() if path.stem == "__init__" and "." in name)
)
def test_a_door_says_what_is_where(package: str) -> None:
    """Each module and folder of a package is named in its docstring, and the one to read first."""
    text = ast.get_docstring(ast.parse(MODULES[package].read_text(encoding="utf-8"))) or ""
    inside = {name.removeprefix(f"{package}.") for name in MODULES if name.startswith(f"{package}.")}
    here = {name for name in inside if "." not in name}
    assert here <= set(re.findall(r"\w+", text)), "is named nowhere"
    listed = {name for line in re.findall(r"^(\w+(?:, \w+)*)  +", text, re.M) for name in line.split(", ")}
    assert listed <= here, "is listed and not there"
    (first,) = re.findall(r"[Rr]ead `([\w/]+)` first", text)
    assert first.replace("/", ".") in inside


def test_public_names_are_exactly_these() -> None:
    assert jacokin.__all__ == [
        "FreeAxis",
        "IKResult",
        "IKSolver",
        "JacokinError",
        "Robot",
        "Status",
        "Tracker",
        "__version__",
        "crosscheck",
        "load_robot",
        "plan_motion",
        "plan_path",
        "pose",
        "solve_ik",
        "warmup",
    ]
    for name in jacokin.__all__:
        assert getattr(jacokin, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'Robo'; public names"):
        _ = jacokin.Robo  # type: ignore[attr-defined]  # the name that does not exist


def test_importing_jacokin_loads_nothing_heavy() -> None:
    code = "import json, sys; import jacokin; print(json.dumps(sorted(sys.modules)))"
    done = python("-c", code)
    assert done.stderr == ""
    loaded = set(json.loads(done.stdout))
    assert not loaded & set(HEAVY)


@pytest.mark.slow
def test_rooms_need_no_import_of_their_own() -> None:
    code = (
        "import jacokin, sys; rooms = [getattr(jacokin, name) for name in jacokin.ROOMS]; jacokin.Tracker;"
        "print(*(room.__name__ for room in rooms), sorted({'viser', 'mink', 'jax'} & set(sys.modules)))"
    )
    done = python("-c", code)
    found, *rest = done.stdout.splitlines()
    assert not rest
    assert found == " ".join([*(f"jacokin.{room}" for room in jacokin.ROOMS), "[]"])
    assert {f"jacokin.{room}" for room in jacokin.ROOMS} < set(MODULES)


#: What takes long to load and is not needed for the kinematics of an arm without meshes.
SLOW = {"mujoco", "mink", "yourdfpy", "trimesh", "scipy", "qpsolvers", "tomllib", "zipfile", "numpy.ma"}


@pytest.mark.one_quick
@pytest.mark.parametrize("own", [False, True], ids=["bundled", "a URDF without shapes"])
def test_the_first_answer_loads_nothing_that_it_does_not_need(own: bool, tmp_path: Path) -> None:
    path = tmp_path / "ur5.urdf"
    path.write_text(robot_files.ur5_text('<visual><geometry><mesh filename="nowhere.dae"/></geometry></visual>'))
    code = (
        f"import sys, jacokin; robot = jacokin.load_robot(*{[str(path)] if own else []});"
        "solver = jacokin.IKSolver(robot);"
        "result = solver.solve(robot.forward_kinematics(robot.home + 0.1));"
        f"print(result.success, bool(robot.notes), sorted({SLOW} & set(sys.modules)))"
    )
    done = python("-c", code)
    assert done.stdout == f"True {own} []\n"


def test_what_does_not_change_gives_copies_of_its_poses() -> None:
    """A `pin.SE3` can be written to, so that one which a frozen object lends would change the object."""
    seen = set[str]()
    for name in MODULES:
        for node in (node for node in nodes(name) if isinstance(node, ast.ClassDef) and node.name[0] != "_"):
            is_frozen = any("frozen=True" in ast.unparse(each) for each in node.decorator_list)
            fields = [each for each in node.body if isinstance(each, ast.AnnAssign)]
            posed = [ast.unparse(each.target) for each in fields if "pin.SE3" in ast.unparse(each.annotation)]
            if not is_frozen or not posed or name.startswith(INTERNAL):
                continue
            kind = getattr(importlib.import_module(name), node.name)
            for field in posed:
                assert isinstance(inspect.getattr_static(kind, field), property), f"{name}.{node.name}.{field}"
                seen.add(f"{node.name}.{field}")
    assert {"Box.pose", "PointCloud.pose", "OtherRobot.base", "Gripper.pads", "BasePlacement.pose"} <= seen


def public_dataclasses() -> list[type]:
    """Those that the doors hand out."""
    found = [
        getattr(importlib.import_module(door), name) for door in DOORS for name in importlib.import_module(door).__all__
    ]
    return list(dict.fromkeys(each for each in found if inspect.isclass(each) and dataclasses.is_dataclass(each)))


def test_what_is_frozen_and_compares_has_a_hash() -> None:
    for each in public_dataclasses():
        if each.__dataclass_params__.eq:  # type: ignore[attr-defined]  # a dataclass has it
            assert each.__hash__ is not None, each
            hashed = [field for field in dataclasses.fields(each) if field.compare and field.hash is not False]
            assert not [
                field.name for field in hashed if re.match(r"Mapping|dict|list|Array|NDArray", str(field.type))
            ], each


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
    missing = errors.MissingExtraError("h5py", "data")
    assert "pip install '.[data]'" in str(missing)


def test_the_descriptions_come_with_the_package() -> None:
    folder = bundled.urdf_folder()
    wanted = [f"{name}.{suffix}" for name in bundled.NAMES for suffix in ("urdf", "xml")]
    for name in [*wanted, "jaco_arm.xml", "jaco_hand.xml", *bundled.TABLES, bundled.WRITTEN]:
        assert (folder / name).is_file(), name
    assert (PACKAGE / "py.typed").is_file()


def test_programs_in_tests_do_not_search_the_current_folder() -> None:
    # Run from the repository, `python -c` would import its source tree instead of what is installed.
    pattern = re.compile(r'sys\.executable,(?! "-P")[^\]]*"-[cm]"')
    for path in (REPOSITORY / "tests").rglob("*.py"):
        assert not pattern.search(path.read_text()), path
