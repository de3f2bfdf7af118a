"""`Window`: MuJoCo's own viewer, looking at a simulation that it cannot change."""

from __future__ import annotations

import atexit
import os
import sys
import threading
import warnings

import mujoco

from jacokin.errors import PhysicsError
from jacokin.showing import has_display

CLOSING = 5.0  # [s] that the viewer's thread is given to end


class Window:
    """An open window; what is done in it with the mouse does not reach the simulation."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Open it.

        Raises:
            PhysicsError: there is no display, or on macOS the program does not run under ``mjpython``.
        """
        check_display()
        import glfw  # comes with MuJoCo; asked first, because its viewer waits for ever where this fails
        import mujoco.viewer

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # glfw warns of what is raised here
            if sys.platform != "darwin" and not glfw.init():
                raise PhysicsError("no window can be opened on the display; use 'rgb_array' and MUJOCO_GL=egl")
        self._model, self._shown = model, mujoco.MjData(model)
        before = set(threading.enumerate())
        try:
            self._handle = mujoco.viewer.launch_passive(model, self._shown, show_left_ui=False, show_right_ui=False)
        except RuntimeError as error:
            raise PhysicsError(f"no window can be opened: {error}") from error
        self._threads = set(threading.enumerate()) - before
        # MuJoCo ends its graphics when Python exits, and crashes where the thread of a window still draws.
        atexit.register(self.close)

    def show(self, data: mujoco.MjData) -> None:
        """Draw a state; nothing, once the window was closed by hand."""
        mujoco.mj_copyData(self._shown, self._model, data)
        self._handle.sync()

    def close(self) -> None:
        """Close it and wait for its thread; may be called again."""
        atexit.unregister(self.close)
        self._handle.close()
        for thread in self._threads:
            thread.join(CLOSING)


def is_usable(render_mode: str) -> bool:
    """Whether the system has what a render mode needs: a display, or for pictures a renderer without one."""
    return has_display() or (render_mode != "human" and os.environ.get("MUJOCO_GL", "").lower() in ("egl", "osmesa"))


def check_display() -> None:
    """Refuse a window where the system names no display.

    Raises:
        PhysicsError: it does not.
    """
    if not is_usable("human"):
        raise PhysicsError("render_mode='human' needs a display; without one use 'rgb_array' and MUJOCO_GL=egl")
