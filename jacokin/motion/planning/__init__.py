"""What `plan_path` is made of. Read `plan` first, then `search`.

plan        `plan_path`, and the motion to where a path begins
search      all solutions at each place of a path, and the best way through them
manifold    the configurations that keep the tool on its path
smoothing   the way made shorter along self-motions
passing     when each place of the way is passed
"""
