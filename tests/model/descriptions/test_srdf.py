"""SRDF files: which links need not be looked at for contact."""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin.errors import InvalidInputError, ModelError
from jacokin.model import SelfContact, urdf_folder
from jacokin.model.robot import fingerprint
from tests.robot_files import skeleton

SRDF = '<?xml version="1.0"?><robot name="arm"><group name="g"/>{}</robot>'
PAIR = '<disable_collisions link1="{}" link2="{}" reason="Never"/>'
FOLDED = np.array([0.0, 2.2, 0.0, 2.2])  # the last link comes back to the first ones


def written(folder: Path) -> Path:
    path = folder / "arm.urdf"
    folder.mkdir(parents=True, exist_ok=True)
    shape = (
        '<collision name="{0}_shape"><origin xyz="0 0 0.02"/><geometry><sphere radius="0.03"/></geometry></collision>'
    )
    text = skeleton("j1>l1[-3,3] j2>l2[-3,3] j3>l3[-3,3] j4>l4[-3,3] +tool0")
    path.write_text(
        re.sub(r'<link name="(l\d)"></link>', lambda m: m[0].replace("></", f">{shape.format(m[1])}</"), text)
    )
    return path


def disabled(*pairs: tuple[str, str]) -> str:
    return SRDF.format("".join(PAIR.format(*pair) for pair in pairs))


def touching(robot: jacokin.Robot) -> set[tuple[str, ...]]:
    return {tuple(sorted(pair)) for pair in SelfContact(robot).touching(FOLDED)}


@pytest.mark.parametrize("how", ["beside", "in a folder beside", "given"])
def test_pairs_of_links_that_are_disabled_do_not_count(tmp_path: Path, how: str) -> None:
    path = written(tmp_path / "urdf")
    without = jacokin.load_robot(path)
    assert without.source.disabled is None
    assert ("l1_shape", "l3_shape") in touching(without)
    places = {"beside": path.with_suffix(".srdf"), "in a folder beside": tmp_path / "srdf" / "arm.srdf"}
    srdf = places.get(how, tmp_path / "other.srdf")
    srdf.parent.mkdir(exist_ok=True)
    srdf.write_text(disabled(("l1", "l3"), ("l3", "l1"), ("l2", "no link of this one"), ("tool0", "tool0")))
    robot = jacokin.load_robot(path, srdf=srdf if how == "given" else None)
    assert touching(robot) == touching(without) - {("l1_shape", "l3_shape")}
    assert f"contact between 1 pairs of links does not count, by {srdf}" in robot.notes
    assert SelfContact(robot).pairs == SelfContact(without).pairs - 1
    assert fingerprint(robot, shapes=True) != fingerprint(without, shapes=True)
    srdf.unlink()
    assert touching(pickle.loads(pickle.dumps(robot))) == touching(robot)


def test_a_file_that_merely_lies_there_need_not_be_right(tmp_path: Path) -> None:
    path = written(tmp_path)
    path.with_suffix(".srdf").write_text("<robot><disable_collisions")
    assert any("pairs of links are not disabled: " in note for note in jacokin.load_robot(path).notes)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<robot", "not well-formed XML"),
        ("<sdf/>", "the root element is <sdf>, an SRDF has <robot>"),
        ("<robot><link name='a'/></robot>", "is a URDF, not an SRDF"),
        (SRDF.format('<disable_collisions link1="a"/>'), "a <disable_collisions> has no link2"),
        (SRDF.format("<xacro:arm/>"), "expand it: xacro bad.srdf > out.srdf"),
    ],
)
def test_a_file_that_is_given_must_be_right(tmp_path: Path, text: str, message: str) -> None:
    path, srdf = written(tmp_path), tmp_path / "bad.srdf"
    srdf.write_text(text)
    with pytest.raises(ModelError, match=re.escape(f"{srdf}: ") + ".*" + re.escape(message)):
        jacokin.load_robot(path, srdf=srdf)


def test_descriptions_that_exclude_pairs_themselves_take_none(tmp_path: Path) -> None:
    srdf = tmp_path / "arm.srdf"
    srdf.write_text(disabled(("link_1", "link_3")))
    with pytest.raises(ModelError, match="is an MJCF, which excludes pairs of links itself"):
        jacokin.load_robot(urdf_folder() / "jaco_arm.xml", srdf=srdf)
    with pytest.raises(ModelError, match="is a bundled robot, which excludes"):
        jacokin.load_robot("j2n6s300", srdf=srdf)
    with pytest.raises(ModelError, match=r"^\S*nowhere.srdf: cannot be read: No such file"):
        jacokin.load_robot(written(tmp_path), srdf=tmp_path / "nowhere.srdf")
    with pytest.raises(InvalidInputError, match="srdf must be a file name"):
        jacokin.load_robot(written(tmp_path), srdf=3)  # type: ignore[arg-type]  # wrong on purpose
