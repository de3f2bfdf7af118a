"""Self-motions: configurations with one free parameter, of a tool that may turn about an axis or of a seven-joint arm.

Read `family` first.

family           the answer: intervals of the parameter on each branch
search           from a target to its family, and to the member that is wanted
curves           the curves of a target, by the kernels of `kernels.self_motion`
tracks           what an interval runs along
members, least   its members, each verified, and the one of the least cost
edge, meeting    where curves have shrunk to points, and where they meet
recut            limits that are passed just there
census           whether anything is missing
beside_seed      the member beside a seed that nearly is one
stretched        where the elbow is all but straight
straight_wrist   where the wrist is straight and two of its joints turn against each other
"""
