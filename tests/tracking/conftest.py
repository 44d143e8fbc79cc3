"""Projects to track, bare, trained and tracked."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import mlflow
import pytest
from tracked_project import (
    OnServer,
    copy_tracked,
    curve_lines,
    follow,
    make_bare,
    make_whole,
    tracked,
    unset_variables,
)

from jumping_ant.base.files import write_text
from jumping_ant.base.paths import Paths
from soak import mlflow_server


@pytest.fixture(scope="session")
def empty_database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """MLflow takes seconds to make its tables: once is enough."""
    path = tmp_path_factory.mktemp("mlflow") / "empty.db"
    mlflow.MlflowClient(f"sqlite:///{path}").search_experiments()
    return path


@pytest.fixture(scope="session")
def tracked_template(tmp_path_factory: pytest.TempPathFactory, empty_database: Path) -> Path:
    root = tmp_path_factory.mktemp("template") / "a project"
    make_bare(root, empty_database)
    make_whole(root)
    with pytest.MonkeyPatch.context() as monkeypatch:
        unset_variables(monkeypatch)
        tracked(root)
    return root


@pytest.fixture(scope="session")
def on_server(tmp_path_factory: pytest.TempPathFactory, empty_database: Path) -> Iterator[OnServer]:
    """A project that was followed while it trained, and tracked."""
    root = tmp_path_factory.mktemp("pages") / "a project"
    make_bare(root, empty_database)
    folder = root / "server"
    folder.mkdir()
    shutil.copy(empty_database, folder / "mlflow.db")
    with mlflow_server.running(folder, f"sqlite:///{folder / 'mlflow.db'}") as server:
        with pytest.MonkeyPatch.context() as patch:
            unset_variables(patch)
            patch.setenv("MLFLOW_TRACKING_URI", server.uri)
            write_text(Paths(root).agent("sac").seed(1).curve, curve_lines(1))
            follow(root, lambda seconds: True)
            make_whole(root)
            lines = tracked(root)
        yield OnServer(server.uri, folder, root, lines)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Where a test works. None may leave an ./mlruns."""
    unset_variables(monkeypatch)
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    assert not list(tmp_path.rglob("mlruns"))


@pytest.fixture
def bare_project(folder: Path, empty_database: Path) -> Path:
    """A project with nothing trained."""
    make_bare(folder / "a project", empty_database)
    return folder / "a project"


@pytest.fixture
def untracked_project(bare_project: Path) -> Path:
    """A project with everything trained, evaluated and compared."""
    make_whole(bare_project)
    return bare_project


@pytest.fixture
def project(folder: Path, tracked_template: Path) -> Path:
    """The same, tracked: a copy, with the paths in its database set right.

    MLflow remembers where the artifacts of a run are: a test that damages them needs runs of its
    own, and tracks `untracked_project`.
    """
    copy_tracked(tracked_template, folder / "a project")
    return folder / "a project"
