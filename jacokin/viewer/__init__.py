"""What it looks like: every branch in the browser. Everything public is imported from here; read `view` first.

view, inspector             what to show for a target, as data, and how it is found
texts, shapes               what it says in words; the meshes of the arm
motion                      trajectories that are played, and following the gizmo
serving, viewer, inbox      `serve`, the running viewer, what pages did
browser                     the scene, the controls and the guarded web server of viser
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from jacokin import lazy

if TYPE_CHECKING:
    from jacokin.viewer.inspector import Inspector as Inspector
    from jacokin.viewer.serving import serve as serve
    from jacokin.viewer.view import View as View
    from jacokin.viewer.viewer import Viewer as Viewer

__all__, __getattr__, __dir__ = lazy.door(
    __name__,
    {
        "jacokin.viewer.inspector": ("Inspector",),
        "jacokin.viewer.serving": ("serve",),
        "jacokin.viewer.view": ("View",),
        "jacokin.viewer.viewer": ("Viewer",),
    },
)
