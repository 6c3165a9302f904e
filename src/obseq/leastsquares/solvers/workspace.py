"""Where the temporary matrices of a traversal of the tree lie, known before it starts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[Any]


@njit(cache=True)
def place_updates(nodes: Array, parent: Array, below: Array, held: Array, at: Array, base: int) -> int:
    """Places the update matrices of some supernodes in two stacks, one for odd and one for even depths.

    When a supernode comes, its children are alone on the other stack: nothing is ever moved.

    Args:
        nodes: supernodes in the order of elimination, whole subtrees or what is above them.
        parent: (m,) parents.
        below: (m,) rows below.
        held: (m,) supernodes whose update matrix has its place already.
        at: (m,) places, filled for these nodes.
        base: where the room starts.

    Returns:
        Where the room ends.
    """
    depth = np.zeros(len(parent), np.int8)
    for k in range(len(nodes) - 1, -1, -1):
        s = nodes[k]
        depth[s] = 1 - depth[parent[s]] if parent[s] >= 0 else 0
    top = np.zeros(2, np.int64)
    highest = np.zeros(2, np.int64)
    bottom = np.full(len(parent), -1, np.int64)  # lowest place among the children of each supernode
    for s in nodes:
        d = depth[s]
        if bottom[s] >= 0:
            top[1 - d] = bottom[s]
        if held[s]:
            continue
        at[s] = top[d]
        # The children stay until the supernode has its own matrix, which lies on the other stack.
        top[d] += below[s] * below[s]
        highest[d] = max(highest[d], top[d])
        if parent[s] >= 0 and bottom[parent[s]] < 0:
            bottom[parent[s]] = at[s]
    for s in nodes:
        if not held[s]:
            at[s] += base + (highest[0] if depth[s] == 1 else 0)
    return base + highest[0] + highest[1]


@njit(cache=True)
def place_fronts(nodes: Array, parent: Array, front: Array, at: Array, base: int) -> int:
    """Places the fronts of some supernodes, visited from the root down: each above that of its parent.

    Args:
        nodes: supernodes in the order of elimination, whole subtrees or what is above them.
        parent: (m,) parents; one outside `nodes` counts as none.
        front: (m,) orders of the fronts.
        at: (m,) places, filled for these nodes.
        base: where the room starts.

    Returns:
        Where the room ends.
    """
    mine = np.zeros(len(parent), np.bool_)
    mine[nodes] = True
    end = base
    for k in range(len(nodes) - 1, -1, -1):
        s, p = nodes[k], parent[nodes[k]]
        at[s] = at[p] + front[p] * front[p] if p >= 0 and mine[p] else base
        end = max(end, at[s] + front[s] * front[s])
    return end
