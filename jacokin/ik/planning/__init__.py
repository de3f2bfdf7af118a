"""What `plan_path` is made of: the path of the tool, the ladder of all solutions, and how fast it is run through.

cartesian    poses along the path, and the free angle about an axis
chain        forward kinematics and Newton steps of many configurations at once
ladder       all solutions at steps along the path, and which of them follow each other
search       the cheapest way up the ladder
curve        joint angles anywhere along that way, exact
pacing       how fast the way is run through
reasons      why there is no way
"""
