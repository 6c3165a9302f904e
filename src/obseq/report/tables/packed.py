"""Long columns of a page: numbers as bytes that the browser unpacks, an eighth of their JSON.

Bytes of equal weight stand together, which makes them small when compressed; missing values are NaN, or -1.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Sequence

from obseq.report.tables.columns import EXACT

LONG = 400
"""Values from which a column is packed: of fewer, JSON is as short."""
WHOLE = frozenset({"choice", "point"})


def packed(values: Sequence[object], quantity: str) -> object:
    """The column as the page holds it: a list, or the bytes of numbers and their type."""
    if len(values) < LONG or quantity == "text":
        return list(values)
    import numpy as np

    if quantity in WHOLE:
        numbers = np.array([-1 if value is None else value for value in values], np.int32)
    else:
        numbers = np.array(values, np.float64 if quantity in EXACT else np.float32)
    size = numbers.dtype.itemsize
    shuffled = numbers.astype(numbers.dtype.newbyteorder("<")).view(np.uint8).reshape(-1, size).T
    return {"type": f"{numbers.dtype.kind}{size}", "bytes": squeezed(shuffled.tobytes())}


def squeezed(content: bytes) -> str:
    """Bytes as text that the browser inflates."""
    return base64.b64encode(gzip.compress(content, 6, mtime=0)).decode()
