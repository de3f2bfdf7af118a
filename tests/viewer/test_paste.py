"""What the viewer offers to paste is run, and gives the configuration on the screen with every option in force."""

from __future__ import annotations

import contextlib
import io
import json
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import IKSolver, Robot, Status
from jacokin.arrays import Array
from jacokin.ik import Box, Capsule, Cylinder, Floor, PointCloud, Scene, Sphere
from jacokin.model import urdf_folder
from jacokin.viewer import Inspector, View
from jacokin.viewer import paste as paste
from tests.cli.run import leave

TURNED = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([0.0, 0.05, 0.1]))
TABLE = Scene(
    [
        Box("table", (0.6, 0.3, 0.04), pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 0.1), np.array([0.1, -0.6, 0.0]))),
        Sphere("ball", 0.1, (0.5, 0.4, 0.2)),
        Capsule("pole", 0.02, 0.5, (-0.4, 0.2, 0.3)),
        Cylinder("cup", 0.04, 0.1, (0.3, -0.6, 0.1)),
        Floor(-0.1),
    ],
    finger_angle=0.6,
)


@dataclass(frozen=True, slots=True)
class Case:
    """Options that are in force, and what the texts must say of them."""

    robot: dict[str, Any] = field(default_factory=dict)  # Any: arguments of `load_robot`
    solver: dict[str, Any] = field(default_factory=dict)  # Any: arguments of `IKSolver`
    prefer: str = "nearest"
    python: tuple[str, ...] = ()
    command: tuple[str, ...] = ()


CASES = {
    "plain": Case(),
    "frame and tool": Case(
        solver={"frame": "gripsite", "tool": TURNED}, python=("'gripsite'", "tool="), command=("gripsite", "--tool")
    ),
    "limits and fingers": Case(
        robot={"limits": {"joint_2": (1.0, 5.0), "joint_1": (-np.inf, 6.0)}, "finger_angle": 0.7},
        python=("limits=", "finger_angle=0.7"),
        command=("--limit joint_2=1.0,5.0", "--finger-angle 0.7"),
    ),
    "locked": Case(
        robot={"robot": str(urdf_folder() / "j2n6s300.urdf"), "locked": {"finger_1": 0.5}},
        python=("locked={'finger_1': 0.5}",),
        command=("--lock finger_1=0.5",),
    ),
    "scene": Case(
        solver={"scene": TABLE, "collision": "report", "clearance": 0.005},
        prefer="margin",
        python=("Box('table'", "collision='report'", "clearance=0.005", "prefer='margin'", "finger_angle=0.6"),
        command=("--scene", "--collision report", "--clearance 0.005", "--prefer margin"),
    ),
    "tolerances": Case(
        solver={"position_tolerance": 1e-5, "qp_solver": "quadprog", "collision": "report"},
        python=("position_tolerance=1e-05", "qp_solver='quadprog'", "collision='report'"),
        command=("--qp-solver quadprog", "no options for position_tolerance=1e-05"),
    ),
    "file": Case(
        robot={"robot": str(urdf_folder() / "m1n6s300.urdf"), "base": "link_base", "tip": "end_effector"},
        python=("base='link_base'", "tip='end_effector'"),
        command=("--base link_base", "--tip end_effector"),
    ),
    "tip": Case(robot={"tip": "gripsite"}, python=("tip='gripsite'",), command=("--tip gripsite",)),
    "seven": Case(robot={"robot": "j2s7s300"}),
    "no hand": Case(robot={"robot": "gen3_6dof"}),
    "other fingers": Case(robot={"robot": "gen3_lite", "finger_angle": -0.5}, python=("finger_angle=-0.5",)),
}


def inspector_of(case: Case) -> Inspector:
    return Inspector(IKSolver(jacokin.load_robot(**case.robot), **case.solver), prefer=case.prefer)


def pasted_python(inspector: Inspector, view: View) -> tuple[str, Array]:
    text = paste.python_text(inspector, view)
    names: dict[str, object] = {}
    exec(text, names)
    return text, np.array(names["q"])


def pasted_command(inspector: Inspector, view: View, folder: Path) -> tuple[str, Array]:
    """What a shell makes of it, with --json at its end; the command line itself runs in this process."""
    text = paste.command_text(inspector, view)
    shell = f"jacokin() {{ printf '%s\\0' \"$@\"; }}\n{text.rstrip()} --json\n"
    done = subprocess.run(["bash", "-c", shell], cwd=folder, capture_output=True, text=True, check=True)
    printed = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(printed):
        assert leave(*done.stdout.split("\0")[:-1]) in (0, 1)
    answer = json.loads(printed.getvalue())
    if "branches" in answer:
        rows = np.array([branch["q"] for branch in answer["branches"]])
        return text, rows[np.argmin(np.abs(rows - view.q).max(axis=1))]
    return text, np.array(answer["q"])


