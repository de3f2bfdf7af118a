"""Many targets, and files of any length: targets in, answers out. Read `solve_file` first.

solve_file   a file of any length, in chunks, resumed where it was stopped
chunk        one chunk of it, in any process
batch        `solve_batch`: arrays in, arrays out
"""
