"""How a system is solved in blocks: with how much memory, by whom, and where its files are."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from pathlib import Path
from types import TracebackType
from typing import IO
from weakref import finalize

from obseq.cached import cached_property
from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.leastsquares.blocks import workers
from obseq.leastsquares.blocks.files import VERSIONS, Value
from obseq.leastsquares.blocks.folders import claimed
from obseq.leastsquares.blocks.memory import bytes_of, in_use, told
from obseq.leastsquares.blocks.partition import ROOM, Partition, Tree
from obseq.leastsquares.blocks.tasks import task
from obseq.leastsquares.solvers.protocol import SymmetricPattern

WORKER = 150_000_000
"""Bytes of a worker beside its parts: 66 MB when it has nothing to do, and what it loads for the first."""
KEPT = 2 * 8
"""Bytes of what stays for each entry of the matrix: its value, and that of its inverse."""
SHARES = 4
"""Parts for each worker at least, so that none waits long for the others."""


def _silent(_: str) -> None:
    """For who wants to be told nothing."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """How a system is solved in blocks; the solution is that of one machine, to rounding.

    The matrix is cut along its elimination tree. Parts are eliminated one after the other from files to
    files, or by workers; one part and its files are in memory at a time. A cut needs separators: a system in
    which everything meets everything is solved whole, and `tell` says so.

    Attributes:
        memory: Of each process in the factorisation: `8GB`, or bytes; None for as much as there is.
        client: Who does the work: a `distributed.Client`, an executor of `concurrent.futures`, the address of
            a scheduler (`tcp://...`), or how many workers are to be started here; None for this process.
        work: Folder for files, which all workers read and write; that of temporary files when None. They are
            removed at the end.
        resume: Take up what a run that was stopped left in `work`.
        parts: At least so many parts where they can be cut; None to have it from `memory` and workers.
        tell: Receives what is done, and what it will take.
    """

    memory: str | int | None = None
    client: Value = None
    work: str | Path | None = None
    resume: bool = False
    parts: int | None = None
    tell: Callable[[str], None] = _silent

    @cached_property
    def run(self) -> Run:
        """The run, with its folder and its workers."""
        if self.resume and self.work is None:
            raise InputError("resume: name the folder of the run that was stopped (work)")
        return Run(self)

    def close(self, is_done: bool = True) -> None:
        """Ends the workers that were started, removes the files; in `work` they stay for who is not done."""
        if "run" in self.__dict__:
            self.run.close(is_done)

    def __enter__(self) -> Blocks:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(error is None)


class Run:
    """A run in blocks: its folder, its workers.

    Attributes:
        folder: where its files are.
        is_kept: whether the folder may outlive a run that is killed, for another to take it up.
    """

    def __init__(self, blocks: Blocks) -> None:
        self._tell, self._wanted = blocks.tell, blocks.parts
        self._memory = None if blocks.memory is None else bytes_of(blocks.memory)
        self.is_kept = blocks.work is not None
        self._workers = workers.Workers(blocks.client, self._memory)
        try:
            self._claim, self.folder = claimed(blocks.work, blocks.resume, blocks.tell)
        except InputError:
            self._workers.close()
            raise
        self._beside = 0
        self._end = finalize(self, _end, self._workers, self._claim, self.folder)

    def cut(self, tree: Tree, pattern: SymmetricPattern) -> Partition:
        """The parts of a matrix that memory and workers ask for.

        Raises:
            InputError: memory does not suffice, whatever the parts.
        """
        self._beside = WORKER if self._workers.count else in_use() + KEPT * pattern.nnz
        room = math.inf if self._memory is None else self._memory - self._beside
        wanted = self._wanted or (SHARES * self._workers.count if self._workers.count > 1 else 1)
        if room <= 0:
            raise InputError(self._too_little(""))
        share = min(tree.factor / wanted, room / ROOM)
        partition = tree.parts(share)
        while partition.room > room:
            finer = tree.parts(share / 2)
            if finer.room >= partition.room:
                raise InputError(self._too_little(f", and the largest part {told(partition.room)}"))
            share, partition = share / 2, finer
        return partition

    def _too_little(self, part: str) -> str:
        where = "a worker" if self._workers.count else "this process"
        beside = f"{where} takes {told(self._beside)} beside the parts{part}"
        return f"memory of {told(self._memory or 0)}: {beside}: give more memory"

    def analysed(self, partition: Partition, sizes: Sequence[tuple[int, int]]) -> None:
        """Tells what the parts are and take.

        Raises:
            InputError: the disk has no room for them.
        """
        parts, n = partition.parts, len(partition.unknowns)
        factor = sum(size for size, _ in sizes)
        rests = sum(4 * len(part.outer) * (len(part.outer) + 1) for part in parts)
        disk = 2 * factor + 2 * rests  # a factor and its inverse
        if len(parts) == 1:
            self._tell(f"blocks: {n:,} unknowns are solved whole, {self._why_whole()}")
            return
        widest = max(len(part.own) + len(part.outer) for part in parts)
        self._tell(
            f"blocks: {n:,} unknowns in {len(parts)} parts of at most {widest:,}; memory of the "
            f"factorisation {told(partition.room)} a part, beside {told(self._beside)}; "
            f"disk {told(disk)} in {self.folder}"
        )
        free = shutil.disk_usage(self.folder).free
        if free < disk:
            raise InputError(
                f"{self.folder}: blocks take {told(disk)}, and {told(free)} are free: make room, or name "
                "another folder (--work)"
            )

    def _why_whole(self) -> str:
        return (
            "which cannot be cut" if self._wanted or self._workers.count > 1 else "which memory suffices for"
        )

    def do(
        self,
        waits: Sequence[Sequence[int]],
        work: Callable[[int], tuple[Value, ...]],
        take: Callable[[int, Value], None],
    ) -> None:
        """Does tasks, each after those that it waits for.

        Args:
            waits: for each task, those that come before it.
            work: gives a function of `tasks` and its arguments.
            take: receives what a task gave.
        """
        blockers = [len(before) for before in waits]
        after: list[list[int]] = [[] for _ in waits]
        for k, before in enumerate(waits):
            for one in before:
                after[one].append(k)
        ready = [k for k, count in enumerate(blockers) if not count]
        running: dict[Future[Value], int] = {}
        self._workers.renew()
        try:
            while ready or running:
                while ready and len(running) < self._workers.at_once:
                    k = ready.pop()
                    function, *arguments = work(k)
                    running[self._workers.submit(task, VERSIONS, function, str(self.folder), *arguments)] = k
                ended = wait(running, workers.PATIENCE, FIRST_COMPLETED).done
                if not ended:
                    self._workers.check()
                for future in ended:
                    k = running.pop(future)
                    take(k, self._workers.result(future))
                    for following in after[k]:
                        blockers[following] -= 1
                        if not blockers[following]:
                            ready.append(following)
        finally:
            for future in running:
                future.cancel()

    def close(self, is_done: bool = True) -> None:
        """Ends the workers that were started, and removes the folder where it is of no use any more."""
        self._end.detach()
        _end(self._workers, self._claim, self.folder if is_done or not self.is_kept else None)


def _end(ends: workers.Workers, claim: IO[str], folder: Path | None) -> None:
    ends.close()
    claim.close()
    if folder is not None:
        shutil.rmtree(folder, ignore_errors=True)
