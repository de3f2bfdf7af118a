"""Random targets, arguments and files against what jacokin promises: nothing wrong, nothing lost, no raw exception.

kinematics    forward kinematics in plain NumPy, from the table of numbers and from URDF text
targets       poses of every class on every bundled robot, solved in batches
values        values that an argument may have, good and bad
arguments     those values in every public function, class and method
files         edits of valid URDF, MJCF and CSV files
child         runs cases in a process of its own, which may crash or hang
"""
