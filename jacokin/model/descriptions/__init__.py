"""Robot descriptions: from files to Pinocchio models, and the arm taken out of them. Read `chain` first.

chain         what a description holds, and the chain of joints from base to tip taken from it
tools         where an arm ends and its gripper begins; the frames that tools have
bundled       the bundled robots and their table of numbers
urdf          URDF files; SRDF files, which disable contact of links
shapes        collision shapes, those of bundled robots, and those of a URDF made ready for MuJoCo
meshes        the mesh files that a URDF names, in metres
convex_parts  a mesh as convex parts that together hold all of it
mjcf          MJCF files, as MuJoCo compiles them
"""
