"""Arms of any structure: every branch of a chain of six turning joints at a pose. Read `pose` first.

pose               from roots to branches, verified; neighbours where the arm's own roots are in doubt
continua           found from everywhere where F vanishes; one member of each is kept
near_continua      where branches nearly are a continuum, as of a wrist whose axes miss each other by a hair
loop               the closed loop of joints and links, and its twelve labellings
equations          six equations in three angles
characteristic     the determinant that has one angle only
roots, starts      its real roots, and the configurations that follow from them
spherical_wrist    where three axes meet, a closed form: the point where they do first
parallel_axes      where three are parallel: what they do not move first
planar_arm         where two are, and those beside them stay in one plane: a polynomial of degree 4
elbow_offset       and where one of those is beside its neighbour, one of degree 8
candidates         what these share: angles two at a time, and branches from them
ranking            which labellings suit an arm
"""
