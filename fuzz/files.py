"""Edits of valid URDF, MJCF and CSV files: each is refused by name, or loads and says what the file says.

What loads is compared with an independent reader: plain NumPy for URDF, MuJoCo's own kinematics for MJCF, Python's
own `csv` for targets.
"""

from __future__ import annotations

import copy
import csv
import io
import re
import tempfile
import traceback
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from pathlib import Path

import mujoco
import numpy as np

import jacokin
from fuzz.findings import Finding
from fuzz.kinematics import rotation_error, urdf_chain
from jacokin.arrays import Array
from jacokin.errors import JacokinError
from jacokin.ik import read_targets
from jacokin.model import Robot, urdf_folder

SAME = 1e-7  # [m] and [rad] between two forward kinematics of one file; edits make coarse axes and far origins
WORDS = (
    "", " ", "nan", "inf", "-inf", "1e400", "-1e300", "1e-320", "0", "-1", "1_0", "0x10", "1,5", "1;5", "0.1 0.2",
    "0 0 0", "1 0 0", "0 0 0 0", "nan 0 0", "1e200 0 0", "\t1\n2 3", "3.14159", "pi", "true", "\u0661\u0662",
    "joint_1", "link_6", "link_base", "continuous", "prismatic", "floating", "planar", "fixed", "hinge", "slide",
    "ball", "free", "../x", "package://x/y",
)  # fmt: skip


def run(seed: int, first: int, cases: int) -> Iterator[tuple[int, int, list[Finding]]]:
    """Case after case, one file each."""
    sources = _sources()
    with tempfile.TemporaryDirectory() as folder:
        for index in range(first, first + cases):
            rng = np.random.default_rng([seed, index])
            name, text = sources[int(rng.integers(len(sources)))]
            path = Path(folder) / f"case{Path(name).suffix}"
            data = edited(name, text, rng)
            path.write_bytes(data)
            yield index, 1, list(check(name, path, rng))


def _sources() -> list[tuple[str, str]]:
    folder = urdf_folder()
    names = ["j2n6s300.urdf", "j2s6s200.urdf", "m1n6s300.urdf", "j2n6s300.xml", "jaco_arm.xml", "j2s6s300.xml"]
    found = [(name, (folder / name).read_text(encoding="utf-8")) for name in names]
    rng = np.random.default_rng(0)
    rows = ["x,y,z,qw,qx,qy,qz"]
    for q in jacokin.load_robot().sample(rng, 12):
        pose = jacokin.load_robot().forward_kinematics(q)
        numbers = [*pose.translation, *jacokin.model.quat_wxyz(pose.rotation)]
        rows.append(",".join(f"{number:.17g}" for number in numbers))
    text = "\n".join(rows) + "\n"
    return (
        found
        + [("poses.csv", text)] * 3
        + [("positions.csv", re.sub(r",q[^\n]*", "", text.split("\n")[0]) + "\n0.3,0.2,0.4\n")]
    )


def edited(name: str, text: str, rng: np.random.Generator) -> bytes:
    """The text after one to three edits."""
    for _ in range(1 + int(rng.integers(3))):
        kind = rng.random()
        if kind < 0.2:
            text = _edit_characters(text, rng)
        elif name.endswith(".csv"):
            text = _edit_cells(text, rng)
        else:
            text = _edit_elements(text, rng)
    data = text.encode("utf-8", "surrogatepass")
    if rng.random() < 0.05:
        data = _edit_bytes(data, rng)
    return data


def _edit_characters(text: str, rng: np.random.Generator) -> str:
    """Cut, repeat or replace a stretch of characters."""
    if not text:
        return "x"
    a = int(rng.integers(len(text)))
    b = min(len(text), a + int(rng.integers(1, 40)))
    return [
        lambda: text[:a] + text[b:],
        lambda: text[:b] + text[a:],
        lambda: text[:a],
        lambda: text[:a] + str(rng.choice(WORDS)) + text[b:],
        lambda: text[:a] + chr(int(rng.integers(1, 300))) + text[a:],
    ][int(rng.integers(5))]()


def _edit_bytes(data: bytes, rng: np.random.Generator) -> bytes:
    """Another encoding, or bytes that are none."""
    a = int(rng.integers(len(data) + 1))
    return [
        lambda: b"\xef\xbb\xbf" + data,
        lambda: data.decode("utf-8", "replace").encode("utf-16"),
        lambda: data[:a] + bytes(rng.integers(0, 256, 4, dtype=np.uint8)) + data[a:],
        lambda: data.replace(b"\n", b"\r\n"),
        lambda: b"\x1f\x8b" + data,
    ][int(rng.integers(5))]()


def _edit_cells(text: str, rng: np.random.Generator) -> str:
    """Change a cell, a row or a column of a table."""
    rows = [line.split(",") for line in text.split("\n")]
    row = rows[int(rng.integers(len(rows)))]
    cell = int(rng.integers(len(row)))
    kind = int(rng.integers(6))
    if kind == 0:
        row[cell] = str(rng.choice(WORDS))
    elif kind == 1:
        del row[cell]
    elif kind == 2:
        row.insert(cell, row[cell])
    elif kind == 3:
        rows.insert(int(rng.integers(len(rows))), list(row))
    elif kind == 4:
        row[cell] = f" {row[cell]} "
    else:
        row[cell] = f'"{row[cell]}"'
    return "\n".join(",".join(row) for row in rows)


