"""How much memory there is, and how it is told."""

from __future__ import annotations

import os
import re
from pathlib import Path

from obseq.errors import InputError


def bytes_of(size: str | float) -> int:
    """Bytes of a size as people write it: `8GB`, `500 MB`, or a number of bytes.

    Raises:
        InputError: it is none.
    """
    found = re.fullmatch(r"\s*(\d+\.?\d*)\s*([kKmMgGtT]?)i?[bB]?\s*", str(size))
    if found is None or not float(found[1]) > 0:
        raise InputError(f"{size!r} is no size of memory: write 500MB, 8GB or a number of bytes")
    return int(float(found[1]) * 1000 ** " KMGT".index(found[2].upper() or " "))


def told(size: float) -> str:
    """Bytes in words."""
    return f"{size / 1e9:.2f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"


def in_use() -> int:
    """Bytes that this process has in memory now; 0 where the system does not say."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return 0
    return pages * os.sysconf("SC_PAGESIZE")


def most_in_use() -> int:
    """Bytes that this process has had in memory at most; 0 where the system does not say."""
    try:
        text = Path("/proc/self/status").read_text()
    except OSError:
        return 0
    found = re.search(r"VmHWM:\s*(\d+) kB", text)
    return 1024 * int(found[1]) if found else 0
