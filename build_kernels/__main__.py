"""`python -m build_kernels`: put the library beside the sources of this clone, as building a wheel does.

With `--target`, as often as one likes: make the C library of another machine instead, in ``build/targets``; with
`--whole` one with all kernels, in ``build/wheels``, as a wheel for that machine has it.
"""

from argparse import ArgumentParser

from build_kernels.library import UNIVERSAL, build_or_exit
from build_kernels.targets import TARGETS

if __name__ == "__main__":
    parser = ArgumentParser("python -m build_kernels", description="Compile the kernels of this clone.")
    text = "the C library of another machine, in build/targets; may be repeated"
    parser.add_argument("--target", action="append", default=[], choices=[*TARGETS, *UNIVERSAL], help=text)
    parser.add_argument("--whole", action="store_true", help="with all kernels, in build/wheels")
    chosen = parser.parse_args()
    if chosen.whole and not chosen.target:
        parser.error("--whole goes with --target")
    build_or_exit(chosen.target, whole=chosen.whole)
