"""Robot descriptions: from files to Pinocchio models, and the arm taken out of them. Read `chain` first.

chain     what a description holds, and the chain of joints from base to tip taken from it
bundled   the bundled robots and their table of numbers
urdf      URDF files; `meshes` finds the meshes that they name
shapes    collision shapes, and those of bundled robots
mjcf      MJCF files, as MuJoCo compiles them
"""
