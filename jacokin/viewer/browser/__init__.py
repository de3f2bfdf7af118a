"""The only part that imports viser: the scene, the panel and the guarded web server. Read `panel` first.

panel, controls   what stands beside the scene; obstacles that pages add; keys and gamepad of a hand that leads the arm
stage             the scene: arm, branches, gizmo; what stands around the arm of a task
server            who may connect
"""
