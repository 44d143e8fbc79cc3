"""Check the live page against the native simulator, into results/play.json.

Usage: python -m scripts.parity [--starts N]

Of each agent's champion: the largest error over some simulation steps, of one control step from
recorded states, the simulation steps until trajectories have diverged, and the largest error of the
policy's torques, the worst of Chromium and node. Of all seeds: whether the returns
of held-out episodes are equivalent, by the comparison's own test and margin (docs/live-page.md).
"""

import json
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from playwright.sync_api import Page, sync_playwright

from jumping_ant.base import command_line, machine, output
from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import CODE_ROOT, PROJECT_ROOT, write_json
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import step_down
from jumping_ant.comparison.claims import findings, verdicts
from jumping_ant.comparison.claims.findings import Finding, Sample
from jumping_ant.experiment import episodes, params_file
from jumping_ant.experiment.models import Params
from jumping_ant.play import content, page, reference, vendor
from jumping_ant.policies import policy_file
from jumping_ant.sim import robot
from jumping_ant.sim.world import World

PATH = PROJECT_ROOT / "results" / "play.json"
REFERENCE_STARTS = 4  # of the champion, for errors
RACE = 3.0  # [s] of simulating two robots as fast as it goes
Job = dict[str, Any]
Array = NDArray[np.float64]


@contextmanager
def chromium(address: str) -> Iterator[Page]:
    """Open a live page in Chromium, without a screen."""
    path = shutil.which("chromium")
    if path is None:
        raise InputError("no chromium here; run `scripts/environment.sh browser`")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        try:
            opened = browser.new_page()
            opened.goto(address)
            opened.wait_for_function("window.page?.hasMoved")
            yield opened
        finally:
            browser.close()


def ask(opened: Page, kind: str, job: Job) -> Any:
    """Return what the physics of a live page answers."""
    return opened.evaluate("([kind, job]) => page.physics.ask(kind, job)", [kind, job])


def in_node(page_content: dict[str, Any], tasks: Sequence[Job]) -> list[Any]:
    """Return what the page's modules answer in node (`scripts/parity.mjs`)."""
    libraries = vendor.files()
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "mujoco.mjs").write_bytes(libraries["mujoco.js"])
        (Path(folder) / "mujoco.wasm").write_bytes(libraries["mujoco.wasm"])
        command = ["node", str(CODE_ROOT / "scripts" / "parity.mjs"), folder]
        request = json.dumps({"content": page_content, "tasks": tasks})
        done = subprocess.run(command, input=request, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr)
    answers: list[Any] = json.loads(done.stdout)
    return answers


def errors(root: Path, params: Params, opened: Page) -> dict[str, dict[str, Any]]:
    """Return the errors of each agent's champion."""
    champions = {name: content.champions(root, name, params.seeds)[0] for name in params.agents}
    jobs = []
    for name, seed in champions.items():
        kind = params.agent(name).robot
        world = World(robot.read(root, kind), params.env)
        policy = policy_file.load(Paths(root).agent(name).seed(seed).policy, (name, seed))
        starts = params.evaluate.block(seed)[:REFERENCE_STARTS]
        told = reference.record(world, policy, kind, starts)
        jobs.append({"policy": content.policy(root, name, seed), "reference": told})
    found = [
        [ask(opened, "verify", job) for job in jobs],
        in_node(opened.evaluate("page.content"), jobs),
    ]
    return {
        name: reference.errors([answers[number] for answers in found])
        for number, name in enumerate(champions)
    }


def returns(
    root: Path, params: Params, known: dict[str, Any], num_starts: int | None
) -> dict[str, tuple[Array, Array]]:
    """Return each seed's mean return in WebAssembly and in the native simulator, by agent.

    Args:
        root: The project's folder.
        params: All parameters.
        known: The page's content.
        num_starts: How many held-out episodes of each seed are played; None: all.
    """
    found = {}
    cores = machine.num_cores()
    for name in params.agents:
        kind = params.agent(name).robot
        world = World(robot.read(root, kind), params.env)
        table = episodes.read(root, params, name)
        native = table["return"].reshape(len(params.seeds), -1)[:, :num_starts]
        jobs = []
        for seed in params.seeds:
            block = params.evaluate.block(seed)[: native.shape[1]]
            starts = [content.start(world, own) for own in block]
            policy = content.policy(root, name, seed)
            jobs.append({"robot": kind, "policy": policy, "starts": starts})
        with ThreadPoolExecutor(cores) as pool:
            parts = list(pool.map(partial(in_node, known), (jobs[i::cores] for i in range(cores))))
        own = np.empty(native.shape)
        for number, part in enumerate(parts):
            own[number::cores] = part
        found[name] = own.mean(axis=1), native.mean(axis=1)
        print(f"{name}: {own.mean():,.1f} here, {native.mean():,.1f} in the native simulator")
    return found


def judge(params: Params, found: Mapping[str, tuple[Array, Array]]) -> dict[str, str]:
    """Return the verdict on each agent's returns: those of the same starts are paired."""
    margin = params.compare.margins.returns
    compared: dict[str, Finding] = {
        name: findings.paired(
            "Return",
            Sample("WebAssembly", own),
            Sample("native", native),
            params.compare,
            (-margin, margin),
        )
        for name, (own, native) in found.items()
    }
    adjusted = step_down.adjust(
        [(own.p, own.margin.p if own.margin else None) for own in compared.values()]
    )
    level = params.compare.levels[0] + verdicts.ROUNDING
    for name, own in compared.items():
        print(f"{name}: {own.evidence}", flush=True)
    return {
        name: verdicts.verdict(own.side, tested, level)
        for (name, own), tested in zip(compared.items(), adjusted, strict=True)
    }


def check(root: Path, params: Params, num_starts: int | None = None) -> dict[str, Any]:
    """Return the content of `results/play.json`."""
    file, last = page.path(root), list(params.agents)[-1]
    with chromium(file.as_uri()) as opened:
        seconds = opened.evaluate("page.hasMoved") / 1000
        for slot in ("a", "b"):
            opened.select_option(f"#agent-{slot}", last)
        opened.wait_for_function("page.frames.every((own) => own)")
        opened.evaluate("page.run(false)")
        speed = ask(opened, "race", {"seconds": RACE})
        found = errors(root, params, opened)
        known = opened.evaluate("page.content")
    told = judge(params, returns(root, params, known, num_starts))
    return {
        "agents": {name: own | {"returns": told[name]} for name, own in found.items()},
        "size_mb": round(file.stat().st_size / 1e6, 1),
        "seconds_until_moving": round(seconds, 2),
        "times_real_time": round(speed, 1),
    }


def main() -> None:
    """Parse the command line, check and write."""
    parser = command_line.parser(__doc__)
    parser.add_argument("--starts", type=int, help="of each seed, for returns; default: all")
    options = parser.parse_args()
    began = time.time()
    found = check(PROJECT_ROOT, params_file.load(), options.starts)
    write_json(PATH, found)
    print(f"results/play.json, {time.time() - began:.0f} s")
    print(json.dumps(found, indent=2))


if __name__ == "__main__":
    output.tolerate_failures()
    with reported():
        main()
