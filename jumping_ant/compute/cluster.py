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
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jumping_ant
from jumping_ant.base import machine, portable
from jumping_ant.base.errors import InputError, WorkerError
from jumping_ant.compute.workers import Died, Ended, Item, News, Work

NO_CLUSTER = ("", "local")  # with these values of RAY_ADDRESS, Ray itself joins none
SECONDS_FOR_ANSWER = 2.0
SECONDS_BETWEEN_LOOKS = 1.0
SECONDS_LOST = 15.0  # before a cluster is given up; after a minute, Ray would end this process


def address() -> str | None:
    """Return the address of the Ray cluster that `RAY_ADDRESS` names, None if there is none.

    `auto` is the cluster that this user, or root, has started on this machine with `ray start`.
    (Ray would also take another user's, who could then run code as this one.)
    """
    given = os.environ.get("RAY_ADDRESS", "")
    if given == "auto":
        return _started_here()
    return None if given in NO_CLUSTER else given


def _started_here() -> str | None:
    folder = os.environ.get("RAY_TMPDIR") or os.environ.get("TMPDIR") or "/tmp"
    with suppress(OSError), (Path(folder) / "ray" / "ray_current_cluster").open("rb") as file:
        if os.fstat(file.fileno()).st_uid in (os.getuid(), 0):
            noted = file.read(1000).decode(errors="replace").strip()
            return noted if _answers(noted) else None
    return None


def _answers(address: str) -> bool:
    """Tell whether something accepts connections at HOST:PORT, or ray://HOST:PORT."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), SECONDS_FOR_ANSWER).close()
    except (OSError, ValueError, OverflowError):
        return False
    return True


class Cluster:
    """Actors of a Ray cluster, each of which runs one job (see `workers.Workers`)."""

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
                f"RAY_ADDRESS: given {address!r}, which cannot be joined ({reason}); allowed: the "
                "address of a running cluster (with RAY_AUTH_MODE=token and its token, where it "
                "asks for one), or unset to compute on this machine"
            ) from error
        self._ray = ray
        context = ray.get_runtime_context()
        self._address, self._node = context.gcs_address, context.get_node_id()
        actor: Any = ray.remote(_Worker)
        self._worker = actor.options(num_cpus=1, max_concurrency=2)  # a second thread for `stop`
        self._wanted = kind()
        self._running: dict[Any, tuple[Any, Any]] = {}
        self._last_seen = self._last_asked = time.monotonic()
        self._is_left = threading.Event()
        self._watch = threading.Thread(target=self._look, daemon=True)
        self._watch.start()

    def run(self, key: Hashable, work: Work) -> None:
        """Start a job."""
        worker = self._worker.remote(self._wanted)
        self._running[worker.run.remote(pickle.dumps(work))] = key, worker

    def news(self, timeout: float) -> Iterator[tuple[Any, News]]:
        """Wait for news of running jobs.

        Raises:
            InputError: A machine computes otherwise.
            WorkerError: The cluster has been lost, for which Ray would wait for ever.
        """
        ready, _ = self._ray.wait(list(self._running), num_returns=1, timeout=timeout)
        now = time.monotonic()
        if now - self._last_asked > SECONDS_LOST:  # after Ctrl-Z, say, nothing has looked since
            self._last_seen = now
        self._last_asked = now
        if now - self._last_seen > SECONDS_LOST:
            raise WorkerError(
                f"the Ray cluster at {self._address} is lost; once it runs again, the next run "
                "resumes"
            )
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
            if isinstance(item, _Unlike):
                raise InputError(item.told())
            return Item(item)
        except StopIteration:
            return Ended()
        except (errors.RayActorError, errors.OutOfMemoryError) as error:
            return Died(str(error).strip().partition("\n")[0])

    def _look(self) -> None:
        """Note when the cluster was last seen, in a thread of its own.

        A cluster that is lost between two calls would keep the second one waiting.
        """
        while not self._is_left.wait(SECONDS_BETWEEN_LOOKS):
            with suppress(self._ray.exceptions.RayError):
                if _answers(self._address) and any(
                    node["Alive"] for node in self._ray.nodes() if node["NodeID"] == self._node
                ):
                    self._last_seen = time.monotonic()

    def stop(self) -> None:
        """Ask all running jobs to stop."""
        for _, worker in self._running.values():
            worker.stop.remote()

    def close(self) -> None:
        """End all processes, and leave the cluster."""
        self._is_left.set()
        self._watch.join(SECONDS_FOR_ANSWER)  # of a lost cluster, it may wait for ever
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


@dataclass(frozen=True)
class _Unlike:
    """A machine that would compute other bytes than the one that asks for them."""

    host: str
    given: dict[str, str]
    wanted: dict[str, str]

    def told(self) -> str:
        """Return what differs, in words."""
        names = [name for name, value in self.wanted.items() if self.given[name] != value]
        given, allowed = (
            ", ".join(f"{name} {own[name]}" for name in names) for own in (self.given, self.wanted)
        )
        return (
            f"RAY_ADDRESS: given a cluster whose machine {self.host} has {given}; "
            f"allowed: {allowed}, as here, so that every machine computes the same bytes"
        )


class _Worker:
    """A process that runs one job at a time, and can be told to stop while it runs."""

    def __init__(self, wanted: dict[str, str]) -> None:
        self._wanted = wanted
        self._stop = threading.Event()

    def run(self, work: bytes) -> Iterator[Any]:
        """Yield the items of a pickled job, or what is wrong with this machine."""
        if (own := kind()) != self._wanted:
            yield _Unlike(socket.gethostname(), own, self._wanted)
            return
        # Not before: where a package is missing, it cannot be read.
        yield from pickle.loads(work)(self._stop)

    def stop(self) -> None:
        """Ask the job to stop."""
        self._stop.set()
