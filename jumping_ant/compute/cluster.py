"""Workers on a Ray cluster that runs already; Ray uploads the code, so nothing needs to be shared.

This module starts none of Ray's servers.
"""

import importlib.metadata
import logging
import os
import pickle
import platform
import socket
import threading
import time
from collections.abc import Hashable, Iterator
from pathlib import Path
from typing import Any

import jumping_ant
from jumping_ant.base import machine, portable
from jumping_ant.base.errors import InputError, WorkerError
from jumping_ant.compute.processes import Ended, Item, News, Work

SECONDS_FOR_ANSWER = 2.0
SECONDS_LOST = 15.0  # before a cluster is given up; after a minute, Ray would end this process


def address() -> str | None:
    """Return the address of the Ray cluster that `RAY_ADDRESS` names, None if there is none."""
    address = os.environ.get("RAY_ADDRESS", "local")  # with which Ray itself joins none
    return None if address in ("", "local") else address


def _answers(address: str) -> bool:
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), SECONDS_FOR_ANSWER).close()
    except (OSError, ValueError, OverflowError):
        return False
    return True


class Cluster:
    """Actors of a Ray cluster, each of which runs one job, as `Processes` do."""

    def __init__(self, address: str) -> None:
        import ray  # takes a second, which training on one machine does without
        from ray.exceptions import AuthenticationError

        try:
            if not _answers(address):
                raise ConnectionError("nothing answers there")  # Ray would try for minutes
            ray.init(
                address,
                runtime_env={
                    "py_modules": [str(Path(jumping_ant.__file__).parent)],
                    "env_vars": portable.SWITCHES,
                },
                logging_level=logging.ERROR,
                log_to_driver=False,
            )
        except (ConnectionError, AuthenticationError) as error:
            reason = str(error).strip().partition("\n")[0]
            raise InputError(
                f"RAY_ADDRESS: given {address!r}, which cannot be joined ({reason}); allowed: "
                "HOST:PORT of a running cluster (with RAY_AUTH_MODE=token and its token, where it "
                "asks for one), or unset to compute on this machine"
            ) from error
        self._ray = ray
        self._address = ray.get_runtime_context().gcs_address
        actor: Any = ray.remote(_Worker)
        self._worker = actor.options(num_cpus=1, max_concurrency=2)  # a second thread for `stop`
        self._wanted = kind()
        self._running: dict[Any, tuple[Any, Any]] = {}
        self._last_seen = time.monotonic()

    def run(self, key: Hashable, work: Work) -> None:
        """Start a job."""
        worker = self._worker.remote(self._wanted)
        self._running[worker.run.remote(pickle.dumps(work))] = key, worker

    def news(self, timeout: float) -> Iterator[tuple[Any, News]]:
        """Wait for news of running jobs; a WorkerError says that the cluster is lost."""
        ready, _ = self._ray.wait(list(self._running), num_returns=1, timeout=timeout)
        if _answers(self._address):
            self._last_seen = time.monotonic()
        elif time.monotonic() - self._last_seen > SECONDS_LOST:  # Ray would wait for ever
            advice = "once it runs again, the next run resumes"
            raise WorkerError(f"the Ray cluster at {self._address} is lost; {advice}")
        for generator in ready:
            key, worker = self._running[generator]
            news = self._next(generator)
            if not isinstance(news, Item):
                del self._running[generator]
                self._ray.kill(worker)  # frees its core, which another may wait for
            yield key, news

    def _next(self, generator: Any) -> News:
        errors = self._ray.exceptions
        try:
            item = self._ray.get(next(generator))
            if isinstance(item, InputError):
                raise item
            return Item(item)
        except StopIteration:
            return Ended()
        except (errors.RayActorError, errors.OutOfMemoryError) as error:
            return Ended(str(error).strip().partition("\n")[0])

    def stop(self) -> None:
        """Ask all running jobs to stop."""
        for _, worker in self._running.values():
            worker.stop.remote()

    def close(self) -> None:
        """End all processes, and leave the cluster."""
        self._ray.shutdown()


def kind() -> dict[str, str]:
    """Return what the bytes that this machine computes depend on."""
    return {
        **{name: _version(name) for name in machine.PACKAGES},
        "system": f"{platform.system()} {platform.machine()}",
        "processor": "any with AVX2 and FMA" if portable.is_supported() else machine.processor(),
    }


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "missing"


def _unlike(wanted: dict[str, str]) -> InputError | None:
    """Return why this machine would compute other bytes than the one that asks, None if not."""
    here = kind()
    names = [name for name in wanted if here[name] != wanted[name]]
    if not names:
        return None
    has, allowed = (", ".join(f"{name} {it[name]}" for name in names) for it in (here, wanted))
    return InputError(
        f"RAY_ADDRESS: given a cluster whose machine {socket.gethostname()} has {has}; "
        f"allowed: {allowed}, as here, so that every machine computes the same bytes"
    )


class _Worker:
    """A process that runs one job, and can be asked to stop meanwhile."""

    def __init__(self, wanted: dict[str, str]) -> None:
        self._wanted = wanted
        self._stop = threading.Event()

    def run(self, work: bytes) -> Iterator[Any]:
        """Yield the items of a pickled job, or what is wrong with this machine."""
        if error := _unlike(self._wanted):
            yield error
        else:  # not before: where a package is missing, it cannot be read
            yield from pickle.loads(work)(self._stop)

    def stop(self) -> None:
        """Ask the job to stop."""
        self._stop.set()
