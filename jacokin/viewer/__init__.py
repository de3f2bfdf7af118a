"""The arm in the browser: a gizmo for the target, and every branch that reaches it.

Everything public is imported from here. Read `view` first.

view, inspector       what to show for a target, as data, and how it is found
texts, paste          what a view says in words; text to paste, which is tried first
drawing               meshes of the arm and of obstacles
serving, contents     `serve`, and `show`, which results call; what a page offers, trajectories that are played, slices
viewer                the running viewer, between pages and inspector
browser               the only part that imports viser: scene, panel and the guarded web server
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__)
