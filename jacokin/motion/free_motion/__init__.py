"""Free motions: from one configuration to a goal without contact. Read `plan_motion` first.

plan_motion   `plan_motion`: the straight motion to the nearest goal, or a way around, shortened and timed;
              configurations that reach what is asked for
meanwhile     plans in time, beside other robots that move, and when two arms touch
plan_pick     `plan_pick`: to an object, with a straight line to a grasp at the end, and up with it
plan_place    `plan_place`: with the object to a place, straight down, and straight back without it
handling      what both of them share
under_way     plans for an arm that moves: how it comes to rest, and how it goes on without stopping
leaving       ways out of contact, and of nearness, at the start and at the end
search        straight motions, ways around what blocks them, and their rows, by the kernels
timed_course  when each place of a way is passed whose corners are cut
"""