def _edit_elements(text: str, rng: np.random.Generator) -> str:
    """Change an attribute or an element of an XML tree."""
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError):
        return _edit_characters(text, rng)
    everything = [(parent, child) for parent in root.iter() for child in parent]
    if not everything:
        return text
    # Joints and bodies are what a robot is made of; shapes are many.
    heavy = [
        pair
        for pair in everything
        if pair[1].tag in ("joint", "body", "origin", "axis", "limit", "link", "parent", "child")
    ]
    pairs = heavy if heavy and rng.random() < 0.7 else everything
    parent, element = pairs[int(rng.integers(len(pairs)))]
    others = everything[int(rng.integers(len(everything)))]
    kind = int(rng.integers(8))
    if kind <= 2 and element.attrib:
        key = str(rng.choice(list(element.attrib)))
        element.set(key, _word(element.attrib[key], rng))
    elif kind == 3 and element.attrib:
        del element.attrib[str(rng.choice(list(element.attrib)))]
    elif kind == 4:
        parent.remove(element)
    elif kind == 5:
        parent.append(copy.deepcopy(element))
    elif kind == 6:
        others[1].append(copy.deepcopy(element))
    else:
        element.tag = others[1].tag
    return ET.tostring(root, encoding="unicode")


def _word(old: str, rng: np.random.Generator) -> str:
    """Another value of an attribute: any word, or one of its numbers changed."""
    numbers = old.split()
    if rng.random() < 0.4 or not numbers:
        return str(rng.choice(WORDS))
    at = int(rng.integers(len(numbers)))
    numbers[at] = str(rng.choice(WORDS)) if rng.random() < 0.4 else f"{rng.normal():.4f}"
    return " ".join(numbers)


def check(name: str, path: Path, rng: np.random.Generator) -> Iterator[Finding]:
    """Load a file and compare what it says."""
    reader = READERS[path.suffix]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            wrong = reader(path, rng)
    except JacokinError:
        return
    except Exception as error:  # whatever else reaches a user is a finding
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{name}: {type(error).__name__} in {Path(place.filename).name}:{place.lineno}"
        yield Finding("raw", where, f"{error}"[:200])
        return
    if wrong:
        yield Finding("wrong", name, wrong)


def _read_urdf(path: Path, rng: np.random.Generator) -> str:
    robot = jacokin.load_robot(path)
    chain = urdf_chain(path.read_text(encoding="utf-8-sig"), robot.joint_names, robot.default_frame, robot.base)
    if chain is None:
        return _sane(robot)
    q = _configurations(robot, rng)
    return _sane(robot) or _different(robot, q, chain.forward(q))


def _read_mjcf(path: Path, rng: np.random.Generator) -> str:
    robot = jacokin.load_robot(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    q = _configurations(robot, rng)
    poses = np.tile(np.eye(4), (len(q), 1, 1))
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, robot.default_frame)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, robot.default_frame)
    if site < 0 and body < 0:
        return f"frame {robot.default_frame!r} is neither a site nor a body"
    for row, T in zip(q, poses, strict=True):
        for joint, angle in zip(robot.joint_names, row, strict=True):
            data.qpos[model.jnt_qposadr[_joint_id(model, joint)]] = angle
        mujoco.mj_kinematics(model, data)
        T[:3, 3] = data.site_xpos[site] if site >= 0 else data.xpos[body]
        T[:3, :3] = (data.site_xmat[site] if site >= 0 else data.xmat[body]).reshape(3, 3)
    return _sane(robot) or _different(robot, q, poses)


def _joint_id(model: mujoco.MjModel, name: str) -> int:
    """Of a joint, or of one without a name, which jacokin calls joint#ID."""
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name)
    return int(name.rpartition("#")[2]) if found < 0 else int(found)


def _read_csv(path: Path, _: np.random.Generator) -> str:
    file = read_targets(path)
    rows = [
        row
        for row in csv.reader(io.StringIO(path.read_text(encoding="utf-8-sig")))
        if any(cell.strip() for cell in row)
    ]
    names = [name.strip() for name in rows[0]]
    plain = np.array([[float(cell) for cell in row] for row in rows[1:]])
    if len(file.targets) != len(plain):
        return f"{len(file.targets)} targets in {len(plain)} rows"
    expected = plain[:, [names.index(axis) for axis in "xyz"]]
    read = file.targets[:, :3, 3] if file.targets.ndim == 3 else file.targets
    return "" if np.array_equal(read, expected) else "positions differ from the file"


READERS: dict[str, Callable[[Path, np.random.Generator], str]] = {
    ".csv": _read_csv,
    ".urdf": _read_urdf,
    ".xml": _read_mjcf,
}


def _configurations(robot: Robot, rng: np.random.Generator) -> Array:
    low = np.where(np.isfinite(robot.lower), robot.lower, -3.0)
    high = np.where(np.isfinite(robot.upper), robot.upper, np.maximum(low, 3.0))
    return np.clip(rng.uniform(low, np.maximum(low, high), (5, robot.dof)), -1e3, 1e3)


def _sane(robot: Robot) -> str:
    if not (robot.lower <= robot.upper).all():
        return f"limits {robot.lower.tolist()} above {robot.upper.tolist()}"
    if not robot.within_limits(robot.home):
        return f"home {robot.home.tolist()} is outside the limits"
    return ""


def _different(robot: Robot, q: Array, expected: Array) -> str:
    own = np.array([robot.forward_kinematics(row).homogeneous for row in q])
    size = max(1.0, float(np.abs(expected[:, :3, 3]).max()))
    position = float(np.abs(own[:, :3, 3] - expected[:, :3, 3]).max()) / size
    angle = float(rotation_error(own[:, :3, :3], expected[:, :3, :3]).max())
    if position <= SAME and angle <= SAME:
        return ""
    return f"forward kinematics of {robot.default_frame!r} differ by {position * size:.3g} m and {angle:.3g} rad"
