"""Contact, distances and certain motions of an arm among obstacles. Read `run` first.

run            the entry point
shapes         what a shape is: a core and a margin
simplex        the point of a simplex nearest to the origin
separation     how far two convex shapes are apart
cloud          how far two shapes are apart, one of which may be a cloud of points
cloud_surface  where the surface is that the points of a cloud make
pairs          where two shapes are nearest, and would be if one turned a little
penetration    how deep they are in each other
arm            where the links and their shapes are, and how far a motion can move them
tree           obstacles in a tree of boxes
touching       pairs of shapes that touch
nearest        the pair that is nearest, or that a motion could bring together first
approach       for how long a pair stays apart on a motion
motion         straight motions, without gaps
between        the entry point that looks at what happens between two rows of a motion
sweep          what could touch on a part of a motion, in places side by side
cloud_tree     the entry point that sorts points into a tree of boxes
world          the entry point that fills the rows of simple shapes, and sorts obstacles into their tree
near_points    the entry point for points that are on the arm
"""
