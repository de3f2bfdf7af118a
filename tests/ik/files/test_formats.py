"""Formats of files of targets: parts that are read alone are the blocks of the whole, and endings tell the format."""

from __future__ import annotations

import importlib
import pickle
from pathlib import Path

import numpy as np
import pytest

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, MissingExtraError
from jacokin.ik.files import csv_files, npz_files, parquet_files
from jacokin.ik.files.formats import Format, answers_format, targets_format

SIZE = 16


@pytest.fixture
def values(rng: np.random.Generator) -> Array:
    positions = rng.normal(size=(75, 3))
    positions[20, 1] = np.nan
    return positions


def _compare(path: Path) -> None:
    form = targets_format(path)
    whole, parts = list(form.blocks(path, SIZE)), form.parts(path, SIZE)
    assert [part.rows for part in parts] == [len(block) for block in whole]
    assert all(part.can_be_read for part in parts)
    for first in range(len(parts)):
        for stop in range(first + 1, len(parts) + 1):
            read = list(form.blocks(path, SIZE, parts[first:stop]))
            assert len(read) == stop - first
            for block, wanted in zip(read, whole[first:stop], strict=True):
                np.testing.assert_array_equal(block.values, wanted.values)
                np.testing.assert_array_equal(block.targets, wanted.targets)
                np.testing.assert_array_equal(block.lines, wanted.lines)
                assert block.problems == wanted.problems
                assert block.columns == wanted.columns


def _text(values: Array, end: str) -> str:
    rows = [",".join(["remark", *map(repr, row)]) for row in values.tolist()]
    rows[30:30] = [""] * 40  # a block of blank lines, and some more
    rows[12] += end + "  "
    return end.join(["note,x,y,z", *rows]) + end


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_parts_of_csv_files(tmp_path: Path, values: Array, end: str, encoding: str) -> None:
    (tmp_path / "in.csv").write_bytes(_text(values, end).replace("remark", "Größe").encode(encoding))
    _compare(tmp_path / "in.csv")


@pytest.mark.parametrize(("before", "after"), [("remark", '"re\nmark"'), ("\n", "\r")])
def test_csv_files_whose_lines_are_not_plain_have_no_parts(
    tmp_path: Path, values: Array, before: str, after: str
) -> None:
    path = tmp_path / "in.csv"
    path.write_bytes(_text(values, "\n").replace(before, after).encode())
    assert not any(part.can_be_read for part in targets_format(path).parts(path, SIZE))
    assert sum(part.rows for part in targets_format(path).parts(path, SIZE)) == len(values)


@pytest.mark.parametrize("targets", [False, True])
def test_parts_of_npz_files(tmp_path: Path, values: Array, targets: bool) -> None:
    path = tmp_path / "in.npz"
    arrays = {"targets": np.tile(np.eye(4), (75, 1, 1))} if targets else dict(zip("xyz", values.T, strict=True))
    if targets:
        arrays["targets"][:, :3, 3] = values
    np.savez(path, **arrays, allow_pickle=False)
    _compare(path)
    np.savez_compressed(path, **arrays, allow_pickle=False)
    assert not any(part.can_be_read for part in targets_format(path).parts(path, SIZE))


@pytest.mark.parametrize("group", [1, 7, SIZE, 50, 100])
def test_parts_of_parquet_files(tmp_path: Path, values: Array, group: int) -> None:
    table = importlib.import_module("pyarrow").table(dict(zip("xyz", values.T, strict=True)))
    path = tmp_path / "in.parquet"
    importlib.import_module("pyarrow.parquet").write_table(table, path, row_group_size=group)
    _compare(path)


@pytest.mark.parametrize(
    ("name", "targets", "answers"),
    [
        ("a.csv", csv_files, csv_files),
        ("a.txt", csv_files, None),
        ("a", csv_files, None),
        ("/dev/stdout", csv_files, csv_files),
        ("a.npz", npz_files, npz_files),
        ("a.parquet", parquet_files, parquet_files),
        ("a.xlsx", csv_files, None),
    ],
)
def test_the_ending_tells_the_format(name: str, targets: Format, answers: Format | None) -> None:
    assert targets_format(Path(name)) is targets
    if answers is None:
        with pytest.raises(InvalidInputError, match=r"written as \.csv, \.npz, \.parquet, told by the ending"):
            answers_format(Path(name))
    else:
        assert answers_format(Path(name)) is answers


def test_parquet_without_its_package_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"\.\[parquet\]"):
        answers_format(Path("a.parquet"))


def test_blocks_that_are_sent_are_made_anew(values: Array, tmp_path: Path) -> None:
    np.savez(tmp_path / "in.npz", position=values, rpy=values)
    for block in npz_files.blocks(tmp_path / "in.npz", SIZE):
        pickled = pickle.dumps(block)
        assert len(pickled) < block.targets.nbytes  # the matrices are not among it
        copy = pickle.loads(pickled)
        np.testing.assert_array_equal(copy.targets, block.targets)
        np.testing.assert_array_equal(copy.lines, block.lines)
        assert copy.problems == block.problems
