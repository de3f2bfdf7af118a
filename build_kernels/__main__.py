"""`python -m build_kernels`: put the library beside the sources of this clone, as building a wheel does."""

from build_kernels.library import build_or_exit

if __name__ == "__main__":
    build_or_exit()
