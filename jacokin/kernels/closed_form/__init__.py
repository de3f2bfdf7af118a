"""The closed form: every branch of a six-joint Jaco at a pose. Read `pose` first."""