@pytest.mark.one_quick
@pytest.mark.parametrize("name", CASES)
def test_both_texts_give_what_is_on_the_screen(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    inspector = inspector_of(case)
    home = inspector.robot.home
    target = inspector.pose_of(home) * pin.SE3(pin.rpy.rpyToMatrix(0.2, -0.1, 0.4), np.array([0.01, 0.02, -0.03]))
    view = inspector.at(target, home)
    assert view.status is Status.OK
    python, by_python = pasted_python(inspector, view)
    command, by_command = pasted_command(inspector, view, tmp_path)
    assert np.allclose(by_python, view.q, atol=1e-9)
    assert np.allclose(by_command, view.q, atol=1e-9)
    for words, text in ((case.python, python), (case.command, command)):
        for word in words:
            assert word in text


@pytest.mark.parametrize("name", ["j2n6s300", "gen3", "gen3_lite"])
def test_fingers_as_they_are_loaded_are_not_said(name: str) -> None:
    inspector = inspector_of(Case(robot={"robot": name}))
    view = inspector.at(inspector.pose_of(inspector.robot.home), inspector.robot.home)
    assert "finger" not in paste.python_text(inspector, view)
    assert "finger" not in paste.command_text(inspector, view)


@pytest.mark.one_quick
@pytest.mark.parametrize("prefer", ["nearest", "margin"])
@pytest.mark.parametrize("angle", [None, 0.3])
def test_a_free_axis_and_its_range_are_pasted(tmp_path: Path, prefer: str, angle: float | None) -> None:
    inspector = Inspector(IKSolver(jacokin.load_robot(), tool=TURNED), prefer=prefer)
    home = inspector.robot.home
    view = inspector.turned(inspector.pose_of(home), 1, home, angle, (-0.5, 0.75))
    assert view.free is not None
    assert view.status is Status.OK
    assert angle is None or view.free.value == angle
    python, by_python = pasted_python(inspector, view)
    command, by_command = pasted_command(inspector, view, tmp_path)
    assert np.allclose(by_python, view.q, atol=1e-6)
    assert np.allclose(by_command, view.q, atol=1e-6)
    assert "FreeAxis(target, axis=[0.0, 1.0, 0.0], range=[-0.5, 0.75])" in python
    assert "--free-axis y --free-range -0.5 0.75" in command


def test_a_branch_that_was_chosen_by_hand_is_pasted(tmp_path: Path, rng: np.random.Generator) -> None:
    """Within the limits as the nearest to itself, outside them as a row of all branches."""
    inspector = Inspector(IKSolver(jacokin.load_robot()), prefer="margin")
    robot = inspector.robot
    while True:
        view = inspector.at(robot.forward_kinematics(robot.sample(rng)), robot.home)
        if not view.within.all() and view.within.sum() > 2:
            break
    for branch in (int(np.flatnonzero(~view.within)[0]), int(np.flatnonzero(view.within)[-1])):
        chosen = inspector.choose(view, branch)
        python, by_python = pasted_python(inspector, chosen)
        _, by_command = pasted_command(inspector, chosen, tmp_path)
        assert np.allclose(by_python, chosen.q, atol=1e-9)
        assert np.allclose(by_command, chosen.q, atol=1e-9)
        assert ("solve_all" in python) == (not view.within[branch])


def test_the_closest_configuration_is_pasted(tmp_path: Path) -> None:
    inspector = Inspector(IKSolver(jacokin.load_robot()))
    far = jacokin.pose([1.2, 0.3, 0.4], down=True)
    view = inspector.closest(inspector.at(far, inspector.robot.home))
    assert view.status is Status.UNREACHABLE
    python, by_python = pasted_python(inspector, view)
    _, by_command = pasted_command(inspector, view, tmp_path)
    assert np.allclose(by_python, view.q, atol=1e-9)
    assert np.allclose(by_command, view.q, atol=1e-9)
    assert "# unreachable" in python


@pytest.mark.parametrize("count", [5, pytest.param(20, marks=pytest.mark.slow)])
def test_texts_of_random_targets_give_what_is_on_the_screen(
    bundled: Callable[[str], Robot], rng: np.random.Generator, count: int
) -> None:
    for name in ("j2n6s300", "j2s6s300"):
        inspector = Inspector(IKSolver(bundled(name), collision="reject"), prefer="manipulability")
        robot = inspector.robot
        seed = robot.home
        for _ in range(count):
            view = inspector.at(robot.forward_kinematics(robot.sample(rng)), seed)
            if view.pending:
                view = inspector.closest(view)
            assert np.allclose(pasted_python(inspector, view)[1], view.q, atol=1e-9)
            seed = view.q if robot.within_limits(view.q) else seed


def test_a_shape_of_another_program_is_said_to_be_left_out() -> None:
    class Cone:
        name = "cone"

        def add_to(self, body: mujoco.MjsBody) -> None:
            body.add_geom(name=self.name, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.01, 0.0, 0.0], pos=[1.0, 1.0, 1.0])

    seen = PointCloud("seen", [[1.0, 1.0, 1.0]])  # whose points are in no text
    inspector = Inspector(IKSolver(jacokin.load_robot(), scene=Scene([Cone(), seen, Floor(-0.5)]), collision="reject"))
    view = inspector.posture(inspector.robot.home)
    for name in ("cone", "seen"):
        assert f"left out, as no text can say what it is: {name}" in pasted_python(inspector, view)[0]
    assert "left out, as no text can hold them: cone, seen" in paste.command_text(inspector, view)
