"""Elimination tree of a graph, and its vertices gathered in supernodes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.leastsquares.solvers.compiled import compiled

if TYPE_CHECKING:
    from obseq.arrays import Array


OPERATIONS, ENTRIES, PANEL, CALL = 4e10, 1e9, 1.5e8, 5e-8
"""Operations, entries of a front and of its panel treated in one second; seconds spent on any front."""


def front_seconds(width: Any, below: Any) -> Any:
    """What fronts cost to assemble and factor; the proportions matter more than the unit."""
    operations = width * (width * (width / 3.0 + below) + below * below)
    front = width + below
    return operations / OPERATIONS + front * front / ENTRIES + width * front / PANEL + CALL


_front_seconds = compiled(front_seconds)


@compiled
def elimination_tree(start: Array, neighbours: Array, order: Array, place: Array) -> Array:
    """(n,) parent of each position of the order, -1 at a root (Liu, with path compression)."""
    n = len(order)
    parent = np.full(n, -1, np.int64)
    ancestor = np.full(n, -1, np.int64)
    for i in range(n):
        for k in range(start[order[i]], start[order[i] + 1]):
            j = place[neighbours[k]]
            while j != -1 and j < i:
                above = ancestor[j]
                ancestor[j] = i
                if above == -1:
                    parent[j] = i
                j = above
    return parent


@compiled
def postorder(parent: Array, size: Array) -> Array:
    """(n,) nodes of a forest, children before parents, the child of largest `size` first."""
    n = len(parent)
    head = np.full(n + 1, -1, np.int64)
    following = np.empty(n, np.int64)
    # The list of children is filled by prepending: the last one put is the first one visited.
    for v in range(n - 1, -1, -1):
        p = parent[v] if parent[v] >= 0 else n
        first = head[p]
        if p == n or first == -1 or size[v] >= size[first]:
            following[v] = first
            head[p] = v
        else:
            following[v] = following[first]
            following[first] = v
    order = np.empty(n, np.int64)
    stack = np.empty(n + 1, np.int64)
    done = 0
    stack[0] = n
    depth = 0
    while depth >= 0:
        child = head[stack[depth]]
        if child >= 0:
            head[stack[depth]] = following[child]
            depth += 1
            stack[depth] = child
        else:
            if stack[depth] < n:
                order[done] = stack[depth]
                done += 1
            depth -= 1
    return order


@compiled
def column_counts(
    start: Array, neighbours: Array, order: Array, place: Array, parent: Array, weights: Array
) -> Array:
    """(n,) unknowns in the column of each position, its own included, by walking every row of the factor."""
    n = len(order)
    counts = weights[order]
    seen = np.full(n, -1, np.int64)
    for i in range(n):
        seen[i] = i
        for k in range(start[order[i]], start[order[i] + 1]):
            j = place[neighbours[k]]
            if j < i:
                while seen[j] != i:
                    seen[j] = i
                    counts[j] += weights[order[i]]
                    j = parent[j]
    return counts


@compiled
def supernodes(parent: Array, counts: Array, weights: Array, has_last: bool) -> tuple[Array, Array]:
    """Gathers postordered vertices in supernodes: equal structures, then small losses.

    Args:
        parent: (n,) parents in the elimination tree.
        counts: (n,) unknowns in each column.
        weights: (n,) unknowns of each vertex.
        has_last: the last vertex stays alone.

    Returns:
        (n,) supernode of each vertex, and (n_supernodes,) parent of each; parents have higher numbers.
    """
    n = len(parent)
    n_children = np.zeros(n, np.int64)
    for v in range(n):
        if parent[v] >= 0:
            n_children[parent[v]] += 1
    node = np.empty(n, np.int64)
    width = np.empty(n, np.int64)
    below = np.empty(n, np.int64)
    above = np.empty(n, np.int64)
    m = 0
    for v in range(n):
        joins = v > 0 and parent[v - 1] == v and n_children[v] == 1 and not (has_last and v == n - 1)
        if not (joins and counts[v - 1] == counts[v] + weights[v - 1]):
            m += 1
            width[m - 1] = 0
        s = m - 1
        node[v] = s
        width[s] += weights[v]
        below[s] = counts[v] - weights[v]
        above[s] = parent[v]
    into = np.empty(m, np.int64)
    for s in range(m):
        into[s] = s
        above[s] = node[above[s]] if above[s] >= 0 else -1
    absorbed = _absorb(above, width, below, into, m - 1 if has_last else m)
    # Chains of absorptions end in the supernode that stays; number those that stay.
    number = np.empty(m, np.int64)
    kept = m - absorbed
    at = kept
    for s in range(m - 1, -1, -1):
        if into[s] == s:
            at -= 1
            number[s] = at
        else:
            into[s] = into[into[s]]
            number[s] = number[into[s]]
    tree = np.full(kept, -1, np.int64)
    for s in range(m):
        if into[s] == s and above[s] >= 0:
            tree[number[s]] = number[above[s]]
    return number[node], tree


@compiled
def _absorb(above: Array, width: Array, below: Array, into: Array, limit: int) -> int:
    """Merges children into their parents where few zeros enter the factor; returns how many."""
    head = np.full(len(into), -1, np.int64)
    following = np.full(len(into), -1, np.int64)
    absorbed = 0
    for s in range(len(into)):
        child = head[s]
        while child >= 0 and s < limit:
            if is_worth_merging(width[child], below[child], width[s], below[s]):
                width[s] += width[child]
                into[child] = s
                absorbed += 1
            child = following[child]
        if above[s] >= 0:
            following[s] = head[above[s]]
            head[above[s]] = s
    return absorbed


@compiled
def is_worth_merging(child_width: int, child_below: int, width: int, below: int) -> bool:
    """Whether one front is cheaper than a child and its parent apart."""
    apart = _front_seconds(child_width, child_below) + _front_seconds(width, below)
    return bool(_front_seconds(child_width + width, below) < apart)
