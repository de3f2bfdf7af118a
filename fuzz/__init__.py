"""Random targets, arguments and files against what jacokin promises: nothing wrong, nothing lost, no raw exception.

kinematics    forward kinematics in plain NumPy, from the table of numbers and from URDF text
targets       poses of every class on every bundled robot, solved in batches
values        values that an argument may have, good and bad
arguments     those values in every public function, class and method
files         edits of valid URDF, MJCF and CSV files
own_answers   configurations as the answers to their own poses
six_joints    arms of any geometry, special ones among them
motions       motions among random obstacles, held against MuJoCo's distances and the limits
calibrations  random arms and instruments, rows that are grossly wrong
c_calls       the C library through ctypes, beside Python
data_sets     recordings that are killed, and damaged files
child         runs cases in a process of its own, which may crash or hang
"""
