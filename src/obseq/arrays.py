"""Names for arrays by what they hold; shapes are in the docstrings of those who use them."""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]
PositionArray: TypeAlias = NDArray[np.uint32]
"""Places in a store, or in a column of values."""

IndexArray: TypeAlias = NDArray[np.int32]
KeyArray: TypeAlias = NDArray[np.uint64]
ByteArray: TypeAlias = NDArray[np.uint8]
ByteRows: TypeAlias = NDArray[np.uint8]

FloatRows: TypeAlias = NDArray[np.float64]
"""Two dimensions; in compiled loops the names above stand for one."""

FloatCubes: TypeAlias = NDArray[np.float64]
"""Three dimensions."""

IntRows: TypeAlias = NDArray[np.int64]
IndexRows: TypeAlias = NDArray[np.int32]
PositionRows: TypeAlias = NDArray[np.uint32]

Array: TypeAlias = NDArray[Any]
