"""The only part that imports viser: the scene, the panel and the guarded web server. Read `panel` first.

panel, controls   what stands beside the scene; obstacles that pages add
stage             the scene: arm, branches, gizmo
props             what stands around the arm of a task
hand              keys and gamepad of a page, for a hand that leads the arm
server            who may connect
"""
