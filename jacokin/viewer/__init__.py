"""What it looks like: every branch in the browser. Everything public is imported from here; read `view` first.

view                      what to show for a target, as data
postures, inspector       how it is found
setup, contents           what is solved for, and what a page offers
texts, paste              what a view says in words; text to paste, which is tried first
drawing                   meshes of the arm, of obstacles, and of slices of a map
motion                    trajectories that are played, and following the gizmo
serving, viewer, inbox    `serve`, the running viewer, what pages did
browser                   the scene, the controls and the guarded web server of viser
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__, __file__)
