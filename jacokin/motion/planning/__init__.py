"""What `plan_path` is made of: the path of the tool, the ladder of all solutions, and how fast it is run through."""
