"""Help, version, what starting the command line loads, and what it says to wrong input."""

from __future__ import annotations

import importlib
import json
import re
from pathlib import Path

import pytest

import jacokin
from jacokin.cli import groups
from jacokin.cli.main import COMMANDS
from jacokin.model import urdf_folder
from tests.cli.run import HOME, POSE, Run
from tests.programs import python

GROUPS = {"map": ("build", "show", "query"), "calibrate": ("fit", "plan")}
IN_GROUPS = [f"{group} {name}" for group, names in GROUPS.items() for name in names]


@pytest.mark.parametrize("command", ["", *(name for name in COMMANDS if name not in GROUPS), *IN_GROUPS])
def test_help_teaches_by_example(run: Run, command: str) -> None:
    answer = run(*command.split(), "--help")
    assert f"  jacokin {command.removesuffix(' fit')}".rstrip() in answer.out
    assert "Examples:" in answer.out


@pytest.mark.parametrize("command", ["ik", "move", "plan", "view"])
def test_a_long_help_has_headings_and_every_option_once(run: Run, command: str) -> None:
    text = run(command, "--help").out
    headed = re.split(r"^(?=\w.*:$)", text, flags=re.MULTILINE)
    found = [re.findall(r"^  (--[a-z-]+)", part, re.MULTILINE) for part in headed[1:]]
    parts = [flags for flags in found if flags]
    assert len(parts) >= 4
    assert max(map(len, parts)) <= 15
    every = [flag for flags in parts for flag in flags]
    assert len(set(every)) == len(every)
    parameters = getattr(importlib.import_module(f"jacokin.cli.{COMMANDS[command]}"), command).params
    named = {parameter.opts[0] for parameter in parameters if parameter.opts[0].startswith("--")}
    assert set(every) | {"--no-closest", "--no-resume"} >= named


@pytest.mark.parametrize(
    ("words", "names"), [((), tuple(COMMANDS)), *(((group,), names) for group, names in GROUPS.items())]
)
def test_every_command_is_listed_with_its_whole_sentence(
    run: Run, words: tuple[str, ...], names: tuple[str, ...]
) -> None:
    text = run(*words, "--help").out.partition("\nCommands:\n")[2]
    for name in names:
        assert f"  {name} " in text
    assert "..." not in text


def test_the_page_of_the_command_line_lists_every_command() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "command_line.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\| `jacokin ([\w-]+)` \|", page, re.MULTILINE)) == sorted(COMMANDS)


def test_the_version_is_that_of_the_package(run: Run) -> None:
    assert run("--version").out == f"jacokin {jacokin.__version__}\n"


def test_help_loads_nothing_heavy() -> None:
    program = (
        "import sys\n"
        "from jacokin.cli.main import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "print([m for m in ('numpy', 'pinocchio', 'mujoco', 'mink', 'numba', 'orjson') if m in sys.modules])\n"
    )
    done = python("-c", program)
    assert done.stdout.splitlines()[-1] == "[]"


