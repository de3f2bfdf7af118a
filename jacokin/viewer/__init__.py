"""What it looks like: every branch in the browser. Everything public is imported from here; read `view` first.

view                        what to show for a target, as data
texts                       what it says in words
shapes                      the meshes of the arm
stage, panel                the scene and the controls in the browser
viewer, inbox, server       the running viewer, what pages did, the guarded web server
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from jacokin import lazy

if TYPE_CHECKING:
    from jacokin.viewer.view import Inspector as Inspector
    from jacokin.viewer.view import View as View
    from jacokin.viewer.viewer import Viewer as Viewer
    from jacokin.viewer.viewer import serve as serve

__all__, __getattr__, __dir__ = lazy.door(
    __name__,
    {
        "jacokin.viewer.view": (
            "Inspector",
            "View",
        ),
        "jacokin.viewer.viewer": (
            "Viewer",
            "serve",
        ),
    },
)
