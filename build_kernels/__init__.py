"""The kernels' Python compiled and linked to the library in the package. Read `library` first.

library     which parts it has, and which of them are kept from an earlier build
compiling   from Python to modules of LLVM's language, by numba
passes      what numba does of that, and what it leaves out
emitting    from such a module to an object file
c_library   the C files that are linked with them, and what they know about the kernels
linking     the C compiler that links them, for this machine and others
targets     the machines that there are libraries for
universal   one library of macOS for several kinds of processors
wheels      a check of the wheels for all machines
hook        called by hatchling when it builds a wheel
"""
