"""Elimination tree of a graph, and its vertices gathered in supernodes."""

from __future__ import annotations

from typing import Any

import numpy as np

from obseq.arrays import IntArray, IntRows
from obseq.compilation import compiled

OPERATIONS, ENTRIES, PANEL, CALL = 4e10, 1e9, 1.5e8, 5e-8
"""Operations, entries of a front and of its panel treated in one second; seconds spent on any front."""

Numbers = Any
"""A number, or an array of them."""


def front_seconds(width: Numbers, below: Numbers) -> Numbers:
    """What fronts cost to assemble and factor; the proportions matter more than the unit."""
    operations = width * (width * (width / 3.0 + below) + below * below)
    front = width + below
    return operations / OPERATIONS + front * front / ENTRIES + width * front / PANEL + CALL


_front_seconds = compiled(front_seconds)


def elimination_tree(start: IntArray, neighbours: IntArray, order: IntArray, place: IntArray) -> IntArray:
    """(n,) parent of each position of the order, -1 at a root."""
    parent, ancestor = np.full((2, len(order)), -1)
    find_parents(start, neighbours, order, place, parent, ancestor)
    return parent


@compiled
def find_parents(
    start: IntArray,
    neighbours: IntArray,
    order: IntArray,
    place: IntArray,
    parent: IntArray,
    ancestor: IntArray,
) -> None:
    """Writes the parent of each position of the order (Liu, with path compression); both are -1 before."""
    for i in range(len(order)):
        for k in range(start[order[i]], start[order[i] + 1]):
            j = place[neighbours[k]]
            while j != -1 and j < i:
                above = ancestor[j]
                ancestor[j] = i
                if above == -1:
                    parent[j] = i
                j = above


def postorder(parent: IntArray, size: IntArray) -> IntArray:
    """(n,) nodes of a forest, children before parents, the child of largest `size` first."""
    n = len(parent)
    order = np.empty(n, np.int64)
    visit_children_first(parent, size, order, np.full((3, n + 1), -1))
    return order


@compiled
def visit_children_first(parent: IntArray, size: IntArray, order: IntArray, room: IntRows) -> None:
    """Writes the nodes of a forest as `postorder` says; `room` (3, n + 1) is -1 before."""
    n = len(parent)
    head, following, stack = room[0], room[1], room[2]
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


def column_counts(
    start: IntArray,
    neighbours: IntArray,
    order: IntArray,
    place: IntArray,
    parent: IntArray,
    weights: IntArray,
) -> IntArray:
    """(n,) unknowns in the column of each position, its own included, by walking every row of the factor."""
    counts, seen = weights[order], np.full(len(order), -1)
    count_rows(start, neighbours, order, place, parent, weights, counts, seen)
    return counts


@compiled
def count_rows(
    start: IntArray,
    neighbours: IntArray,
    order: IntArray,
    place: IntArray,
    parent: IntArray,
    weights: IntArray,
    counts: IntArray,
    seen: IntArray,
) -> None:
    """Adds to the counts of a column the unknowns of each of its rows below; `seen` is -1 before."""
    for i in range(len(order)):
        seen[i] = i
        for k in range(start[order[i]], start[order[i] + 1]):
            j = place[neighbours[k]]
            if j < i:
                while seen[j] != i:
                    seen[j] = i
                    counts[j] += weights[order[i]]
                    j = parent[j]


def supernodes(
    parent: IntArray, counts: IntArray, weights: IntArray, n_last: int
) -> tuple[IntArray, IntArray]:
    """Gathers postordered vertices in supernodes: equal structures, then small losses.

    Args:
        parent: (n,) parents in the elimination tree.
        counts: (n,) unknowns in each column.
        weights: (n,) unknowns of each vertex.
        n_last: so many vertices at the end stay apart from the others, together.

    Returns:
        (n,) supernode of each vertex, and (n_supernodes,) parent of each; parents have higher numbers.
    """
    node, tree = np.full((2, len(parent)), -1)
    kept = gather_vertices(parent, counts, weights, n_last, node, tree, np.zeros((8, len(parent)), np.int64))
    return node, tree[:kept].copy()


@compiled
def gather_vertices(
    parent: IntArray,
    counts: IntArray,
    weights: IntArray,
    n_last: int,
    node: IntArray,
    tree: IntArray,
    room: IntRows,
) -> int:
    """Writes what `supernodes` returns, and their number; `room` (8, n) is zero before, `tree` -1."""
    n = len(parent)
    n_children, width, below, above = room[0], room[1], room[2], room[3]
    into, number, head, following = room[4], room[5], room[6], room[7]
    for v in range(n):
        if parent[v] >= 0:
            n_children[parent[v]] += 1
    m = 0
    for v in range(n):
        joins = v > 0 and parent[v - 1] == v and n_children[v] == 1 and v < n - n_last
        if not ((joins and counts[v - 1] == counts[v] + weights[v - 1]) or v > n - n_last):
            m += 1
            width[m - 1] = 0
        s = m - 1
        node[v] = s
        width[s] += weights[v]
        below[s] = counts[v] - weights[v]
        above[s] = parent[v]
    for s in range(m):
        into[s], head[s], following[s] = s, -1, -1
        above[s] = node[above[s]] if above[s] >= 0 else -1
    absorbed = absorb(above, width, below, into, head, following, m, m - 1 if n_last else m)
    # Chains of absorptions end in the supernode that stays; number those that stay.
    kept = m - absorbed
    at = kept
    for s in range(m - 1, -1, -1):
        if into[s] == s:
            at -= 1
            number[s] = at
        else:
            into[s] = into[into[s]]
            number[s] = number[into[s]]
    for s in range(m):
        if into[s] == s and above[s] >= 0:
            tree[number[s]] = number[above[s]]
    for v in range(n):
        node[v] = number[node[v]]
    return kept


@compiled
def absorb(
    above: IntArray,
    width: IntArray,
    below: IntArray,
    into: IntArray,
    head: IntArray,
    following: IntArray,
    count: int,
    limit: int,
) -> int:
    """Merges children into their parents where few zeros enter the factor; returns how many."""
    absorbed = 0
    for s in range(count):
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
