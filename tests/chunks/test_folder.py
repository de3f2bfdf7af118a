"""Folders of chunks: what is kept, what is found damaged, and which folders are refused."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from jacokin.chunks import folder
from jacokin.chunks.folder import RECIPE, TEMPORARY, ChunkFolder, Keeper, Recipe, digest, file_digest
from jacokin.errors import InvalidInputError, JacokinError

WORK = {"version": "1", "options": {"rows": 8, "seed": [0.1, 0.2]}}


@pytest.fixture
def place(tmp_path: Path) -> Path:
    return tmp_path / "work"


def opened(place: Path, recipe: Recipe = WORK, count: int = 3) -> ChunkFolder:
    return ChunkFolder(place, recipe, count, ".chunk")


def kept(chunks: ChunkFolder, index: int, content: bytes) -> Path:
    return chunks.put(index, chunks.keeper.keep(index, content))


def test_what_was_kept_is_found_in_any_order(place: Path) -> None:
    chunks = opened(place)
    assert chunks.is_empty()
    paths = {index: kept(chunks, index, f"chunk {index}".encode()) for index in (2, 0)}
    assert not chunks.is_empty()
    assert opened(place).finished() == paths
    assert [paths[index].read_bytes() for index in (0, 2)] == [b"chunk 0", b"chunk 2"]
    assert all(path.name.startswith(f"{index:06d}-{digest(path.read_bytes())[:16]}") for index, path in paths.items())


@pytest.mark.parametrize("damage", [lambda data: data[:-1], lambda data: b"", lambda data: data + b"x"])
def test_a_damaged_chunk_is_removed(place: Path, damage: Callable[[bytes], bytes]) -> None:
    chunks = opened(place)
    first, second = kept(chunks, 0, b"first"), kept(chunks, 1, b"second")
    first.write_bytes(damage(first.read_bytes()))
    assert chunks.finished() == {1: second}
    assert not first.exists()


def test_chunks_beyond_the_last_and_other_files_do_not_count(place: Path) -> None:
    chunks = opened(place, count=3)
    kept(chunks, 7, b"of a longer run")
    (place / "note.txt").write_text("mine")
    assert chunks.finished() == {}


@pytest.mark.parametrize("why", ["elsewhere", "another recipe", "read only"])
def test_content_comes_back_from_machines_that_cannot_write(
    place: Path, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    chunks = opened(place)
    keeper = chunks.keeper
    if why == "elsewhere":
        keeper = Keeper(place.parent / "nowhere", keeper.recipe, keeper.suffix)
    elif why == "another recipe":
        keeper = Keeper(keeper.folder, digest(b"other"), keeper.suffix)

    def refuse(path: Path, content: bytes) -> None:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    with monkeypatch.context() as patch:
        if why == "read only":
            patch.setattr(folder, "write", refuse)
        assert keeper.keep(1, b"content") == b"content"
    assert chunks.is_empty()
    assert chunks.put(1, b"content").read_bytes() == b"content"
    assert list(chunks.finished()) == [1]


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EIO, errno.EACCES])
def test_a_disk_that_fails_is_an_error_that_says_what_is_kept(
    place: Path, error: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    chunks = opened(place)

    def fail(path: Path, content: bytes) -> None:
        raise OSError(error, os.strerror(error))

    monkeypatch.setattr(folder, "write", fail)
    with pytest.raises(JacokinError, match=f"cannot be written: {os.strerror(error)}; finished chunks"):
        chunks.put(0, b"content")


def test_a_file_appears_as_a_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match="No space"):
        folder.write(tmp_path / "file", b"content")
    assert list(tmp_path.iterdir()) == []


def test_the_same_recipe_continues_and_another_one_says_what_differs(place: Path) -> None:
    kept(opened(place), 0, b"first")
    assert list(opened(place).finished()) == [0]
    other = {"version": "2", "options": {"rows": 8, "seed": list(range(100))}}
    with pytest.raises(InvalidInputError) as refused:
        opened(place, other)
    message = str(refused.value)
    assert "differs in options.seed ([0.1,0.2] there, [0,1,2,3" in message
    assert 'version ("1" there, "2" here)' in message
    assert "rows" not in message
    assert list(opened(place).finished()) == [0]


def test_a_recipe_without_chunks_gives_way_to_another_one(place: Path) -> None:
    opened(place)
    (place / f".0123456789abcdef{TEMPORARY}").touch()  # of a process that was killed before its first chunk
    other = WORK | {"version": "2"}
    kept(opened(place, other), 0, b"first")
    with pytest.raises(InvalidInputError, match="another recipe"):
        opened(place)
    assert list(opened(place, other).finished()) == [0]


@pytest.mark.parametrize("shared", [True, False])
def test_a_folder_that_somebody_works_on_keeps_its_recipe(place: Path, *, shared: bool) -> None:
    chunks = opened(place)
    with chunks.locked(shared=shared), pytest.raises(InvalidInputError, match="another recipe"):
        opened(place, WORK | {"version": "2"})
    opened(place, WORK | {"version": "2"})
    with pytest.raises(InvalidInputError, match="another process"), chunks.locked(shared=shared):
        pass
    assert chunks.keeper.keep(0, b"late") == b"late"  # a worker that goes on writes nothing into it


def test_several_share_a_folder_and_the_last_one_that_fails_removes_it(place: Path) -> None:
    with contextlib.suppress(KeyboardInterrupt), opened(place).locked(shared=True):
        with contextlib.suppress(KeyboardInterrupt), opened(place).locked(shared=True):
            raise KeyboardInterrupt
        assert place.exists()
        with pytest.raises(InvalidInputError, match="another process"), opened(place).locked():
            pass
        raise KeyboardInterrupt
    assert not place.exists()


@pytest.mark.parametrize(
    ("recipe", "message"),
    [
        (b"{", "is not JSON"),
        (b"[1]", "is not a recipe"),
        (b'{"flour": 250}', "differs in flour"),
        (None, "with other things in it"),
    ],
)
def test_folders_of_something_else_are_refused(place: Path, recipe: bytes | None, message: str) -> None:
    place.mkdir()
    (place / (RECIPE if recipe is not None else "photo.jpg")).write_bytes(recipe or b"")
    with pytest.raises(InvalidInputError, match=message):
        opened(place)


def test_a_file_in_place_of_the_folder_is_refused(place: Path) -> None:
    place.write_text("mine")
    with pytest.raises(InvalidInputError, match="cannot be used"):
        opened(place)
    assert place.read_text() == "mine"


def test_what_killed_processes_left_does_not_disturb(place: Path) -> None:
    place.mkdir()
    left = place / f".0123456789abcdef{TEMPORARY}"
    left.write_bytes(b"half")
    chunks = opened(place)
    path = kept(chunks, 0, b"first")
    assert chunks.finished() == {0: path}
    chunks.remove_unfinished()
    assert not left.exists()
    assert path.exists()


def test_removing_leaves_nothing(place: Path) -> None:
    chunks = opened(place)
    kept(chunks, 0, b"first")
    (place / f".0123456789abcdef{TEMPORARY}").touch()
    chunks.remove()
    assert not place.exists()


def test_files_of_others_are_not_removed(place: Path) -> None:
    chunks = opened(place)
    kept(chunks, 0, b"first")
    (place / "note.txt").write_text("mine")
    with pytest.raises(OSError, match="not empty"):
        chunks.remove()
    assert [path.name for path in place.iterdir()] == ["note.txt"]


def test_the_digest_of_a_file_is_that_of_its_content(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"content" * 10_000)
    assert file_digest(tmp_path / "file") == digest(b"content" * 10_000)
