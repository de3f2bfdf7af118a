"""From the kernels' Python to machine code, kept in a cache on disk. Read `loading` first."""
