"""Files that are endless, huge, forged or damaged: every reader refuses them by name, in little time and memory."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import struct
import sys
import threading
import time
import tracemalloc
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))  # last: the installed package is what gets tested

from fuzz.damage import KINDS, damaged, misfits, sound_files
from jacokin import files
from jacokin.cli.main import main
from jacokin.errors import InvalidInputError, JacokinError, ModelError
from jacokin.ik import read_targets
from jacokin.model import Scene
from jacokin.reachability import bundled, load

LITTLE = 100_000_000  # [byte] that refusing may take
SOON = 3.0  # [s] that it may take, of a test that takes a tenth of that; those that are refused late take minutes


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A sound file of each kind."""
    return sound_files(tmp_path_factory.mktemp("sound"))


def refused(kind: str, path: Path) -> str:
    """The sentence with which a file is refused, soon and in little memory."""
    tracemalloc.start()
    begin = time.process_time()
    try:
        with pytest.raises((InvalidInputError, ModelError)) as caught:
            KINDS[kind](path)
        assert tracemalloc.get_traced_memory()[1] < LITTLE
        assert time.process_time() - begin < SOON
    finally:
        tracemalloc.stop()
    assert str(path) in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("kind", KINDS)
def test_sound_files_are_read(kind: str, sound: dict[str, Path]) -> None:
    KINDS[kind](sound[kind])


@pytest.mark.parametrize("kind", KINDS)
def test_what_has_no_end_is_refused(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "PATIENCE", 0.1)
    ending = kind.partition(".")[2]
    device, pipe, folder = (tmp_path / f"{name}.{ending}" for name in ("device", "pipe", "folder"))
    device.symlink_to("/dev/zero")
    os.mkfifo(pipe)
    folder.mkdir()
    for path in (device, pipe, folder):
        refused(kind, path)


