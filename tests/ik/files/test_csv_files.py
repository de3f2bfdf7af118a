"""CSV files: what is read, what is refused by line and column, and answers whose numbers read back to the same bits."""

from __future__ import annotations

import csv
import math
import os
import tempfile
import threading
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import jacokin
from jacokin.errors import InvalidInputError
from jacokin.ik import BatchResult, Status, TargetFile, read_targets
from jacokin.ik.files import csv_files
from jacokin.ik.files.csv_files import read_blocks


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "targets.csv"


def test_quaternions_and_angles_are_the_rotations_of_pose(file: Path, rng: np.random.Generator) -> None:
    quats = rng.normal(size=(50, 4))
    quats /= np.linalg.norm(quats, axis=1)[:, None]
    angles = rng.uniform(-4.0, 4.0, (50, 3))
    rows = "".join(f"0.1,0.2,0.3,{','.join(map(repr, quat))}\n" for quat in quats.tolist())
    read = read_targets(written(file, f"x,y,z,qw,qx,qy,qz\n{rows}"))
    for quat, target in zip(quats, read.targets, strict=True):
        expected = jacokin.pose([0.1, 0.2, 0.3], quat_wxyz=quat).homogeneous
        assert np.allclose(target, expected, rtol=0.0, atol=1e-15)
    rows = "".join(f"0.1,0.2,0.3,{','.join(map(repr, rpy))}\n" for rpy in angles.tolist())
    read = read_targets(written(file, f"x,y,z,roll,pitch,yaw\n{rows}"))
    for rpy, target in zip(angles, read.targets, strict=True):
        expected = jacokin.pose([0.1, 0.2, 0.3], rpy=rpy).homogeneous
        assert np.allclose(target, expected, rtol=0.0, atol=1e-15)


def test_columns_may_stand_in_any_order_beside_remarks(file: Path) -> None:
    text = 'note, z ,y,,x,q1\n"left, then up",3,2,0,1,9\n\n,6,5,1,4,9\n"two\nlines",9,8,2,7,9\n'
    read = read_targets(written(file, text))
    assert read.values.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]]
    assert read.lines.tolist() == [2, 4, 6]


@pytest.mark.parametrize(("mark", "word"), [(";", "semicolons"), ("\t", "tabs")])
def test_columns_that_something_else_separates_are_told(file: Path, mark: str, word: str) -> None:
    written(file, f"{mark.join('xyz')}\n{mark.join(['0,3', '0,2', '0,4'])}\n")
    with pytest.raises(InvalidInputError, match=f"commas separate columns, not {word}, and decimals need a point"):
        read_targets(file)
    with pytest.raises(InvalidInputError, match="found: a, b$"):
        read_targets(written(file, "a,b\n1,2\n"))


def test_other_columns_are_carried_as_they_stand(file: Path) -> None:
    rows = " 007 ,1,2,3,, 1.50,9,1,0,0,0,OK\nÄ#x,1,2,3,a\\,-0,9,1,0,0,0,\n"
    read = read_targets(written(file, f"part no.,x,y,z,rx,force [N],,qw,qx,qy,qz,status\n{rows}"))
    assert read.carried == {"part no.": [" 007 ", "Ä#x"], "rx": ["", "a\\"], "force [N]": [" 1.50", "-0"]}
    file.write_bytes(b'note,x,y,z,more\r\n"a, ""b""\r\nc\n",1,2,3, d\r\n,1,2,3\r\n')
    assert read_targets(file).carried == {"note": ['a, "b"\r\nc\n', ""], "more": [" d", ""]}


