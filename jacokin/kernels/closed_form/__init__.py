"""The closed form: every branch of a six-joint Jaco at a pose. Read `pose` first.

pose               from roots to branches, verified
resultant, roots   the polynomial in one unknown, and its real roots
wrist              from a root to candidates
folds              singular configurations, where two branches merge
arm                the constants of an arm and of a target
batch              the entry point, for one pose or many
"""
