"""Surroundings that are not as usual: another locale, limits, a poor container."""

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

from jumping_ant.base.files import PROJECT_ROOT
from scripts.checkout import Checkout, copy_project, with_tools
from soak import project as projects

PLAIN = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
READ_ONLY = "/proc"  # for root as well
# Root of a user namespace, who makes nothing shareable, and then is somebody whom nobody knows.
POOR = """
mount -t tmpfs -o ro tmpfs /dev/shm && ulimit -n 64 &&
exec taskset -c "$CORE" unshare --user --map-user=12345 --map-group=12345 "$@"
"""
AS_ROOT = ("unshare", "--user", "--map-root-user", "--mount", "sh", "-c", POOR, "sh")
NAMES = {"LOGNAME", "USER", "LNAME", "USERNAME"}


def run(
    folder: Path, *command: str, env: Mapping[str, str] = os.environ
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=folder, env=env, encoding="utf-8", capture_output=True)


def test_text_is_utf_8_whatever_the_locale(tmp_path: Path) -> None:
    copy_project(tmp_path)
    outputs = []
    for variables in ({}, PLAIN):
        for stage in ("digest", "build"):
            done = run(
                tmp_path, sys.executable, "-m", f"stages.{stage}", env=os.environ | variables
            )
            assert done.returncode == 0, done.stderr
        paths = [*tmp_path.glob(".inputs/**/*.json"), *tmp_path.glob("assets/*")]
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
    done = run(PROJECT_ROOT, sys.executable, "-c", code)
    assert done.returncode == 1
    assert done.stderr == f"error: {line}; run it again once that is mended\n"


def test_a_training_needs_little_of_its_surroundings(tmp_path: Path) -> None:
    """One core, few files, no shared memory, no UTF-8, a read-only home and no name at once."""
    kept = {name: value for name, value in with_tools().items() if name not in NAMES}
    poor = kept | PLAIN | {"CORE": str(min(os.sched_getaffinity(0))), "HOME": READ_ONLY}
    tried = run(tmp_path, *AS_ROOT, "true", env=poor)
    if tried.returncode:
        pytest.skip(f"no user namespaces here: {tried.stderr.strip()}")
    copy = Checkout(tmp_path / "project")
    copy_project(copy.folder)
    content = projects.settings_of("metronome").model_dump()
    content["compute"]["workers"] = 2
    copy.write_params(content)
    copy.seconds(sys.executable, "-m", "stages.build")
    # `make`, without what it would install, for what it sets.
    recipe = "train: ; @dvc status digest > /dev/null && python -m stages.train metronome"
    done = run(copy.folder, *AS_ROOT, "make", "--eval", recipe, "train", env=poor)
    assert done.returncode == 0, done.stderr
    assert len(list((copy.folder / "models" / "metronome").glob("seed-*/policy.zip"))) == 2


def test_packages_are_installed_where_the_home_is_read_only(tmp_path: Path) -> None:
    """They are there already, but uv needs its cache to see that."""
    for name in ("scripts/environment.sh", "shared.lock"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy2(PROJECT_ROOT / name, tmp_path / name)
    (tmp_path / ".venv").symlink_to(sys.prefix)
    kept = {name: value for name, value in os.environ.items() if not name.endswith("CACHE_DIR")}
    home = {"HOME": READ_ONLY, "XDG_CACHE_HOME": ""}
    done = run(tmp_path, "scripts/environment.sh", "shared", env=kept | home)
    assert done.returncode == 0, done.stderr
