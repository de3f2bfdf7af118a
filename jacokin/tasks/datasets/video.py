"""`VideoRecorder`: pictures to a video, by ffmpeg."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import tempfile
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError, MissingExtraError

if TYPE_CHECKING:
    from jacokin.tasks.gym.environment import TaskEnv

RATE = 25  # pictures a second, about, of a film: one for each control step of 0.04 s


class VideoRecorder:
    """Hands pictures to ffmpeg."""

    def __init__(
        self, path: Path, ffmpeg: str, *, keys_every: int | None = None, rate: float = RATE, preset: str = "veryfast"
    ) -> None:
        """Encode to a file, as soon as the first picture tells the size.

        Args:
            path: the file.
            ffmpeg: the program.
            keys_every: pictures from one that stands for itself to the next; None for the encoder's choice.
            rate: pictures a second; `film` chooses its own.
            preset: of the encoder x264: how much time it takes to make the file small.
        """
        self._path, self._ffmpeg, self._rate = path, ffmpeg, rate
        self._looks = 0  # of `film`
        self._preset = preset
        self._keys = [] if keys_every is None else ["-g", str(keys_every)]
        self._complaints = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `close`
        self._process: subprocess.Popen[bytes] | None = None

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Add a picture (height, width, 3).

        Raises:
            InvalidInputError: ffmpeg does not go on.
        """
        if self._process is None:
            height, width = picture.shape[:2]
            raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", str(self._rate), "-i", "-"]
            encoded = [
                "-c:v",
                "libx264",
                "-preset",
                self._preset,
                *self._keys,
                "-pix_fmt",
                "yuv420p",
                "-f",
                "mp4",
                str(self._path),
            ]
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

    def film(self, env: TaskEnv) -> None:
        """Add what an environment draws, so that a second of the video is one of the simulation; call it in each step.

        Of control steps shorter than 0.04 s only so many are drawn that about 25 pictures a second are left.

        Raises:
            InvalidInputError: ffmpeg does not go on.
        """
        every = max(1, round(1.0 / (RATE * env.dt)))
        if self._looks % every == 0:
            picture = env.render()
            assert picture is not None  # render_mode
            self._rate = 1.0 / (every * env.dt)
            self.add(picture)
        self._looks += 1

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
        """Stop ffmpeg if it still runs."""
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
        raise InvalidInputError(f"ffmpeg: {said}")


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
