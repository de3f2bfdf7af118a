"""Damaged files of every kind that is read: bytes changed, cut and spliced, checksums repaired or not.

Each is refused by an error of jacokin, or read; nothing else is raised, and no memory or time is lost on it.
"""

from __future__ import annotations

import io
import json
import tempfile
import time
import traceback
import warnings
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import jacokin
from fuzz.findings import Finding
from jacokin.calibration import Measurements
from jacokin.errors import JacokinError
from jacokin.ik.files.formats import targets_format
from jacokin.logs import Log
from jacokin.model import PointCloud, Scene
from jacokin.model.measured_arm import MeasuredArm, MeasuredJoint
from jacokin.motion import Trajectory, move_joints
from jacokin.teleop.streams import Stream
from jacokin.viewer.contents import Playback

SLOW = 5.0  # [s] that a small file may take


def _targets(path: Path) -> None:
    form = targets_format(path)
    form.parts(path, 100)
    for block in form.blocks(path, 100):
        len(block)


def _playback(path: Path) -> None:
    Playback(path, jacokin.load_robot())


def _measurements(path: Path) -> None:
    Measurements.load(path, sigma=1e-3)


def _log(path: Path) -> None:
    log = Log(path, jacokin.load_robot())
    log.recording()
    log.standstills()


def _cloud(path: Path) -> None:
    PointCloud.load(path, name="cloud")


#: How each kind is read, by a name whose ending is that of the file.
KINDS: dict[str, Callable[[Path], object]] = {
    "scene.yaml": Scene.load,
    "scene.json": Scene.load,
    "cloud.ply": _cloud,
    "cloud.npz": _cloud,
    "calibration.toml": MeasuredArm.load,
    "trajectory.csv": Trajectory.load,
    "trajectory.npz": Trajectory.load,
    "played.json": _playback,
    "played.kinova.csv": _playback,
    "targets.csv": _targets,
    "targets.npz": _targets,
    "targets.npy": _targets,
    "targets.parquet": _targets,
    "measurements.csv": _measurements,
    "measurements.npz": _measurements,
    "measurements.parquet": _measurements,
    "stream.npz": Stream.load,
    "log.bag": _log,
    "log.mcap": _log,
    "log.db3": _log,
}


def run(seed: int, first: int, cases: int) -> Iterator[tuple[int, int, list[Finding]]]:
    """Case after case, one file each."""
    with tempfile.TemporaryDirectory() as folder:
        sound = {kind: path.read_bytes() for kind, path in sound_files(Path(folder)).items()}
        for index in range(first, first + cases):
            rng = np.random.default_rng([seed, index])
            kind = list(KINDS)[int(rng.integers(len(KINDS)))]
            path = Path(folder) / f"damaged.{kind.partition('.')[2]}"
            path.write_bytes(damaged(path.suffix, sound[kind], rng))
            yield index, 1, list(_check(kind, path))


def _check(kind: str, path: Path) -> Iterator[Finding]:
    begin = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            KINDS[kind](path)
    except JacokinError:
        pass
    except Exception as error:  # whatever else reaches a user is a finding
        place = traceback.extract_tb(error.__traceback__)[-1]
        yield Finding(
            "raw", f"{kind}: {type(error).__name__} in {Path(place.filename).name}:{place.lineno}", f"{error}"[:200]
        )
    if time.process_time() - begin > SLOW:
        yield Finding("slow", kind, f"{time.process_time() - begin:.0f} s for {path.stat().st_size} bytes")


def sound_files(folder: Path) -> dict[str, Path]:
    """One sound file of each kind, in a folder."""
    robot = jacokin.load_robot()
    rng = np.random.default_rng(0)
    found = {kind: folder / kind for kind in KINDS}
    box = "{shape: box, size: [0.1, 0.2, 0.3], position: [1, 0, 0], rpy: [0, 0, 1]}"
    found["scene.yaml"].write_text(f"obstacles: [{box}, {{shape: floor}}]\nfinger_angle: 0.2\nallow: [[a, b]]\n")
    found["scene.json"].write_text('{"obstacles": [{"shape": "floor", "name": "f", "height": -0.1}], "allow": []}')
    for kind in ("cloud.ply", "cloud.npz"):
        PointCloud("cloud", rng.normal(size=(5, 3))).save(found[kind])
    joints = tuple((name, MeasuredJoint()) for name in robot.joint_names)
    MeasuredArm(robot.name, "0123abcd", joints, (("tool", 0.1),)).save(found["calibration.toml"])
    motion = move_joints(robot, robot.home, robot.home + 0.1, dt=0.1)
    for kind in ("trajectory.csv", "trajectory.npz", "played.json", "played.kinova.csv"):
        motion.save(found[kind])
    q = robot.sample(rng, 5)
    T = np.array([robot.forward_kinematics(row).homogeneous for row in q])
    columns = {name: T[:, place, 3] for place, name in enumerate("xyz")}
    names = [f"joint_{number}" for number in range(1, 7)]
    measured = {**dict(zip(names, q.T, strict=True)), **columns}
    np.save(found["targets.npy"], T)
    np.savez(found["targets.npz"], targets=T, note=np.array(list("abcde")), age=np.arange(5))
    np.savez_compressed(found["measurements.npz"], **measured)
    np.savez(found["stream.npz"], time=np.arange(5.0), hand=np.ones((5, 7)))
    for kind, table in (("targets", {**columns, "note": [1, 2, 3, 4, 5]}), ("measurements", measured)):
        rows = ["", *(",".join(map(str, row)) for row in zip(*table.values(), strict=True))]
        found[f"{kind}.csv"].write_text(",".join(table) + "\n".join(rows) + "\n")
        _write_parquet(found[f"{kind}.parquet"], table)
    _write_logs({kind: path for kind, path in found.items() if kind.startswith("log.")}, robot)
    return found


