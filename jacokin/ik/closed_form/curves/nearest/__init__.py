"""The member nearest to a seed, without the whole family. Read `chord` first.

chord    the nearest point on the part of a curve between two nodes
sweep    of a seven-joint arm: slices from the seed's joint 3 outwards, as far as something nearer may be
"""
