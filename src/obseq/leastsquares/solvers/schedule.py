"""The tree cut into tasks for several threads, and the places of their temporary matrices."""

from __future__ import annotations

from concurrent.futures import FIRST_COMPLETED, Future, wait
from heapq import heappop, heappush
from typing import TYPE_CHECKING

import numpy as np

from obseq.compilation import compiled
from obseq.dataclass import dataclass
from obseq.leastsquares.solvers.elimination_tree import front_seconds
from obseq.pools import thread_pool

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from obseq.arrays import BoolArray, FloatArray, IntArray, IntRows
    from obseq.leastsquares.solvers.symbolic import Structure


TASKS_PER_THREAD = 8
"""A subtree with more than one part in so many of a thread's work is cut further."""

TINY = 0.1
"""A subtree of less than this share of a task's work belongs to the task above it."""


@dataclass(frozen=True)
class Schedule:
    """Tasks and memory.

    Attributes:
        tasks: supernodes of each task, children first.
        above: (n_tasks,) the task that waits for each, -1 at a root.
        seconds: (n_tasks,) expected duration of each task.
        is_shared: (m,) supernodes whose parent is in another task.
        update_at: (m,) where update matrices lie: in the shared room, or in that of the worker.
        front_at: (m,) where fronts of the inverse lie in the room of the worker.
        shared_room: numbers in the room that the tasks share.
        update_room: numbers in the room of a worker for a factorisation.
        front_room: numbers in the room of a worker for an inverse.
    """

    tasks: tuple[IntArray, ...]
    above: IntArray
    seconds: FloatArray
    is_shared: NDArray[np.bool_]
    update_at: IntArray
    front_at: IntArray
    shared_room: int
    update_room: int
    front_room: int


def plan(structure: Structure, threads: int) -> Schedule:
    """Tasks for so many threads; one thread has one task."""
    parent, below = structure.parent, structure.below
    seconds = front_seconds(structure.width, structure.below).astype(np.float64)
    share = np.inf if threads == 1 else seconds.sum() / (TASKS_PER_THREAD * threads)
    task = np.empty(len(parent), np.int64)
    assign_tasks(parent, seconds.copy(), float(share), np.zeros_like(task), task)
    count = int(task.max(initial=-1)) + 1
    is_shared = (parent >= 0) & (task != task[parent])
    tasks = (
        tuple(np.split(np.argsort(task, kind="stable"), np.cumsum(np.bincount(task))[:-1])) if count else ()
    )
    above = np.full(count, -1)
    above[task[is_shared]] = task[parent[is_shared]]
    sizes = np.where(is_shared, below**2, 0)
    update_at = np.cumsum(sizes) - sizes
    front_at = np.zeros_like(update_at)
    update_room = front_room = 0
    for nodes in tasks:
        inside = np.where((parent[nodes] >= 0) & ~is_shared[nodes], np.searchsorted(nodes, parent[nodes]), -1)
        update_room = max(
            update_room, place_updates(nodes, inside, below, is_shared, update_at, _room(2, nodes))
        )
        front_room = max(front_room, place_fronts(nodes, inside, structure.front, front_at, _room(4, nodes)))
    return Schedule(
        tasks,
        above,
        np.bincount(task, seconds, count).astype(np.float64),
        is_shared,
        update_at,
        front_at,
        int(sizes.sum()),
        update_room,
        front_room,
    )


def _room(rows: int, nodes: IntArray) -> IntRows:
    """(rows, n + 2) zeros."""
    return np.zeros((rows, len(nodes) + 2), np.int64)


@compiled
def assign_tasks(
    parent: IntArray, total: FloatArray, share: float, large_children: IntArray, task: IntArray
) -> None:
    """Writes the task of each supernode (m,); those above have lower numbers.

    Supernodes with subtrees of more than a share make tasks that end where two of them meet; the subtrees
    that hang from them are one task each, or part of the same where they are tiny. Small trees are put
    together. `total` (m,) holds the seconds of each supernode, `large_children` (m,) zeros; both are changed.
    """
    m = len(parent)
    for s in range(m):
        if parent[s] >= 0:
            total[parent[s]] += total[s]
    for s in range(m):
        if parent[s] >= 0 and total[s] > share:
            large_children[parent[s]] += 1
    count, filled = 0, share
    gathering = 0
    for s in range(m - 1, -1, -1):
        p = parent[s]
        if p < 0 and total[s] <= share:
            if filled + total[s] > share:
                gathering, filled = count, 0.0
                count += 1
            filled += total[s]
            task[s] = gathering
        elif p >= 0 and (
            total[p] <= share or (total[s] > share and large_children[p] == 1) or (total[s] <= TINY * share)
        ):
            task[s] = task[p]
        else:
            task[s] = count
            count += 1


