"""Surroundings that are not as usual: another locale, limits, a poor container."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from jumping_ant.base.files import PROJECT_ROOT
from scripts.checkout import Checkout, copy_project, with_tools
from soak import project as projects

PLAIN = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("surroundings") / "project"
    copy_project(folder)
    return folder


def python(project: Path, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=project,
        env=os.environ | variables,
        encoding="utf-8",
        capture_output=True,
    )


@pytest.mark.parametrize(("stage", "folder"), [("digest", ".inputs"), ("build", "assets")])
def test_text_is_utf_8_whatever_the_locale(project: Path, stage: str, folder: str) -> None:
    outputs = []
    for variables in ({}, PLAIN):
        done = python(project, "-m", f"stages.{stage}", **variables)
        assert done.returncode == 0, done.stderr
        paths = [path for path in (project / folder).rglob("*") if path.is_file()]
        outputs.append({path: path.read_bytes() for path in paths})
    assert outputs[0] == outputs[1] != {}


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (OSError(27, "File too large"), "[Errno 27] File too large"),
        (MemoryError(), "out of memory"),
        (RuntimeError("can't start new thread"), "can't start new thread"),
    ],
)
def test_a_limit_of_the_system_ends_a_stage_in_a_line(error: Exception, line: str) -> None:
    code = f"from stages import run\ndef main(): raise {error!r}\nrun(main)"
    done = python(PROJECT_ROOT, "-c", code)
    assert done.returncode == 1
    assert done.stderr == f"error: {line}; nothing already computed is lost\n"


# Root of a user namespace, who makes nothing shareable, and then is somebody whom nobody knows.
POOR = """
mount -t tmpfs -o ro tmpfs /dev/shm && ulimit -n 64 &&
exec taskset -c "$CORE" unshare --user --map-user=12345 --map-group=12345 "$@"
"""
AS_ROOT = ("unshare", "--user", "--map-root-user", "--mount", "sh", "-c", POOR, "sh")
NAMES = ("LOGNAME", "USER", "LNAME", "USERNAME")
READ_ONLY = "/proc"  # for root as well


@pytest.fixture
def poor() -> dict[str, str]:
    """The environment variables of commands of `AS_ROOT`, in a locale that is not UTF-8."""
    kept = {name: value for name, value in with_tools().items() if name not in NAMES}
    own = {"CORE": str(min(os.sched_getaffinity(0))), "HOME": READ_ONLY}
    variables = kept | PLAIN | own
    tried = subprocess.run([*AS_ROOT, "true"], env=variables, capture_output=True, encoding="utf-8")
    if tried.returncode:
        pytest.skip(f"no user namespaces here: {tried.stderr.strip()}")
    return variables


def test_a_training_needs_little_of_its_surroundings(tmp_path: Path, poor: dict[str, str]) -> None:
    """One core, few files, no shared memory, a read-only home and no name, all at once."""
    copy = Checkout(tmp_path / "project")
    copy_project(copy.folder)
    content = projects.settings_of("metronome").model_dump()
    content["compute"]["workers"] = 2
    copy.write_params(content)
    copy.seconds(sys.executable, "-m", "stages.build")
    # `make`, without what it would install, for what it sets.
    recipe = "train: ; @dvc status digest > /dev/null && python -m stages.train metronome"
    done = subprocess.run(
        [*AS_ROOT, "make", "--eval", recipe, "train"],
        cwd=copy.folder,
        env=poor,
        encoding="utf-8",
        capture_output=True,
    )
    assert done.returncode == 0, done.stderr
    trained = sorted((copy.folder / "models" / "metronome").glob("seed-*/policy.zip"))
    assert len(trained) == 2


def test_packages_are_installed_where_the_home_is_read_only(tmp_path: Path) -> None:
    """They are there already, but uv needs its cache to tell."""
    for name in ("scripts/environment.sh", "shared.lock"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy2(PROJECT_ROOT / name, tmp_path / name)
    (tmp_path / ".venv").symlink_to(sys.prefix)
    own = {"HOME": READ_ONLY, "XDG_CACHE_HOME": "", "UV_CACHE_DIR": ""}
    done = subprocess.run(
        ["scripts/environment.sh", "shared"],
        cwd=tmp_path,
        env={name: value for name, value in (os.environ | own).items() if value},
        encoding="utf-8",
        capture_output=True,
    )
    assert done.returncode == 0, done.stderr
