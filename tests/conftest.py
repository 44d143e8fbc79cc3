"""What many tests share: a robot and a task whose numbers the tests know.

`params.yaml` is there to be changed; tests hold whatever it says, so those that compute with its
numbers take them from here.
"""

import os
from collections.abc import Iterator
from functools import cache

import browser
import finished_project
import pytest
from finished_project import Project
from playwright.sync_api import Browser

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.base import effective_code
from jumping_ant.params import article, params_file
from jumping_ant.params.blocks import EnvParams, EvaluateParams, RobotParams
from jumping_ant.params.model import Params
from jumping_ant.sim import robot

# Keeps the clusters of tests on the loopback address. Ray reads it when it is imported, as by
# EvoTorch.
os.environ["RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER"] = "0"

# Commits of tests, and DVC's experiments, have an author, also where git knows none.
os.environ |= {f"GIT_{who}_NAME": "Test" for who in ("AUTHOR", "COMMITTER")}
os.environ |= {f"GIT_{who}_EMAIL": "test@example.org" for who in ("AUTHOR", "COMMITTER")}

# Threads that wait for others of a matrix product spin for a while, which is fastest if each has a
# core of its own. Tests run beside each other: there a measurement of two threads takes ten times
# the CPU time. Torch reads the variable when it is imported.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

# As in processes that train (see `jumping_ant.agents.kernels`). MKL reads it when it first
# computes, which among many tests may be before one that trains.
os.environ["MKL_CBWR"] = "COMPATIBLE"

ROBOT = RobotParams(
    source="ant",
    density=2.5,
    gear=200.0,
    joint_gear={},
    torso_radius=0.25,
    leg_length=1.0,
    damping=1.0,
    friction=[1.0, 0.5, 0.5],
    contact_margin=0.01,
    edits={},
)
ENV = EnvParams(
    frame_skip=5,
    reset_noise_scale=0.1,
    drop_height=1.3,
    max_episode_steps=1000,
    min_torso_height=0.2,
    max_torso_height=None,
    max_tilt=None,
    commands=article.ENV.commands,
    reward=article.ENV.reward,
)
EVALUATE = EvaluateParams(episodes=10, baseline_episodes=10, seed=1000000)


# What `make test-all` runs alone, `-m "not long"` being the default: modules that start servers,
# clusters, browsers or whole pipelines, and the algorithms that share a trainer with another one.
LONG = {
    *("test_cluster.py", "test_fingerprint.py", "test_live.py", "test_pages.py"),
    *("test_postgres.py", "test_search.py"),
    *("test_portable.py", "test_report_in_browser.py", "test_soak.py"),
    *("test_stages_on_cluster.py", "test_stops.py", "test_surroundings.py", "test_ui.py"),
    *("test_verify.py", "test_wheel.py"),
}
RARE = ALGORITHMS.keys() - {"random", "open_loop", "dqn", "sac", "pgpe", "ppo", "decqn", "bc"}


@pytest.hookimpl(tryfirst=True)  # before pytest selects by marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        values = item.callspec.params.values() if hasattr(item, "callspec") else ()
        if item.path.name in LONG or RARE & {value for value in values if isinstance(value, str)}:
            item.add_marker("long")


@pytest.fixture(scope="session", autouse=True)
def comments_are_removed_once() -> Iterator[None]:
    """Cache code without its comments: each training digests all of its code anew.

    That takes longer than a small training itself.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(effective_code, "effective", cache(effective_code.effective))
        yield


@pytest.fixture(scope="session")
def known_params() -> Params:
    """`params.yaml` with the robot, the task and the evaluation above."""
    return params_file.load().model_copy(update={"robot": ROBOT, "env": ENV, "evaluate": EVALUATE})


@pytest.fixture(scope="session")
def robot_xml() -> str:
    """The robot above, as MJCF text."""
    return robot.build(ROBOT)


@pytest.fixture(scope="session")
def source_xml() -> str:
    """Gymnasium's own Ant, unedited."""
    return robot.source_path("ant").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    """A headless browser."""
    with browser.launched() as launched:
        yield launched


@pytest.fixture
def open_page(chromium: Browser) -> Iterator[browser.OpenPage]:
    """Opens addresses in windows of their own, which are closed at the end."""
    visits: list[browser.Visit] = []

    def open_page(address: str, **size: int) -> browser.Visit:
        visits.append(browser.open_page(chromium, address, **size))
        return visits[-1]

    yield open_page
    for visit in visits:
        visit.page.context.close()


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A clone in which everything was run and committed; `project` is what tests take."""
    return finished_project.finish(tmp_path_factory.mktemp("clone") / "project")


@pytest.fixture
def project(finished: Project) -> Iterator[Project]:
    """The same for a test, which leaves its parameters and outputs as they are."""
    before = finished.state()
    yield finished
    assert not finished.state().changes(before)
