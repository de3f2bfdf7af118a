"""Arms of any structure: every branch of a chain of six turning joints at a pose. Read `pose` first.

pose               from roots to branches, verified; neighbours where the arm's own roots are in doubt
loop               the closed loop of joints and links, and its twelve labellings
equations          six equations in three angles
characteristic     the determinant that has one angle only
roots, starts      its real roots, and the configurations that follow from them
ranking            which labellings suit an arm
"""
