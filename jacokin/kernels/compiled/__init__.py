"""From the kernels' Python to machine code, kept in a cache on disk. Read `loading` first.

loading    machine code where there is some, plain Python until then
compiler   from Python to machine code, in a process of its own
library    machine code loaded and called
cache      machine code on disk
"""