@pytest.mark.parametrize("kind", KINDS)
def test_names_that_no_file_has_are_refused(kind: str, tmp_path: Path) -> None:
    ending = kind.partition(".")[2]
    loop = tmp_path / f"loop.{ending}"
    loop.symlink_to(loop)
    for path in (
        tmp_path / f"none.{ending}",
        tmp_path / f"{'long' * 100}.{ending}",
        tmp_path / "a" / f"b.{ending}",
        loop,
    ):
        assert "cannot be read" in refused(kind, path)
    with pytest.raises((InvalidInputError, ModelError), match="null|NUL|cannot"):
        KINDS[kind](Path(f"a\0b.{ending}"))


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_huge_is_refused(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"sparse.{kind.partition('.')[2]}"
    with path.open("wb") as file:
        file.truncate(10_000_000_000)
    refused(kind, path)


@pytest.mark.one_quick("content")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("content", [b"", b"\0", b"\n" * 1000, b"[" * 800, b'{"a":' * 100_000, b"\xff\xfe" * 99, b'"'])
def test_what_is_something_else_is_refused(kind: str, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / f"other.{kind.partition('.')[2]}"
    path.write_bytes(content)
    refused(kind, path)


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", KINDS)
def test_damage_is_refused_or_read(kind: str, sound: dict[str, Path], tmp_path: Path) -> None:
    rng = np.random.default_rng([7, *kind.encode()])
    path = tmp_path / f"damaged.{kind.partition('.')[2]}"
    whole = sound[kind].read_bytes()
    refusals = 0
    for _ in range(60):
        path.write_bytes(damaged(path.suffix, whole, rng))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                KINDS[kind](path)
            except JacokinError:
                refusals += 1
    assert refusals > 5


MESSAGE = {
    "joint_names": [f"joint_{number}" for number in range(1, 7)],
    "points": [
        {"positions": [0.0, 3, 3.0, 0.0, 0.0, 0.0], "time_from_start": duration}
        for duration in ({"sec": 0, "nanosec": 5}, {"secs": 1, "nsecs": 0}, 2.5)
    ],
}
SCENE = {
    "obstacles": [
        {"shape": "box", "size": [0.1, 0.1, 0.1], "position": [1, 0, 0], "rpy": [0, 0, 1]},
        {"shape": "capsule", "radius": 0.1, "length": 0.2, "position": [1, 1, 1]},
    ],
    "finger_angle": 0.2,
    "allow": [["a", "b"]],
}
PYTHONS = re.compile(r"\w+Error|NoneType|argument|object is|indices|subscriptable|broadcast|codec")


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", ["played.json", "scene.json", "recipe.json", "manifest.json"])
def test_what_a_document_lacks_or_has_wrong_is_said(kind: str, tmp_path: Path) -> None:
    path, document, read = tmp_path / kind, MESSAGE if kind == "played.json" else SCENE, KINDS.get(kind)
    if read is None:
        shutil.copytree(bundled().folder, tmp_path / "map")
        path = tmp_path / "map" / kind
        document = json.loads(path.read_text())
        manifest = json.loads((tmp_path / "map" / "manifest.json").read_text())

        def read(path: Path) -> None:
            if kind == "recipe.json":
                manifest["recipe"] = hashlib.sha256(path.read_bytes()).hexdigest()
                (path.parent / "manifest.json").write_text(json.dumps(manifest))
            repr(load(path.parent))

    lacking = 0
    path.write_text("\ufeff" + json.dumps(document), encoding="utf-8")  # with the mark that Windows puts there
    if kind != "recipe.json":
        read(path)
    for name, is_missing, text in misfits(document):
        path.write_text(text, encoding="utf-8")
        try:
            read(path)
        except JacokinError as error:
            said = str(error)
            assert path.name in said or path.parent.name in said
            assert not PYTHONS.search(said.replace(str(path), "")), (text, said)
            if is_missing and not name.endswith(".npz"):  # a map without one of its chunks is not complete
                assert re.search(rf"\b{name}\b", said.replace(str(path), "")), (text, said)
                lacking += 1
    assert lacking > 1


def archive_of(path: Path, members: dict[str, bytes], compression: int = zipfile.ZIP_DEFLATED) -> None:
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def array_with(header: str, content: bytes = b"", version: int = 1) -> bytes:
    text = header.encode("latin1")
    return b"\x93NUMPY" + bytes([version, 0]) + struct.pack("<H" if version == 1 else "<I", len(text)) + text + content


HEADERS = (
    "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000, 0), }",
    "{'descr': '<U0', 'fortran_order': False, 'shape': (1000000000000,), }",
    "{'descr': '<U1000000000', 'fortran_order': False, 'shape': (3,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (-3,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': (" + "9" * 400 + ",), }",
    "{'descr': '|O', 'fortran_order': False, 'shape': (3,), }",
    "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (3,), }",
    "{'descr': '<M8[ns]', 'fortran_order': False, 'shape': (3,), }",
    "{'descr': 'nothing', 'fortran_order': False, 'shape': (3,), }",
    "{'descr': '<f8', 'fortran_order': False, 'shape': 3, }",
    "{'descr': '<f8', 'fortran_order': '\\d', 'shape': (3,), }",
    "{'descr': '<f8'",
    "'" * 3,
    "(" * 9000,
    "[" * 90,
    "1e999",
    "a.b(",
)


@pytest.mark.one_quick("header")
@pytest.mark.parametrize("header", HEADERS)
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind.endswith(".npz")])
def test_arrays_that_claim_what_is_not_there_are_refused(
    kind: str, header: str, sound: dict[str, Path], tmp_path: Path
) -> None:
    path = tmp_path / "forged.npz"
    with zipfile.ZipFile(sound[kind]) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    for name in ("t.npy", "time.npy", "targets.npy", "joint_1.npy", "points.npy"):
        if name in members:
            members[name] = array_with(header, b"\0" * 24)
    for compression in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        archive_of(path, members, compression)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            refused(kind, path)


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind.endswith(".npz")])
def test_archives_that_unpack_without_end_are_refused(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "bomb.npz"
    for compression in (zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2):
        archive_of(path, {"t.npy": array_with(HEADERS[0], b"\0" * 1000)}, compression)
        refused(kind, path)
    archive_of(path, {f"{number}.npy": b"" for number in range(files.MEMBERS + 1)})
    refused(kind, path)
    archive_of(
        path, {"t.npy": array_with("x" * 9_000_000, version=2), "targets.npy": array_with("x" * 9_000_000, version=2)}
    )
    refused(kind, path)
    # A size that no compressed bytes could stand for, and a list of members as large as the file says.
    archive_of(path, {"t.npy": array_with(HEADERS[0], b"\0" * 1000)})
    content = bytearray(path.read_bytes())
    entry, end = content.index(b"PK\x01\x02"), content.index(b"PK\x05\x06")
    content[entry + 24 : entry + 28] = struct.pack("<I", 4_000_000_000)
    path.write_bytes(content)
    refused(kind, path)
    content[end + 12 : end + 16] = struct.pack("<I", 3_000_000_000)
    path.write_bytes(b"\0" * 1000 + content)
    refused(kind, path)


def test_a_sparse_archive_with_a_large_list_of_members_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sparse.npz"
    size = 3_000_000_000
    with path.open("wb") as file:
        file.truncate(size)
        file.seek(size)
        file.write(b"PK\x05\x06" + struct.pack("<4H2IH", 0, 0, 1, 1, size, 0, 0))
    assert "bytes for a list of its members" in refused("trajectory.npz", path)


def test_arrays_are_bounded_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "many.npz"
    np.savez_compressed(path, a=np.zeros(10_000), b=np.zeros(10_000))
    assert len(files.read_arrays(path, "is not ours")) == 2
    monkeypatch.setattr(files, "ARRAYS", 150_000)
    with pytest.raises(InvalidInputError, match="is not ours: its arrays have more than 150000 bytes"):
        files.read_arrays(path, "is not ours")


def test_texts_that_are_not_unicode_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "texts.npz"
    for code in (0x110000, 0xFFFFFFFF, 0xD800):
        header = "{'descr': '<U2', 'fortran_order': False, 'shape': (1,), }"
        archive_of(path, {"joint_names.npy": array_with(header, struct.pack("<2I", 97, code))})
        assert "not Unicode" in refused("trajectory.npz", path)


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("kind", ["<f8", ">f8", "<f4", "<i8", "|u1", "|b1", "<c16", "<U3", ">U3", "|S3", "<f2"])
def test_arrays_come_back_to_the_same_bits(kind: str, order: str, tmp_path: Path, rng: np.random.Generator) -> None:
    array = np.asarray(rng.integers(0, 2, (3, 4, 5)).astype(kind), order=order)  # type: ignore[call-overload]  # either
    for save in (np.savez, np.savez_compressed):
        save(tmp_path / "a.npz", array=array, empty=array[:0], single=array[0, 0, 0])
        read = files.read_arrays(tmp_path / "a.npz", "is not ours")
        assert read["array"].dtype == array.dtype
        assert read["array"].tobytes() == array.tobytes()
        assert read["empty"].shape == (0, 4, 5)
        assert read["single"] == array[0, 0, 0]
        read["array"][0] = read["array"][1]  # as NumPy's own, they can be changed


BOMBS = {
    "aliases": "a0: &a0 [x]\n" + "".join(f"a{k + 1}: &a{k + 1} [*a{k}, *a{k}, *a{k}]\n" for k in range(40)),
    "merges": "a0: &a0 {x: 1}\n" + "".join(f"a{k + 1}: &a{k + 1} {{<<: [*a{k}, *a{k}, *a{k}]}}\n" for k in range(40)),
    "cycle": "obstacles: &a [*a]\n",
    "sexagesimal": "obstacles: " + "1:" * 20_000 + "1\n",
    "sexagesimal float": "obstacles: " + "1:" * 300 + "1.5\n",
    "digits": "obstacles: " + "1" * 20_000 + "\n",
    "number": "obstacles: !!int ''\n",
    "timestamp": "obstacles: !!timestamp x\n",
    "date": "obstacles: 2001-99-99\n",
    "object": "obstacles: !!python/object/apply:os.system [true]\n",
    "key": "? [1, 2]\n: 3\n",
    "documents": "--- 1\n--- 2\n",
    "deep": "obstacles: " + "- " * 50_000 + "\n",
}


@pytest.mark.parametrize("name", BOMBS)
def test_yaml_that_multiplies_is_refused(name: str, tmp_path: Path) -> None:
    path = tmp_path / "bomb.yaml"
    path.write_text(BOMBS[name])
    refused("scene.yaml", path)


def test_yaml_with_a_few_aliases_is_read(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(
        "- &post {shape: box, name: a, size: [0.1, 0.1, 1], position: [0.5, 0, 0.5]}\n"
        "- {<<: *post, name: b, position: [0.5, 0.5, 0.5]}\n"
    )
    assert [each.name for each in Scene.load(path).obstacles] == ["a", "b"]


@pytest.mark.parametrize(
    "text",
    [
        "a" + ".a" * 50_000 + " = 1",
        "[" + "a." * 50_000 + "a]",
        "a = " + "[" * 5000,
        "a = 1\n" * 60_000,
        "a = " + "1" * 900_000,
    ],
)
def test_toml_that_takes_long_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "bomb.toml"
    path.write_text(text)
    refused("calibration.toml", path)


@pytest.mark.slow
def test_rows_without_an_end_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "rows.csv"
    for text in (
        "x,y,z\n" + "1," * 100_000 + "\n",
        "x,y,z\n" + '"a\n",' * 50_000,
        "x" * 200_000,
        'x,y,z\n"' + "a\n" * 200_000,
    ):
        path.write_text(text)
        for kind in ("targets.csv", "trajectory.csv", "measurements.csv"):
            refused(kind, path)


def test_rows_that_are_held_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "many.csv"
    monkeypatch.setattr(files, "HELD", 1000)
    path.write_text("x,y,z\n" + "1,2,3\n" * 1000)
    for kind in ("trajectory.csv", "measurements.csv"):
        assert "has more than 1000 rows" in refused(kind, path)
    path.write_text("\n" * 100_000 + "a,b\n")
    assert files.read_rows(path) == [(100_001, ["a", "b"])]
    assert len(read_targets(_written(tmp_path / "targets.csv", "x,y,z\n" + "0.1,0.2,0.3\n" * 2000)).targets) == 2000


def _written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_a_pipe_is_read_to_its_end(tmp_path: Path) -> None:
    read_end, write_end = os.pipe()
    with os.fdopen(write_end, "wb") as file:
        file.write(b"x,y,z\n0.1,0.2,0.3\n")
    try:
        assert len(read_targets(f"/dev/fd/{read_end}").targets) == 1
    finally:
        os.close(read_end)


def test_a_pipe_without_an_end_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "TABLE", 10_000)
    read_end, write_end = os.pipe()
    with os.fdopen(write_end, "wb") as file:
        file.write(b"x,y,z\n" + b"0.1,0.2,0.3\n" * 1000)
    try:
        with pytest.raises(InvalidInputError, match="is larger than the 10000 bytes"):
            read_targets(f"/dev/fd/{read_end}")
    finally:
        os.close(read_end)


def test_a_late_writer_is_waited_for(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)

    def write() -> None:
        time.sleep(0.2)
        with pipe.open("wb") as file:
            time.sleep(0.2)
            file.write(b"x,y,z\n0.1,0.2,0.3\n")

    writer = threading.Thread(target=write)
    writer.start()
    assert len(read_targets(pipe).targets) == 1
    writer.join()


@pytest.mark.one_quick
@pytest.mark.parametrize(
    "words",
    [
        ("ik", "--targets", "{}.csv"),
        ("ik", "--targets", "{}.npz"),
        ("ik", "--targets", "{}.csv", "--output", "out.csv"),
        ("ik", "--position", "0.3", "0.1", "0.4", "--scene", "{}.yaml"),
        ("ik", "--position", "0.3", "0.1", "0.4", "--scene", "{}.json"),
        ("ik", "--position", "0.3", "0.1", "0.4", "--calibration", "{}.toml"),
        ("view", "--trajectory", "{}.npz"),
        ("view", "--trajectory", "{}.json"),
        ("calibrate", "{}.csv", "--sigma", "0.001"),
        ("calibrate", "{}.npz", "--sigma", "0.001"),
        ("teleop", "--stream", "{}.npz"),
    ],
)
def test_commands_refuse_them_in_one_sentence(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(files, "PATIENCE", 0.1)
    monkeypatch.chdir(tmp_path)
    ending = next(word for word in words if word.startswith("{}"))[2:]
    (tmp_path / f"zero{ending}").symlink_to("/dev/zero")
    os.mkfifo(tmp_path / f"pipe{ending}")
    with (tmp_path / f"sparse{ending}").open("wb") as file:
        file.truncate(10_000_000_000)
    archive_of(tmp_path / f"forged{ending}", {"t.npy": array_with("("), "targets.npy": array_with("'''")})
    for name in ("zero", "pipe", "sparse", "forged"):
        with pytest.raises(SystemExit) as left:
            main([word.format(name) for word in words])
        said = capsys.readouterr().err
        assert left.value.code == 2, said
        assert "internal error" not in said
        assert f"{name}{ending}" in said
