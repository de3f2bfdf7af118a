"""The kernels' Python compiled and linked to the library in the package. Read `library` first.

library     which parts it has, which of them are kept from an earlier build, and the linking
compiling   from Python to an object file, by numba
hook        called by hatchling when it builds a wheel
"""
