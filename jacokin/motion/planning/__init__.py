"""What `plan_path` is made of. Read `plan` first, then `search`.

plan        `plan_path`
search      all solutions at each place of a path, and the best way through them
manifold    the configurations that keep the tool on its path
lead_in     the motion to where a path begins
smoothing   the way made shorter along self-motions
"""
