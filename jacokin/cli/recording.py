"""What is recorded of episodes: arrays, or a video that is encoded while the episodes run."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from jacokin import files
from jacokin.errors import InvalidInputError, MissingExtraError

ARRAYS, VIDEO = ".npz", ".mp4"
_RATE = 25  # pictures a second, one for each control step


class Recorder(Protocol):
    """Takes what belongs to one step after the other."""

    def add(self, **values: object) -> None:
        """Add a row: one value for each name."""


class ArrayRecorder:
    """Keeps everything until it is written."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._columns: dict[str, list[NDArray[np.generic]]] = {}

    def add(self, **values: object) -> None:
        """Add a row: one value for each name."""
        for name, value in values.items():
            self._columns.setdefault(name, []).append(np.asarray(value))

    def write(self, path: Path) -> None:
        """Write one array for each name, with the rows along its first axis."""
        columns = {name: np.stack(rows) for name, rows in self._columns.items()}
        with path.open("wb") as file:
            np.savez_compressed(file, **columns)  # type: ignore[arg-type]  # numpy's type of keywords is a flag


class VideoRecorder:
    """Hands pictures to ffmpeg."""

    def __init__(self, path: Path, ffmpeg: str) -> None:
        """Encode to a file, as soon as the first picture tells the size."""
        self._path, self._ffmpeg = path, ffmpeg
        self._complaints = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `close`
        self._process: subprocess.Popen[bytes] | None = None

    def add(self, **values: object) -> None:
        """Add the picture (height, width, 3), uint8.

        Raises:
            InvalidInputError: ffmpeg does not go on.
        """
        picture = np.ascontiguousarray(values["picture"], dtype=np.uint8)
        if self._process is None:
            height, width = picture.shape[:2]
            raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", str(_RATE), "-i", "-"]
            encoded = ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-f", "mp4", str(self._path)]
            self._process = subprocess.Popen(
                [self._ffmpeg, "-y", "-loglevel", "error", *raw, *encoded],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=self._complaints,
                start_new_session=True,  # Ctrl-C is for this process, which then ends the other
            )
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(picture.tobytes())
        except OSError:
            self._fail()

    def finish(self) -> None:
        """Wait until the file is complete.

        Raises:
            InvalidInputError: ffmpeg has failed.
        """
        if self._process is None:
            return
        with contextlib.suppress(OSError):  # told by the exit code
            self._process.communicate()
        if self._process.returncode:
            self._fail()

    def close(self) -> None:
        """End what still runs."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            assert self._process.stdin is not None
            with contextlib.suppress(OSError):  # what was not handed over is lost
                self._process.stdin.close()
        self._complaints.close()

    def _fail(self) -> None:
        assert self._process is not None
        self._process.wait()
        self._complaints.seek(0)
        said = self._complaints.read().decode(errors="replace").strip() or f"exit code {self._process.returncode}"
        raise InvalidInputError(f"--record: ffmpeg: {said}")


def is_video(path: Path | None) -> bool:
    """Whether pictures are to be recorded."""
    return path is not None and path.suffix == VIDEO


@contextlib.contextmanager
def recorder(path: Path) -> Iterator[Recorder]:
    """Record to a file, which is there when the block has ended well and untouched otherwise.

    Raises:
        InvalidInputError: another ending, or a file that cannot be written; before the block runs.
        MissingExtraError: a video, and no ffmpeg.
    """
    if path.suffix not in (ARRAYS, VIDEO):
        raise InvalidInputError(f"--record must end in {ARRAYS} or {VIDEO}, got {path}")
    if not path.absolute().parent.is_dir():
        raise InvalidInputError(f"--record: there is no folder {path.absolute().parent}")
    ffmpeg = find_ffmpeg() if is_video(path) else ""
    with files.replacing(path) as unfinished:
        if not is_video(path):
            arrays = ArrayRecorder()
            yield arrays
            arrays.write(unfinished)
            return
        video = VideoRecorder(unfinished, ffmpeg)
        try:
            yield video
            video.finish()
        finally:
            video.close()


def find_ffmpeg() -> str:
    """The program that encodes videos: that of the machine, or the one in the package imageio-ffmpeg.

    Raises:
        MissingExtraError: there is neither.
    """
    found = os.environ.get("IMAGEIO_FFMPEG_EXE") or shutil.which("ffmpeg")
    if found:
        return found
    if find_spec("imageio_ffmpeg") is None:
        raise MissingExtraError("ffmpeg", "video")
    import imageio_ffmpeg

    return str(imageio_ffmpeg.get_ffmpeg_exe())
