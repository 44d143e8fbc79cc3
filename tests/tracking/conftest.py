"""Projects to track, bare, trained and tracked."""

from collections.abc import Iterator
from pathlib import Path

import mlflow
import pytest
from tracked_project import copy_tracked, make_bare, make_whole, tracked, unset_variables


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
