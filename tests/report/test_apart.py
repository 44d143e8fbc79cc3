"""Seconds and the machine change no output of `compare` and `report`."""

import shutil
from functools import partial
from pathlib import Path
from types import ModuleType

import pytest
from small_project import MACHINE, read_csv, write_csv

from jumping_ant.base.files import write_json
from jumping_ant.base.paths import Paths
from jumping_ant.experiment.models import Params
from stages import compare, report, speed

Files = dict[str, bytes]


def outputs(root: Path, stages: list[ModuleType], params: Params) -> Files:
    """Run stages in a project, and return what its folder `results` then holds, but for timing."""
    results = root / "results"
    for stage in stages:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(stage, "PROJECT_ROOT", root)
            patch.setattr(stage, "Paths", partial(Paths, root))
            patch.setattr(stage, "parse", lambda _: params)
            stage.main()
    files = [path for path in results.rglob("*") if path.is_file()]
    names = {path.relative_to(results).as_posix(): path for path in files}
    return {name: path.read_bytes() for name, path in names.items() if "timing/" not in name}


def run_elsewhere(root: Path, params: Params) -> None:
    """Replace every second, and the machines, by those of a faster one."""
    for name in params.agents:
        paths = Paths(root).agent(name)
        for path in (paths.timing, paths.scaling):
            rows = read_csv(path)
            faster = [row | {"seconds": float(row["seconds"]) / 7} for row in rows]
            if rows:
                write_csv(path, faster)
        write_json(paths.machines, {str(s): MACHINE | {"cpu": "faster"} for s in params.seeds})


def test_equal_results_have_equal_outputs_whatever_the_clock_says(
    project: Path, settings: Params, tmp_path: Path
) -> None:
    shutil.copytree(project, tmp_path, dirs_exist_ok=True)
    stages = [compare, speed, report]
    here = outputs(tmp_path, stages, settings)
    run_elsewhere(tmp_path, settings)
    elsewhere = outputs(tmp_path, stages, settings)
    apart = {name for name in here if name.startswith("speed")}
    assert {"speed.json", "speed.html", "speed/efficiency.svg"} <= apart
    assert all(here[name] != elsewhere[name] for name in apart)
    others = here.keys() - apart
    assert {"comparison.json", "report.html", "figures/claims.png", "plots/seeds.csv"} <= others
    assert {name: here[name] for name in others} == {name: elsewhere[name] for name in others}
