"""The only part that imports viser: the scene, the panel and the guarded web server. Read `panel` first.

panel, controls   what stands beside the scene
stage             the scene: arm, branches, gizmo
server            who may connect
"""