def _write_logs(files: Mapping[str, Path], robot: jacokin.Robot) -> None:
    """An arm that stands still for two seconds, and what is measured of its hand."""
    from tests.logs.recordings import joint_state, pose, write

    T = robot.forward_kinematics(robot.home).homogeneous
    for file in files.values():
        times = [0.1 * number for number in range(20)]
        said = [joint_state("/joint_states", time, robot.joint_names, robot.home) for time in times]
        with tempfile.TemporaryDirectory() as folder:
            written = write(Path(folder), file.suffix, [*said, *(pose("/hand", time, T) for time in times)])
            file.write_bytes(written.read_bytes())


def _write_parquet(path: Path, table: dict[str, object]) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table(table), path)


def damaged(ending: str, whole: bytes, rng: np.random.Generator) -> bytes:
    """A file with one to four wounds; half of the archives have their checksums repaired."""
    if ending != ".npz" or rng.random() < 0.5:
        return _wounded(whole, rng)
    with zipfile.ZipFile(io.BytesIO(whole)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    chosen = list(members)[int(rng.integers(len(members)))]
    # Headers are short, and where most of what can go wrong is said.
    split = int.from_bytes(members[chosen][8:10], "little") + 10 if rng.random() < 0.7 else len(members[chosen])
    members[chosen] = _wounded(members[chosen][:split], rng) + members[chosen][split:]
    if rng.random() < 0.2:
        del members[list(members)[int(rng.integers(len(members)))]]
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)[int(rng.integers(2))]) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return stream.getvalue()


#: What is in the place of something else in a document, as JSON.
MISFITS = (
    "null",
    '"text"',
    '"1.0"',
    "[]",
    "{}",
    "[1, 2]",
    "NaN",
    "1e400",
    "true",
    "9" * 400,
    "[[1], [1, 2]]",
    "[" * 900 + "]" * 900,
)


def misfits(document: object) -> Iterator[tuple[str, bool, str]]:
    """Documents in which something is missing or wrong: its name, whether it is missing, and the text, JSON.

    Of a list the first item is wrong.
    """

    def changed(part: Any, name: str) -> Iterator[tuple[str, bool, str]]:
        for key, value in list(part.items() if isinstance(part, dict) else enumerate(part[:1])):
            inner = key if isinstance(key, str) else name
            for misfit in MISFITS:
                part[key] = mark
                yield inner, False, json.dumps(document).replace(json.dumps(mark), misfit)
            if isinstance(part, dict):
                del part[key]
                yield inner, True, json.dumps(document)
            part[key] = value
            if isinstance(value, dict | list):
                yield from changed(value, inner)

    mark = "what is here instead"
    yield from changed(document, "")


def _wounded(data: bytes, rng: np.random.Generator) -> bytes:
    for _ in range(1 + int(rng.integers(4))):
        a, b = sorted(int(at) for at in rng.integers(0, len(data) + 1, 2))
        short = min(b, a + int(rng.integers(1, 9)))
        kind = int(rng.integers(7))
        if kind == 0:
            data = data[:a] + bytes(rng.integers(0, 256, short - a, dtype=np.uint8)) + data[short:]
        elif kind == 1 and a < len(data):
            data = data[:a] + bytes([data[a] ^ (1 << int(rng.integers(8)))]) + data[a + 1 :]
        elif kind == 2:
            data = data[:a] + data[short:]
        elif kind == 3:
            data = data[:b] + data[a:]
        elif kind == 4:
            data = data[:a] + WORDS[int(rng.integers(len(WORDS)))] + data[short:]
        elif kind == 5:
            data = data[:a] + data[short:] + data[a:short]
        elif rng.random() < 0.3:
            data = data[:a]
    return data


WORDS = (
    b"nan", b"inf", b"-1", b"1e400", b"9" * 30, b"1e999", b"0", b"''", b'"', b"\\", b"(", b")", b"[", b"{", b"}",
    b"<f8", b"|O", b"<U9", b"True", b"None", b"\n", b"\r", b"\0", b"\xff", b",", b",,", b":", b"#", b"&a", b"*a",
    b"!!int", b"1:1", b"\xed\xa0\x80", b"\xf4\x90\x80\x80", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"PK\x05\x06",
    b"PK\x01\x02", b"[1]", b"{}", b'"x"', b"1e5", b"-0.0",
)  # fmt: skip
