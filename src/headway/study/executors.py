"""Who does the pieces of a study: this thread, threads, processes, any executor, a Dask cluster.

All do the same work on the same pieces, so all give the same bits. Pieces of a worker that dies are done again.
Whoever leaves a workforce early, with Ctrl-C or an error, leaves nothing behind that goes on working.
"""

from __future__ import annotations

import functools
import hashlib
import itertools
import multiprocessing
import os
import pickle
import signal
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from headway.errors import HeadwayError, shorten, unknown_name
from headway.study.work import Job, Piece

__all__ = ["Task", "cores", "workforce"]

#: how often a piece is tried on workers that die
_TRIES = 4

#: seconds to wait for a scheduler, and for its goodbye
_PATIENCE, _GOODBYE = 5, 0.5

_KINDS = ("serial", "threads", "processes", "dask://host:port")


class Task(NamedTuple):
    """A piece to be done.

    Attributes:
        number: number of the piece.
        columns: path → values at its points.
        points: how many points it has.
    """

    number: int
    columns: Mapping[str, np.ndarray]
    points: int


Work = Callable[[Mapping[str, np.ndarray], int], Piece]
Answers = Iterator[tuple[int, Piece]]


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def workforce(job: Job, executor: Any) -> Iterator[Callable[[Iterable[Task]], Answers]]:
    """A function that does tasks of a job on an executor, and answers (number, piece) as pieces are ready.

    Args:
        job: The study without its points.
        executor: See `Study.run`.

    Raises:
        HeadwayError: On entering, if the executor cannot be had; so nothing was begun in vain.
    """
    if isinstance(executor, str) and executor in ("serial", "threads"):
        worker = job.worker()
        if executor == "serial":
            yield lambda tasks: ((t.number, worker(t.columns, t.points)) for t in tasks)
            return
        pool = ThreadPoolExecutor(cores())
        try:
            yield functools.partial(_windowed, pool, worker.__call__, 2 * cores())
        finally:
            worker.stop.set()
            pool.shutdown(wait=False, cancel_futures=True)
    elif isinstance(executor, str) and executor == "processes":
        with _lifeline() as line:
            yield functools.partial(_replaced, functools.partial(_processes, line), _Elsewhere(job))
    elif isinstance(executor, Executor):
        yield functools.partial(_guarded, executor, _Elsewhere(job), 4 * cores())
    elif isinstance(executor, str) and executor.startswith("dask://"):
        work, client = _Elsewhere(job), _client(executor)
        try:
            with _dask(client, work) as perform:
                yield perform
        finally:
            client.close(timeout=_GOODBYE)
    elif hasattr(executor, "get_executor"):
        with _dask(executor, _Elsewhere(job)) as perform:
            yield perform
    elif isinstance(executor, str):
        raise unknown_name("executor", executor, _KINDS)
    else:
        raise HeadwayError(
            f"executor = {shorten(executor)} is neither {', '.join(_KINDS)} nor an executor nor a client"
        )


def _windowed(
    pool: Executor, work: Work, most: int, tasks: Iterable[Task], running: dict[Future[Piece], int] | None = None
) -> Answers:
    """Answers of a pool, with at most `most` tasks under way: those in `running`, which the caller may cancel."""
    waiting, running = iter(tasks), {} if running is None else running
    while True:
        for task in itertools.islice(waiting, most - len(running)):
            running[pool.submit(work, task.columns, task.points)] = task.number
        if not running:
            return
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            number = running.pop(future)
            yield number, future.result()


def _guarded(pool: Executor, work: Work, most: int, tasks: Iterable[Task], death: Any = BrokenExecutor) -> Answers:
    """Answers of a pool that is not ours: where workers die for good, that is the end."""
    running: dict[Future[Piece], int] = {}
    try:
        yield from _windowed(pool, work, most, tasks, running)
    except death as error:
        raise _died(type(error).__name__) from None
    finally:
        for future in running:
            future.cancel()


def _replaced(make: Callable[[], Executor], work: Work, tasks: Iterable[Task]) -> Answers:
    """Answers of pools of our own: where one breaks, another does what has no answer yet."""
    tries: Counter[int] = Counter()
    pending: dict[int, Task] = {}

    def noted(batch: Iterable[Task]) -> Iterator[Task]:
        for task in batch:
            pending[task.number] = task
            tries[task.number] += 1
            yield task

    todo = iter(tasks)
    while True:
        pool = make()
        try:
            for number, piece in _windowed(pool, work, 2 * cores(), noted(todo)):
                del pending[number], tries[number]
                yield number, piece
            return
        except BrokenExecutor:
            number, count = tries.most_common(1)[0]
            if count >= _TRIES:
                raise _died(f"{count} times while doing piece {number}") from None
            todo = itertools.chain(list(pending.values()), todo)
        finally:
            pool.shutdown(wait=False)  # what is under way ends with the lifeline


def _died(how: str) -> HeadwayError:
    return HeadwayError(f"executor: workers died ({how}); what is done stays in the store, if there is one")


# -- processes -------------------------------------------------------------------------------------


class _Line(NamedTuple):
    """A pipe that workers watch, and the workers."""

    watched: Any
    workers: set[Any]


@contextmanager
def _lifeline() -> Iterator[_Line]:
    """A pipe whose other end closes when this process lets go of it, also by dying; workers end with it."""
    watched, held = multiprocessing.get_context("spawn").Pipe(duplex=False)
    line = _Line(watched, set())
    try:
        yield line
    finally:
        held.close()
        for worker in line.workers:
            worker.kill()  # one that is just being started does not watch yet
        watched.close()


def _processes(line: _Line) -> Executor:
    from concurrent.futures import ProcessPoolExecutor

    class Pool(ProcessPoolExecutor):
        def submit(self, *args: Any, **kwargs: Any) -> Future[Any]:
            before = set(multiprocessing.active_children())
            with _deaf():  # this is where workers are started
                future = super().submit(*args, **kwargs)
            line.workers.update(set(multiprocessing.active_children()) - before)
            return future

    # spawned, not forked: threads of numerical libraries do not survive a fork
    return Pool(cores(), multiprocessing.get_context("spawn"), _watch, (line.watched,))


@contextmanager
def _deaf() -> Iterator[None]:
    """Start processes that never hear Ctrl-C, which is for the process that was typed at."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _watch(line: Any) -> None:
    """End this worker as soon as the other end of the line is gone."""

    def end() -> None:
        try:
            line.recv_bytes()
        except (EOFError, OSError):
            os._exit(1)

    threading.Thread(target=end, daemon=True).start()


# -- Dask ------------------------------------------------------------------------------------------


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


@contextmanager
def _dask(client: Any, work: Work) -> Iterator[Callable[[Iterable[Task]], Answers]]:
    """Have pieces done on a Dask cluster, which moves those of a worker that dies."""
    from distributed.scheduler import KilledWorker

    threads = sum(client.ncores().values())
    if not threads:
        place = client.scheduler.address
        raise HeadwayError(f"executor: the scheduler at {place} has no workers; start one with: dask worker {place}")
    pool = client.get_executor(pure=False, retries=1)
    try:
        yield functools.partial(_guarded, pool, work, 3 * threads, death=KilledWorker)
    finally:
        pool.shutdown(wait=False)  # lets go of what is under way, not of the cluster


_WORKERS: dict[str, Any] = {}
_LOCK = threading.Lock()


class _Elsewhere:
    """A job that can be sent to another process, which keeps one worker for it."""

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
