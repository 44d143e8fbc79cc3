"""A Ray cluster that is started for the tests, and an environment without one."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
import small_ray


@pytest.fixture(autouse=True, scope="module")
def workers_find_the_jobs() -> Iterator[None]:
    """Ray's workers, too, which do not have this process's `sys.path`, nor the user's token."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv("RAY_AUTH_MODE", "disabled")
        monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
        yield


@pytest.fixture(scope="module")
def ray_address(workers_find_the_jobs: None) -> Iterator[str]:
    """A cluster of one node."""
    port = small_ray.free_port()
    with tempfile.TemporaryDirectory(prefix="ray") as folder, small_ray.started(folder, port):
        yield f"127.0.0.1:{port}"


@pytest.fixture
def no_cluster(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)


@pytest.fixture
def on_cluster(monkeypatch: pytest.MonkeyPatch, ray_address: str) -> str:
    monkeypatch.setenv("RAY_ADDRESS", ray_address)
    return ray_address