def test_the_package_runs_as_a_module() -> None:
    assert json.loads(python("-m", "jacokin", "fk", *HOME, "--json").stdout)["frame"] == "end_effector"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("ik", "--down"), "--position"),
        (("ik", "--position", "0.3", "-0.2"), "--position"),
        (("ik", "--position", "nan", "0", "0"), "finite"),
        (("ik", "--position", "-inf", "0", "0"), "finite"),
        (("ik", *POSE, "--rpy", "0", "0", "0"), "at most one orientation"),
        (("ik", *POSE[:4], "--quat-wxyz", "1", "1", "0", "0"), "norm 1.41421"),
        (("ik", *POSE[:4], "--quat-wxyz", "0", "0", "0", "0"), "norm 0"),
        (("ik", *POSE[:4], "--all"), "orientation"),
        (("ik", *POSE, "--seed", "1", "2", "3"), "seed"),
        (("ik", *POSE, "--seed", "north"), "'north'"),
        (("ik", *POSE, "--seed", "--json"), "--seed"),
        (("ik", *POSE, "--seed", "1", "2", "3", "4", "5", "nan"), "finite"),
        (("ik", *POSE, "--frame", "gripsit"), "Did you mean 'gripsite'"),
        (("ik", *POSE, "--method", "magic"), "auto, closed_form, qp"),
        (("ik", *POSE, "--method", "qp", "--qp-solver", "dapq"), "Did you mean 'daqp'"),
        (("ik", *POSE, "--collision", "maybe"), "ignore, report, reject"),
        (("ik", *POSE, "--robot", "j2n6s30"), "Did you mean 'j2n6s300'"),
        (("ik", *POSE, "--robot", "nowhere.urdf"), "nowhere.urdf"),
        (("ik", *POSE, "--output", "a.csv"), "--targets"),
        (("ik", *POSE, "--random-seed", "-1"), "--random-seed"),
        (("ik", "--targets", "nowhere.csv"), "nowhere.csv"),
        (("ik", "--targets", "a.csv", *POSE[:4]), "--position"),
        (("ik", "--targets", "a.csv", "--degrees"), "--degrees"),
        (("ik", "--targets", "a.csv", "--free-axis", "z"), "--free-axis does not go with --targets"),
        (("ik", "--targets", "a.csv", "--prefer", "margin"), "--prefer does not go with --targets"),
        (("ik", *POSE, "--all", "--prefer", "margin"), "--prefer does not go with --all"),
        (("ik", *POSE, "--free-axis", "0,0,0"), "--free-axis must have a direction"),
        (("ik", *POSE, "--free-axis", "x", "--free-range", "2", "1"), "--free-range must be (least, largest)"),
        (("ik", *POSE[:4], "--free-axis", "x"), "--free-axis needs an orientation"),
        (("ik", *POSE[:4], "--down", "--free-axis", "q"), "--free-axis must be x, y, z or three numbers"),
        (("ik", *POSE[:4], "--down", "--free-axis", "0,0,0"), "must have a direction"),
        (("ik", *POSE[:4], "--down", "--free-range", "0", "1"), "--free-range goes with --free-axis"),
        (("ik", *POSE[:4], "--down", "--free-axis", "x", "--free-range", "1", "0"), "least < largest"),
        (("ik", *POSE[:4], "--down", "--approach", "1", "0", "0"), "--approach does not go with --down"),
        (("ik", *POSE[:4], "--down", "--prefer", "widest"), "Valid: nearest, margin, manipulability"),
        (("place", "--json"), "Missing option '--targets'"),
        (("plan", "--json"), "Missing option '--path'"),
        (("map", "query", "j2n6s300", "--down"), "Missing option '--position'"),
        (("fk", "--json"), "Missing argument 'ANGLE...'"),
        (("fk", "1", "2", "3"), "6 numbers, got 3"),
        (("fk", "a", "b"), "ANGLE"),
        (("fk", *HOME, "--base", "lnk_base"), "Did you mean 'link_base'"),
        (("jacobian", *HOME, "--reference", "globe"), "local_world_aligned"),
        (("info", "nobody"), "j2n6s300"),
        (("crosscheck", "--samples", "0"), "--samples"),
        (("crosscheck", "--joint", "a"), "A=B"),
        (("crosscheck", "--joint", "a=b"), "joint_1"),
        (("crosscheck", "--tolerance", "-1"), "--tolerance"),
        (("solve",), "solve"),
        (("ik", *POSE, "--tip", "nowhere"), "--tip: unknown frame 'nowhere'"),
        (("ik", *POSE, "--base", "nowhere"), "--base: unknown frame 'nowhere'"),
        (("ik", *POSE, "--frame", "nowhere"), "--frame: unknown frame 'nowhere'"),
        (("ik", *POSE, "--qp-solver", "magic", "--method", "qp"), "--qp-solver: unknown"),
        (("ik", *POSE, "--seed", "1", "2", "3"), "jacokin: --seed must be 6 numbers, got 3"),
        (("ik", *POSE, "--robot", "/"), "folder"),
        (("fk", "1", "2"), "ANGLE must be 6 numbers, got 2"),
        (("ik", "--position", "nan", "0", "0"), "--position must be finite"),
        (("ik", *POSE, "--limit", "joint_9=1,2"), "--limit: unknown joint 'joint_9'"),
    ],
)
def test_wrong_input_is_one_sentence_and_exit_code_2(run: Run, words: tuple[str, ...], message: str) -> None:
    answer = run(*words, code=2)
    assert message in " ".join(answer.err.split())
    assert "Traceback" not in answer.err
    assert answer.out == ""


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("ik", *POSE, "--workers", "8"), "--workers goes with --targets"),
        (("ik", "--targets", "a.csv", "--workers", "8", "--dask", "a:1"), "--workers does not go with --dask"),
        (("ik", *POSE, "--all", "--random-seed", "1"), "--random-seed does not go with --all"),
        (("ik", *POSE, "--limit", "joint_2=1,5", "--limit", "joint_2=2,5"), "--limit is given twice for 'joint_2'"),
        (("info", "--lock", "finger_1=0.2", "--lock", "finger_1=0.3"), "--lock is given twice for 'finger_1'"),
        (("crosscheck", "j2n6s300", "--frame", "a=b", "--frame", "a=c"), "--frame is given twice for 'a'"),
        (("crosscheck", "--second-base", "link_1"), "--second-base is for a second description"),
        (("crosscheck", "--second-tip", "link_1"), "--second-tip is for a second description"),
        (("export-c", "--cflags", "--output", "a"), "--output does not go with --cflags"),
        (("export-c", "--cflags", "--target", "wasm"), "--target does not go with --cflags"),
        (("map", "build", "a", "--down", "--orientations", "9"), "--orientations does not go with --down"),
        (("map", "build", "a", "--workers", "2", "--dask", "a:1"), "--workers does not go with --dask"),
        (("move", "--to", *HOME, "--down"), "--down does not go with --to"),
        (("move", "--to", *HOME, "--free-axis", "z"), "--free-axis does not go with --to"),
        (("move", "--to", *HOME, "--frame", "link_6"), "--frame does not go with --to"),
        (("move", "--to", *HOME, "--tool", "0", "0", "0.1"), "--tool does not go with --to"),
        (("ik", "--targets", "-"), "--targets is '-': the standard streams are /dev/stdin and /dev/stdout"),
        (("calibrate", "-"), "FILE... is '-'"),
        (("move", *POSE[:4], "--output", "-"), "--output is '-'"),
        (("move", *POSE[:4], "--kinova", *"123456"), "--kinova does not go with --position"),
        (("run", "a.csv", "--twin", "--name", "arm"), "--name does not go with --twin"),
        (("run", "a.csv", "--twin", "--states", "/joints"), "--states goes with --ros"),
        (("run", "a.csv", "--forwarder", "a", "--velocities", "/speeds"), "--velocities goes with --ros"),
        (("run", "a.csv", "--forwarder", "a", "--python", "a"), "--python goes with --ros"),
        (("run", "a.csv", "--ros", "1", "--random-seed", "1"), "--random-seed goes with --twin"),
        (("run", "--live", "--twin", "--start", "1"), "--start does not go with --live"),
        (("run", "a.csv", "--write-forwarder", "a.py"), "give it without a file"),
        (("run", "--twin", "--write-forwarder", "a.py"), "--write-forwarder does not go with --twin"),
        (("task", "replay", "a.hdf5", "--episodes", "3"), "--episodes and --seed are those of the data set"),
        (("task", "replay", "a.hdf5", "--seed", "3"), "--episodes and --seed are those of the data set"),
        (("teleop", "--port", "9000"), "--port goes with --view or --device"),
        (("teleop", "--rate", "30", "--stream", "a.npz"), "--rate is for a hand that is made"),
        (("teleop", "--random-seed", "3", "--stream", "a.npz"), "--random-seed is for a hand that is made"),
        (("twin", "--ros", "1", "--degrees"), "--degrees goes with --from"),
        (("twin", "--ros", "1", "--fast", "--pace", "2"), "--pace does not go with --fast"),
        (("twin", "--ros", "1", "--port", "9000"), "--port goes with --view"),
        (("twin", "--ros", "1", "--camera", "wrist", "--camera", "wrist"), "--camera is given twice for 'wrist'"),
        (("view", "--free-range", "0", "1"), "--free-range goes with --free-axis"),
    ],
)
def test_an_option_that_has_no_effect_is_refused(run: Run, words: tuple[str, ...], message: str) -> None:
    assert message in run(*words, code=2).err