def test_a_quaternion_whose_norm_overflows_is_refused(file: Path) -> None:
    with pytest.raises(InvalidInputError, match="norm 1 .within 1 %., got norm 1e.300"):
        read_targets(written(file, "x,y,z,qw,qx,qy,qz\n0.3,0.2,0.4,-1e300,0,0,0\n"))


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_every_line_end_is_read(file: Path, end: str) -> None:
    file.write_bytes(end.join(["x,y,z", "1,2,3", "4,5,6"]).encode())
    assert read_targets(file).values.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y,z\n0,3,-0,2,0,5\n", "line 2: has 6 cells, the header has 3"),  # decimal commas
        ("x,y,z\n1,2,3\n1,2,3,\n", "line 3: has 4 cells"),
        ("x,y,z\n1,2,3\n1,2\n", "line 3, column z: is empty"),
        ("x,y,z,x\n1,2,3,4\n", "line 1: column x is repeated"),
        ("x,y,z,note,note\n1,2,3,,\n", "column note is repeated"),
        ("x,y,z\n1_0,2,3\n", "line 2, column x: '1_0'"),
        ("x,y,z\n1,2,٣\n", "line 2, column z: '٣'"),
        ("x,y,z\n1,2,\uff13\n", "line 2, column z"),
        ("x,y,z\n1,0x2,3\n", "line 2, column y: '0x2'"),
        ("x,y,z\n1,1e400,3\n", "line 2, column y: '1e400' is not a finite number"),
        ("x,y,z\n1,inf,3\n", "line 2, column y"),
        ("x,y,z\n1,2,3\n\n1;2;3\n", "line 4"),
        ("x;y;z\n1;2;3\n", "line 1: column x, y, z is missing"),
        ("x,y,z,rx,ry,rz\n1,2,3,0,0,0\n", "column rx, ry, rz looks like an orientation, which would be lost"),
        ("x,y,z,Qw,Qx,Qy,Qz\n1,2,3,1,0,0,0\n", "line 1: column Qw, Qx, Qy, Qz looks like an orientation"),
        ("x,y,z,roll_deg,pitch_deg,yaw_deg\n1,2,3,0,0,0\n", r"looks like .* or roll, pitch, yaw \[rad\]"),
        ("x,y,z,roll\n1,2,3,0\n", "column pitch, yaw is missing"),
        ("x,y,z,roll,pitch,yaw,qw,qx,qy,qz\n", "given twice"),
        ("X,Y,Z\n1,2,3\n", "column x, y, z is missing"),
        ('x,y,z\n1,2,"3\n', "not a CSV file"),
        ("x,y,z,qw,qx,qy,qz\n0,0,0,1,0,0,0\n0,0,0,0,0,0,0\n", "line 3, columns qw, qx, qy, qz: .* norm 0"),
        ("x,y,z,qw,qx,qy,qz\n0,0,0,1,0,0,0\n0,0,0,0,-1e300,0,0\n", "line 3, columns qw, .* norm 1e\\+300"),
        ("x,y,z,qw,qx,qy,qz\n0,0,0,1e-300,0,1e-200,0\n", "line 2, columns qw, .* norm 1e-200"),
    ],
)
def test_mistakes_are_named_with_their_place(file: Path, text: str, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        read_targets(written(file, text))


@pytest.mark.parametrize("strict", [True, False])
@pytest.mark.parametrize("text", ["1_0", "\u0131nf", "\u0130nfinity"])  # what Python's float and case would take
def test_no_other_script_is_a_number(file: Path, text: str, strict: bool) -> None:
    with pytest.raises(InvalidInputError, match="line 2, column x"):
        list(read_blocks(written(file, f"x,y,z\n{text},2,3\n"), 10, strict=strict))


def test_files_that_are_no_text_files_are_refused(tmp_path: Path, file: Path) -> None:
    file.write_bytes(b"\xff\xfe\x00x")
    with pytest.raises(InvalidInputError, match="UTF-8"):
        read_targets(file)
    with pytest.raises(InvalidInputError, match="it is a folder"):
        read_targets(tmp_path)
    with pytest.raises(InvalidInputError, match="No such file"):
        read_targets(tmp_path / "nowhere.csv")
    loop = tmp_path / "loop.csv"
    loop.symlink_to(loop)
    with pytest.raises(InvalidInputError, match="symbolic links"):
        read_targets(loop)
    with pytest.raises(InvalidInputError, match="null byte"):
        read_targets("a\0b")
    with pytest.raises(InvalidInputError, match="must be a str or a Path"):
        read_targets(7)  # type: ignore[arg-type]  # what is refused


def test_a_pipe_is_read(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    writer = threading.Thread(target=lambda: pipe.write_text("x,y,z\n1,2,3\n"))
    writer.start()
    assert read_targets(pipe).values.tolist() == [[1.0, 2.0, 3.0]]
    writer.join()


finite = st.floats(allow_nan=False, allow_infinity=False)
numbers = (
    finite.map(repr) | finite.map(lambda value: f"{value:.17g}") | st.from_regex(r"[-+]?[0-9]{1,3}\.?", fullmatch=True)
)


@pytest.mark.slow
@settings(max_examples=25)
@given(
    rows=st.lists(st.lists(numbers, min_size=3, max_size=3), min_size=1), size=st.integers(1, 4), quoted=st.booleans()
)
def test_numbers_are_those_of_python_whatever_the_blocks(
    rows: list[list[str]], size: int, quoted: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    file = tmp_path_factory.mktemp("csv") / "targets.csv"
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, quoting=csv.QUOTE_ALL if quoted else csv.QUOTE_MINIMAL)
        writer.writerows([["x", "y", "z"], *rows])
    expected = [[float(number) for number in row] for row in rows]
    parts = list(read_blocks(file, size, strict=True))
    assert np.concatenate([part.values for part in parts]).tolist() == expected
    assert np.concatenate([part.lines for part in parts]).tolist() == list(range(2, len(rows) + 2))
    assert read_targets(file).targets.tolist() == expected


@pytest.mark.parametrize(
    "number", ["-0", "+1", ".5", "1.", "007", "-0.0", "1e-320", "9" * 30, "1E5", "-9223372036854775809"]
)
def test_numbers_that_json_lacks_or_changes_are_read_to_the_bit(file: Path, number: str) -> None:
    file.write_text(f"x,y,z\n1.5,{number},2.5\n0.25,3.5,{number}\n")
    expected = np.array([[1.5, float(number), 2.5], [0.25, 3.5, float(number)]])
    assert read_targets(file).values.tobytes() == expected.tobytes()


@given(text=st.text(alphabet="0123456789.,-+eE_ \n\"'xn\u0663", max_size=60))
def test_any_text_is_numbers_or_one_clear_error(text: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    file = written(tmp_path_factory.mktemp("csv") / "targets.csv", f"x,y,z\n{text}")
    try:
        values = read_targets(file).values
    except InvalidInputError as error:
        message = str(error)
    else:
        message = f"{file.name} has {len(values)} rows"
        assert values.shape[1] == 3
        assert all(math.isfinite(value) for value in values.ravel())
    assert "targets.csv" in message


@settings(max_examples=40)
@given(
    values=arrays(np.float64, (3, 3), elements=st.floats(allow_nan=False)),
    q=arrays(np.float64, (3, 2), elements=st.floats(allow_nan=False)),
    message=st.text(st.characters(codec="utf-8", exclude_characters="\0\r\n")),
)
def test_answers_read_back_to_the_same_bits(values: np.ndarray, q: np.ndarray, message: str) -> None:
    targets = TargetFile(("x", "y", "z"), values, values, np.arange(2, 5))
    errors = np.array([0.0, 1e-300, 0.1])
    batch = BatchResult(
        q=q,
        status=(Status.OK, Status.UNREACHABLE, Status.OK),
        success=np.array([True, False, True]),
        position_error=errors,
        orientation_error=errors[::-1],
        method=("closed_form", "qp", "closed_form"),
        message=(message, "out, far out", ""),
    )
    with tempfile.TemporaryDirectory() as folder:
        piece, whole = Path(folder) / "piece", Path(folder) / "whole"
        piece.write_bytes(b"before" + csv_files.encode(targets, batch))
        csv_files.write_joined(whole, [(piece, len("before"))], [*targets.columns, "q1", "q2"])
        with whole.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    assert [row["message"] for row in rows] == list(batch.message)
    assert [row["status"] for row in rows] == ["OK", "UNREACHABLE", "OK"]
    names = ("x", "y", "z", "q1", "q2", "position_error", "orientation_error")
    read = np.array([[float(row[name]) for name in names] for row in rows])
    assert read.tobytes() == np.column_stack([values, q, errors, errors[::-1]]).tobytes()
