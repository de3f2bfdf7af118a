"""What is drawn, as meshes: the parts of the arm, its visual meshes, obstacles, slices of a map."""