@compiled
def place_updates(
    nodes: IntArray, inside: IntArray, below: IntArray, is_shared: BoolArray, at: IntArray, room: IntRows
) -> int:
    """Places the update matrices of a task in two stacks, for supernodes of odd and of even depth.

    When a supernode comes, its children are alone on top of the other stack: nothing is ever moved.

    Args:
        nodes: supernodes of the task, children first.
        inside: index in `nodes` of the parent of each, -1 where it has none in the task.
        below: (m,) rows below.
        is_shared: (m,) supernodes whose update matrix has its place elsewhere.
        at: (m,) places, filled for the others of these nodes.
        room: (2, n + 2) zeros; changed.

    Returns:
        Numbers in the room that this takes.
    """
    count = len(nodes)
    depth, lowest = room[0], room[1]  # of each node; lowest place among its children
    top, highest = room[0, count:], room[1, count:]
    for k in range(count - 1, -1, -1):
        lowest[k] = -1
        if inside[k] >= 0:
            depth[k] = 1 - depth[inside[k]]
    for k in range(len(nodes)):
        s, d = nodes[k], depth[k]
        if lowest[k] >= 0:
            top[1 - d] = lowest[k]
        if is_shared[s]:
            continue
        at[s] = top[d]
        top[d] += below[s] * below[s]
        highest[d] = max(highest[d], top[d])
        if inside[k] >= 0 and lowest[inside[k]] < 0:
            lowest[inside[k]] = at[s]
    for k in range(len(nodes)):
        if not is_shared[nodes[k]] and depth[k] == 1:
            at[nodes[k]] += highest[0]
    return int(highest[0] + highest[1])


@compiled
def place_fronts(nodes: IntArray, inside: IntArray, front: IntArray, at: IntArray, room: IntRows) -> int:
    """Places the fronts of a task, visited from the root down, in two stacks as `place_updates` does.

    A front is needed until its last child has been visited, which is the first one in the elimination: the
    children of that one are put in its place.

    Args:
        nodes: supernodes of the task, children first.
        inside: index in `nodes` of the parent of each, -1 where it has none in the task.
        front: (m,) orders of the fronts.
        at: (m,) places, filled for these nodes.
        room: (4, n + 2) zeros; changed.

    Returns:
        Numbers in the room that this takes.
    """
    count = len(nodes)
    first_child, depth, highest = room[0], room[1], room[1, count:]
    free = room[2:]  # where the children of each may start, on both stacks
    for k in range(count):
        first_child[k] = -1
    for k in range(count - 1, -1, -1):
        if inside[k] >= 0:
            first_child[inside[k]] = k
    for k in range(count - 1, -1, -1):
        p = inside[k]
        if p >= 0:
            depth[k] = 1 - depth[p]
            free[0, k], free[1, k] = free[0, p], free[1, p]
            if first_child[p] == k:
                free[depth[p], k] = at[nodes[p]]
        d = depth[k]
        at[nodes[k]] = free[d, k]
        free[d, k] += front[nodes[k]] * front[nodes[k]]
        highest[d] = max(highest[d], free[d, k])
    for k in range(count):
        if depth[k] == 1:
            at[nodes[k]] += highest[0]
    return int(highest[0] + highest[1])


def run_tasks(
    schedule: Schedule, run: Callable[[IntArray, int], None], threads: int, *, upwards: bool
) -> None:
    """Runs `run(nodes, worker)` for every task, after those it waits for, the most urgent ones first.

    Args:
        schedule: the tasks.
        run: treats the supernodes of a task; `worker` counts from 0 to `threads` - 1.
        threads: number of threads.
        upwards: from the leaves to the roots, or the other way round.
    """
    if threads == 1:
        for nodes in schedule.tasks if not upwards else reversed(schedule.tasks):
            run(nodes, 0)
        return
    after, blockers = _order(schedule, upwards)
    urgency = -_longest_paths(schedule, upwards)
    ready: list[tuple[float, int]] = []
    for task in np.flatnonzero(blockers == 0).tolist():
        heappush(ready, (urgency[task], task))
    idle = list(range(threads))
    running: dict[Future[None], tuple[int, int]] = {}
    with thread_pool(threads) as pool:
        while ready or running:
            while ready and idle:
                task, worker = heappop(ready)[1], idle.pop()
                running[pool.submit(run, schedule.tasks[task], worker)] = (task, worker)
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                task, worker = running.pop(future)
                future.result()
                idle.append(worker)
                for following in after[task]:
                    blockers[following] -= 1
                    if blockers[following] == 0:
                        heappush(ready, (urgency[following], following))


def _order(schedule: Schedule, upwards: bool) -> tuple[list[list[int]], IntArray]:
    """Tasks that come after each, and how many tasks come right before each."""
    count = len(schedule.tasks)
    after: list[list[int]] = [[] for _ in range(count)]
    blockers = np.zeros(count, dtype=np.int64)
    for task, above in enumerate(schedule.above.tolist()):
        if above >= 0:
            before, following = (task, above) if upwards else (above, task)
            after[before].append(following)
            blockers[following] += 1
    return after, blockers


def _longest_paths(schedule: Schedule, upwards: bool) -> FloatArray:
    """(n_tasks,) expected seconds from the start of each task to the end of all that wait for it."""
    paths = schedule.seconds.copy()
    if upwards:
        for task, above in enumerate(schedule.above.tolist()):  # tasks above have lower numbers
            paths[task] += paths[above] if above >= 0 else 0.0
        return paths
    longest_below = np.zeros_like(paths)
    for task in range(len(paths) - 1, -1, -1):
        paths[task] += longest_below[task]
        above = schedule.above[task]
        if above >= 0:
            longest_below[above] = max(longest_below[above], paths[task])
    return paths
