"""What was recorded of episodes, and how it is written: arrays or a video."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError
from jacokin.files import replacing

ENDINGS = (".npz", ".mp4")
_RATE = 25  # pictures a second, one for each control step


class Recording:
    """Pictures, or observations with actions and rewards, of one step after the other."""

    def __init__(self, path: Path) -> None:
        """Check where it is to go.

        Raises:
            InvalidInputError: another ending, no such folder, or a video without ffmpeg.
        """
        self._path = path
        if path.suffix not in ENDINGS:
            raise InvalidInputError(f"--record must end in {' or '.join(ENDINGS)}, got {path}")
        if not path.absolute().parent.is_dir():
            raise InvalidInputError(f"--record: there is no folder {path.absolute().parent}")
        self._ffmpeg = shutil.which("ffmpeg")
        if self.is_video and self._ffmpeg is None:
            raise InvalidInputError("--record: videos need the program ffmpeg (Debian: ffmpeg); .npz needs nothing")
        self._columns: dict[str, list[NDArray[np.generic]]] = {}

    @property
    def is_video(self) -> bool:
        """Whether pictures are wanted."""
        return self._path.suffix == ".mp4"

    def add(self, **values: object) -> None:
        """Add a row: one value for each name."""
        for name, value in values.items():
            self._columns.setdefault(name, []).append(np.asarray(value))

    def write(self) -> None:
        """Write the file.

        Raises:
            InvalidInputError: it cannot be written.
        """
        columns = {name: np.stack(rows) for name, rows in self._columns.items()}
        with replacing(self._path) as path:
            if not self.is_video:
                with path.open("wb") as file:
                    np.savez_compressed(file, **columns)  # type: ignore[arg-type]  # numpy's type of keywords is a flag
                return
            self._encode(columns["picture"], path)

    def _encode(self, pictures: NDArray[np.generic], path: Path) -> None:
        height, width = pictures.shape[1:3]
        command = [str(self._ffmpeg), "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"]
        command += [
            "-s",
            f"{width}x{height}",
            "-r",
            str(_RATE),
            "-i",
            "-",
            "-pix_fmt",
            "yuv420p",
            "-f",
            "mp4",
            str(path),
        ]
        done = subprocess.run(command, input=pictures.tobytes(), capture_output=True, check=False)
        if done.returncode:
            raise InvalidInputError(f"--record: ffmpeg: {done.stderr.decode(errors='replace').strip()}")
