"""Who does the pieces of a study: this thread, threads, processes, any executor, a Dask cluster.

All do the same work on the same pieces, so all give the same bits. Pieces of a worker that dies are done again.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, ThreadPoolExecutor, wait
from typing import Any, NamedTuple

import numpy as np

from headway.errors import HeadwayError, shorten, unknown_name
from headway.study.work import Job, Piece

__all__ = ["Task", "cores", "perform"]

#: how often a piece is tried on workers that die
_TRIES = 4

#: seconds to wait for a scheduler
_PATIENCE = 5

_KINDS = ("serial", "threads", "processes", "dask://host:port")


class Task(NamedTuple):
    """A piece to be done: its number, the values of each path at its points, and how many there are."""

    number: int
    columns: Mapping[str, np.ndarray]
    points: int


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def perform(job: Job, tasks: Iterator[Task], executor: Any = "serial") -> Iterator[tuple[int, Piece]]:
    """Do all tasks and give (number, answer) as they are ready; see `Study.run` for `executor`."""
    if executor == "serial":
        worker = job.worker()
        return ((t.number, worker(t.columns, t.points)) for t in tasks)
    if executor == "threads":
        worker = job.worker()
        return _pooled(lambda: ThreadPoolExecutor(cores()), worker.__call__, tasks, 2 * cores())
    if executor == "processes":
        return _pooled(_processes, _Elsewhere(job), tasks, 2 * cores())
    if isinstance(executor, str) and executor.startswith("dask://"):
        return _dask(_client(executor), job, tasks, close=True)
    if isinstance(executor, Executor):
        return _pooled(lambda: executor, _Elsewhere(job), tasks, 4 * cores(), own=False)
    if hasattr(executor, "get_executor"):
        return _dask(executor, job, tasks, close=False)
    if isinstance(executor, str):
        raise unknown_name("executor", executor, _KINDS)
    raise HeadwayError(f"executor = {shorten(executor)} is neither {', '.join(_KINDS)} nor an executor nor a client")


def _pooled(
    make: Callable[[], Executor], work: Callable[..., Piece], tasks: Iterator[Task], most: int, own: bool = True
) -> Iterator[tuple[int, Piece]]:
    """Keep `most` tasks under way; where the pool breaks, make another and do again what was under way."""
    pool, running, tries = make(), {}, {}  # type: ignore[var-annotated]  # Future → Task, number → tries
    try:
        again: list[Task] = []
        while True:
            while len(running) < most and (task := again.pop() if again else next(tasks, None)):
                tries[task.number] = tries.get(task.number, 0) + 1
                try:
                    running[pool.submit(work, task.columns, task.points)] = task
                except BrokenExecutor:
                    again.append(task)
                    break
            if not running and not again:
                return
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            broken = bool(again and not running)
            for future in done:
                task = running.pop(future)
                try:
                    answer = future.result()
                except Exception as error:
                    if not _died(error):
                        raise
                    if tries[task.number] >= _TRIES or not own:
                        raise HeadwayError(
                            f"executor: workers died {tries[task.number]} times while doing piece {task.number}; "
                            "what is done stays in the store, if there is one"
                        ) from None
                    again.append(task)
                    broken = True
                    continue
                tries.pop(task.number)
                yield task.number, answer
            if broken:
                again += running.values()
                running = {}
                pool.shutdown(wait=False, cancel_futures=True)
                pool = make()
    finally:
        for future in running:
            future.cancel()
        if own:
            pool.shutdown(wait=False, cancel_futures=True)


def _died(error: BaseException) -> bool:
    """Whether an error says that a worker died, of a pool or of a cluster."""
    return isinstance(error, BrokenExecutor) or type(error).__name__ == "KilledWorker"


def _processes() -> Executor:
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    # spawned, not forked: threads of numerical libraries do not survive a fork
    return ProcessPoolExecutor(cores(), multiprocessing.get_context("spawn"), _quiet)


def _quiet() -> None:
    """Leave Ctrl-C to the process that was typed at."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _client(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError:
        raise HeadwayError(f"executor {address} needs Dask: pip install 'headway[cluster]'") from None
    import logging

    place = address.removeprefix("dask://")
    for name in ("distributed.comm", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        return Client(f"tcp://{place}", timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise HeadwayError(
            f"executor {address}: no scheduler answers there within {_PATIENCE} s ({shorten(reason, 100)}); "
            "start one with: dask scheduler"
        ) from None


def _dask(client: Any, job: Job, tasks: Iterator[Task], close: bool) -> Iterator[tuple[int, Piece]]:
    """On a Dask cluster, which does the pieces of a worker that dies elsewhere."""
    threads = sum(client.ncores().values())
    if not threads:
        place = client.scheduler.address
        if close:
            client.close()
        raise HeadwayError(f"executor: the scheduler at {place} has no workers; start one with: dask worker {place}")
    pool = client.get_executor(pure=False, retries=1)
    try:
        yield from _pooled(lambda: pool, _Elsewhere(job), tasks, 3 * threads, own=False)
    finally:
        pool.shutdown(wait=False)  # lets go of what is under way, not of the cluster
        if close:
            client.close()


_WORKERS: dict[str, Any] = {}
_LOCK = threading.Lock()


class _Elsewhere:
    """The work as something that can be sent: a job, for which the process that gets it keeps one worker."""

    def __init__(self, job: Job) -> None:
        try:
            self.packed = pickle.dumps(job)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise HeadwayError(
                f"executor: the study cannot be sent to other processes ({error}); use threads"
            ) from None
        self.name = hashlib.sha256(self.packed).hexdigest()

    def __call__(self, columns: Mapping[str, np.ndarray], count: int) -> Piece:
        with _LOCK:
            worker = _WORKERS.get(self.name)
            if worker is None:
                _WORKERS.clear()  # one study at a time
                worker = _WORKERS[self.name] = pickle.loads(self.packed).worker()
        return worker(columns, count)
