"""Every branch of a six-joint Jaco in closed form. Read `solver` first."""
