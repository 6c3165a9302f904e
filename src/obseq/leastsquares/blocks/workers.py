"""Who does the tasks: this process, a pool, or Dask, which gives those of a lost worker to another one."""

from __future__ import annotations

from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from typing import TYPE_CHECKING

from obseq.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.leastsquares.blocks.files import Value


PATIENCE = 60.0
"""Seconds without a task that ends, after which workers are looked for."""
STARTING = 300.0
"""Seconds for one to come back: on a busy machine it takes minutes to start."""
_AGAIN = "start others, and take up what was done (--work, --resume)"


class Workers:
    """Executes tasks.

    Args:
        client: None for this process, the number of workers to be started on this machine, the address of a
            scheduler, a `distributed.Client`, or an executor of `concurrent.futures`.
        memory: bytes of each worker that is started; None for no limit.

    Attributes:
        count: how many workers there are; 0 for this process.

    Raises:
        InputError: it is none of them, or Dask is not installed.
    """

    def __init__(self, client: Value, memory: int | None) -> None:
        self._ends: list[Value] = []
        self._client: Value = None
        self._cluster: Value = None
        if isinstance(client, int) and not isinstance(client, bool):
            client = self._started(client, memory)
        elif isinstance(client, str):
            client = self._own(_dask().Client(client))
        self.count, self._executor = 0, None
        if type(client).__module__.startswith("distributed.cfexecutor"):
            raise InputError("blocks: give the Dask client in place of its executor, which waits for ever")
        if isinstance(client, Executor):
            self.count, self._executor = int(getattr(client, "_max_workers", 1)), client
        elif hasattr(client, "get_executor"):
            self._client = client
            self.count = max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
            self._executor = client.get_executor(pure=False)
        elif client is not None:
            raise InputError(f"blocks: a Dask client, its address or an executor is wanted, not {client!r}")

    @property
    def at_once(self) -> int:
        """How many tasks are given away before one is waited for."""
        return 2 * self.count if self.count else 1

    def submit(self, function: Callable[..., Value], *arguments: Value) -> Future[Value]:
        """Gives a task away; does it where nobody else is there."""
        if self._executor is not None:
            return self._executor.submit(function, *arguments)
        done: Future[Value] = Future()
        done.set_result(function(*arguments))
        return done

    def renew(self) -> None:
        """Starts workers in the places of those of this machine that were lost.

        Dask does it too, but gives up one that is not back after 15 s, for good.
        """
        if self._cluster is not None:
            self._cluster.scale(self.count)

    def check(self) -> None:
        """Looks whether there are workers, where nothing ends any more.

        Raises:
            InputError: there is none, and none comes.
        """
        self.renew()
        if self._client is None:
            return
        try:
            self._client.wait_for_workers(1, STARTING)
        except TimeoutError:
            raise InputError(f"blocks: no worker is left; {_AGAIN}") from None

    def result(self, ended: Future[Value]) -> Value:
        """What a task gave.

        Raises:
            InputError: it was lost, with its pool or its scheduler, or with one worker after the other.
        """
        lost: tuple[type[BaseException], ...] = (BrokenExecutor, CancelledError)
        if self._client is not None:
            lost = (*lost, _dask().KilledWorker)
        try:
            return ended.result()
        except lost as error:
            raise InputError(
                f"blocks: a part was lost with who treated it ({type(error).__name__}), as where memory "
                f"does not suffice: give them more, or make parts smaller (--memory); {_AGAIN}"
            ) from error

    def close(self) -> None:
        """Ends the workers that were started."""
        while self._ends:
            self._ends.pop().close()

    def _own(self, thing: Value) -> Value:
        self._ends.append(thing)
        return thing

    def _started(self, count: int, memory: int | None) -> Value:
        dask = _dask()
        self._cluster = self._own(
            dask.LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                dashboard_address="127.0.0.1:0",
                memory_limit=memory or 0,
            )
        )
        client = self._own(dask.Client(self._cluster))
        client.wait_for_workers(count)
        return client


def _dask() -> Value:
    try:
        import distributed
    except ImportError:
        raise InputError('workers need Dask: pip install "obseq[dask]"') from None
    return distributed
