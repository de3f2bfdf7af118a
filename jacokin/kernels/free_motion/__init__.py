"""Ways around what blocks a straight joint motion. Read `run` first.

run         the entry point, and what it works on
space       configurations: random ones, differences, how long motions between them take
sight       what touches at them and between them
trees       two trees that grow towards each other until they meet
shortcuts   a way that takes less time
corners     how much of each corner may be cut off
rows        how long a way takes, and its rows
"""