@pytest.mark.parametrize("words", [("info", ""), ("info", "--robot", ""), ("fk", *HOME, "--robot", "")])
def test_an_empty_name_is_no_robot(run: Run, words: tuple[str, ...]) -> None:
    """As "$ROBOT" is in a shell where it is not set."""
    assert "--robot must be a bundled name or a path, got ''" in run(*words, code=2).err


def test_a_broken_description_is_one_sentence(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "cut.urdf"
    path.write_text('<robot name="cut"><link', encoding="utf-8")
    answer = run("fk", *HOME, "--robot", path, code=2)
    assert "cut.urdf" in answer.err
    assert len(answer.err.splitlines()) == 1


def test_a_mistake_of_our_own_is_no_traceback(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise KeyError("inner")

    monkeypatch.setattr(groups.RobotOptions, "load", fail)
    assert "internal error" in run("info", code=2).err


def test_a_mesh_that_is_not_found_names_the_option_that_finds_it(run: Run, tmp_path: Path) -> None:
    text = (urdf_folder() / "j2n6s300.urdf").read_text(encoding="utf-8")
    mesh = '<mesh filename="package://jaco/meshes/base.obj"/>'
    file = tmp_path / "arm" / "jaco.urdf"
    file.parent.mkdir()
    file.write_text(
        re.sub(r"(<collision.*?<geometry>)\s*<[^>]*/>", rf"\1{mesh}", text, count=1, flags=re.DOTALL), encoding="utf-8"
    )
    words = ("ik", *POSE, "--robot", str(file), "--collision", "report")
    assert "--package-dir or ROS_PACKAGE_PATH" in run(*words, code=2).err
    meshes = tmp_path / "packages" / "jaco" / "meshes"
    meshes.mkdir(parents=True)
    corners = "".join(f"v {x} {y} {z}\n" for x in (0, 0.01) for y in (0, 0.01) for z in (0, 0.01))
    (meshes / "base.obj").write_text(corners + "f 1 2 4\nf 1 3 5\nf 8 7 6\nf 2 6 7\n", encoding="utf-8")
    run(*words, "--package-dir", tmp_path / "packages", "--frame", "end_effector", code=(0, 1))
    run("fk", *HOME, "--robot", file)  # kinematics needs no meshes
    missing = run("fk", *HOME, "--robot", file, "--package-dir", tmp_path / "package", code=2).err
    assert missing.startswith("jacokin: --package-dir")
    assert missing.endswith(f": there is no folder '{tmp_path / 'package'}'\n")
