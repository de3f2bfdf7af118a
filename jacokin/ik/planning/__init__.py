"""What `plan_path` is made of: the path of the tool, the ladder of all solutions, and how fast it is run through.

cartesian    poses along the path, and the free angle about an axis
chain        forward kinematics and Newton steps of many configurations at once
manifold     the configurations on the path: points, or curves where a parameter is free
rungs        all solutions at places of the path
ladder       which solutions of neighbouring places follow each other, and at what cost
search       the cheapest way up the ladder
smoothing    that way, moved along the curves to where joints move least
curve        configurations anywhere along that way, exact
pacing       how fast the way is run through
reasons      why there is no way
"""
