"""Self-motions: the curves of all configurations of a redundant arm that reach one pose. Read `intervals` first.

The arm has one parameter more than the pose needs: a seventh joint, or an axis that the tool may turn about.
"""
