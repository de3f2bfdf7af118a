"""`universal`: one library of macOS for several kinds of processors, as Apple's `lipo` makes it."""

from __future__ import annotations

import struct
from collections.abc import Sequence

#: Mach-O begins with this, and its files for several machines (<mach-o/fat.h>) with that.
MACH_O, FAT = b"\xcf\xfa\xed\xfe", 0xCAFEBABE
#: Parts begin at multiples of 2 to this: the size of a page on AArch64.
ALIGNMENT = 14


def universal(libraries: Sequence[bytes]) -> bytes:
    """Libraries for one kind of processor each as one for all of them: a table, and they as they are.

    Raises:
        ValueError: one is not a library of macOS.
    """
    header, parts = struct.pack(">2I", FAT, len(libraries)), b""
    begin = 1 << ALIGNMENT
    for library in libraries:
        if not library.startswith(MACH_O):
            raise ValueError("a universal library consists of 64-bit Mach-O files")
        parts += b"\0" * (-len(parts) % begin)
        kind = struct.unpack_from("<2I", library, 4)
        header += struct.pack(">5I", *kind, begin + len(parts), len(library), ALIGNMENT)
        parts += library
    return header.ljust(begin, b"\0") + parts
