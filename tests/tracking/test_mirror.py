"""MLflow mirrors the files: what runs, models and the comparison show."""

import hashlib
import json
import shutil
import sys
from pathlib import Path

import pytest
from ruamel.yaml import YAML
from tracked_project import AGENTS, AGGREGATES, parent_name, query, shown, statuses, tracked

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT, digest, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.params import params_file
from jumping_ant.tracking import descriptions, models, pages, records


def test_a_run_shows_the_files_of_its_seed(project: Path) -> None:
    comparison = next(name for name in statuses(project) if name.startswith("comparison"))
    seeds = ["sac-seed-0", "sac-seed-1", "pgpe-seed-0", "pgpe-seed-1"]
    assert statuses(project) == dict.fromkeys([comparison, *seeds, *AGGREGATES], "FINISHED")
    run = shown(project)["sac-seed-1"]
    returns = [(step, value) for name, step, value in run.metrics if name == "return_mean"]
    assert returns == [(200, 201.0), (300, 301.0), (400, 401.0)]
    assert {
        ("evaluation_return_mean", 300, 601.0),
        ("evaluation/return", 0, 115.0),
        ("train_seconds", 0, 40.0),
        ("validation_return", 0, 601.0),
        ("final_return", 0, 51.0),
    } <= set(run.metrics)
    assert len(run.metrics) == 4 * 3 + 3 + 1 + 3 + 3, "fluidity, which no seed has, is left out"
    settings = params_file.load(project / "params.yaml")
    assert run.params["learning_rate"] == str(settings.agent("sac").learning_rate)
    assert run.params["env.reward.torso_height.span"] == str(settings.env.reward.torso_height.span)
    assert run.params["robot"] == "edited" and run.params["robot.mass"] == "0.44"
    policy = Paths(project).agent("sac").seed(1).policy
    md5 = hashlib.md5(policy.read_bytes()).hexdigest()
    known = {"agent": "sac", "seed": "1", "algorithm": "sac", "dvc_stage": "train@sac"}
    assert run.tags.items() >= (known | {"policy_digest": digest(policy), "dvc_md5": md5}).items()
    assert (run.artifacts / "policy.zip").read_bytes() == policy.read_bytes()
    assert {"machines.json", "media/sac.mp4", "media/sac.rrd"} <= run.files
    assert "media/sac.mp4" not in shown(project)["sac-seed-0"].files, "which shows the other seed"
    assert parent_name(project, "sac-seed-1") == comparison


def test_files_may_be_links_into_a_cache(untracked_project: Path) -> None:
    """As with DVC's `cache.type symlink`."""
    cache = untracked_project.parent / "cache"
    cache.mkdir()
    outputs = [untracked_project / name for name in ("models", "media", "results")]
    files = [path for folder in outputs for path in folder.rglob("*") if path.is_file()]
    for number, path in enumerate(files):
        path.rename(cache / str(number))
        path.symlink_to(cache / str(number))
    tracked(untracked_project)
    stored = (untracked_project / "mlartifacts").rglob("artifacts/policy.zip")
    trained = (untracked_project / "models").rglob("policy.zip")
    assert {digest(path) for path in stored if not path.is_symlink()} == set(map(digest, trained))


def test_the_comparison_shows_its_headline_and_all_media(project: Path) -> None:
    (comparison,) = (run for name, run in shown(project).items() if name.startswith("comparison"))
    assert {
        ("sac/return_iqm", 0, 65.0),
        ("pgpe/env_steps", 0, 400.0),
        ("pgpe/train_seconds", 0, 40.0),
        ("pgpe/return_at_equal_seconds_iqm", 0, 60.0),
        ("probability_of_improvement/sac_over_pgpe", 0, 0.75),
    } <= set(comparison.metrics)
    assert comparison.files == {
        *("params.yaml", "robot.json", "comparison.json", "speed.json", "results/report.html"),
        "figures/curves.png",
        *(f"media/{agent}.{kind}" for agent in AGENTS for kind in ("mp4", "rrd")),
    }
    assert "**inconclusive** (adjusted p = 0.75): SAC leads" in comparison.tags[pages.NOTE]
    assert "**supported** (adjusted p = 0.01): PGPE is slow" in comparison.tags[pages.NOTE]
    for name in AGGREGATES:  # with the interquartile mean and its interval at each step
        assert parent_name(project, name).startswith("comparison")
        points = shown(project)[name].metrics
        ends = {"return_high": 5, "return_iqm": 0, "return_low": -5}
        curve = [
            (metric, step, step + more) for metric, more in ends.items() for step in (200, 400)
        ]
        assert [point for point in points if point[1]] == curve
        assert {("evaluation/return", 0, 65.0), ("evaluation/return_worst", 0, 15.0)} <= set(points)


def test_models_lead_back_to_the_policy_file(project: Path) -> None:
    policy = Paths(project).agent("sac").seed(1).policy
    sql = "SELECT description FROM model_versions WHERE name = 'jumping-ant-sac' AND version = 2"
    version = query(project, sql)[0][0]
    assert version.startswith(
        "sac, training seed 1: mean return 115 on the held-out episodes, 601 in validation, "
        "apex of its jumps 2.5 m, share of time in flight 0.25. "
        "Each output is held for 1 control step."
    )
    md5 = hashlib.md5(policy.read_bytes()).hexdigest()
    assert md5 in version and digest(policy) in version and "train@sac" in version
    metrics = query(
        project,
        "SELECT metric_name, metric_value FROM logged_model_metrics m JOIN logged_models l "
        "ON l.model_id = m.model_id WHERE l.name = 'sac-seed-1'",
    )
    measured = {"evaluation/return": 115.0, "evaluation/apex": 2.5, "evaluation/flight": 0.25}
    others = {"validation_return": 601.0, "final_return": 51.0, "train_seconds": 40.0}
    assert dict(metrics) == measured | others
    tags = query(project, "SELECT value FROM model_version_tags WHERE key = 'hold'")
    assert tags == [("1",)] * 4 and "tag `hold`" in models.ABOUT


def test_records_say_what_files_say(untracked_project: Path) -> None:
    """Validation of the published policy, no edits of an unedited robot, no infinite numbers."""
    paths = Paths(untracked_project).agent("sac").seed(0)
    params = params_file.load(untracked_project / "params.yaml")
    with paths.validation.open("a", encoding="utf-8") as file:
        file.write("sac,0,400,20,650,1.5\n")
    assert records.read(untracked_project, params).seeds[0].validation_return == 650.0
    paths.validation.unlink()  # trained before there were finalists
    assert records.read(untracked_project, params).seeds[0].validation_return is None
    facts = {"before": {"mass": 0.88}, "after": {"mass": 0.44}}
    write_text(Paths(untracked_project).physique, json.dumps(facts))
    block = params.agent("sac").model_copy(update={"robot": "unedited"})
    plain = params.model_copy(update={"agents": {"sac": block}})
    settings = records.run_params(untracked_project, plain, "sac")
    robot = {name: value for name, value in settings.items() if name.startswith("robot")}
    assert robot == {"robot": "unedited", "robot.source": "ant", "robot.mass": "0.88"}
    agents = {"sac": {"seeds": 2, "fluidity": {"iqm": float("nan"), "mean": -2.5}}}
    write_text(Paths(untracked_project).comparison, json.dumps({"agents": agents}))
    Paths(untracked_project).speed.unlink()
    summary = records.read(untracked_project, params).summary
    assert summary == {"sac/seeds": 2.0, "sac/fluidity_mean": -2.5}


def test_the_stage_depends_on_all_that_it_reads(project: Path) -> None:
    opened: set[Path] = set()
    noted = [opened]  # no hook can be removed

    def note(event: str, arguments: tuple[object, ...]) -> None:
        if event == "open" and isinstance(arguments[0], str | Path):
            for paths in noted:
                paths.add(Path(arguments[0]))

    sys.addaudithook(note)
    tracked(project)
    noted.clear()
    stage = YAML(typ="safe").load((PROJECT_ROOT / "dvc.yaml").read_text("utf-8"))["stages"]["track"]
    files = {path for path in opened if path.is_relative_to(project) and path.is_file()}
    read = {str(path.relative_to(project)) for path in files}
    assert "media/digests" in stage["deps"]  # of the films and recordings that it reads
    own = ("params.yaml", "mlflow.db", "mlartifacts/", "media/")
    undeclared = [name for name in read if not name.startswith((*own, *stage["deps"]))]
    assert undeclared == [] and "results/plots/learning_curves.csv" in read


def test_a_moved_project_or_a_damaged_database_is_told_in_one_line(project: Path) -> None:
    moved = project.with_name("moved")
    shutil.copytree(project, moved)
    with pytest.raises(InputError, match=r"was moved: delete mlflow\.db"):
        tracked(moved)
    (project / "mlflow.db").write_bytes(b"not a database" * 100)
    with pytest.raises(InputError, match="not a database") as caught:
        tracked(project)
    assert "\n" not in str(caught.value)


def test_a_damaged_curve_is_named(tmp_path: Path) -> None:
    path = Paths(tmp_path).agent("sac").seed(7).curve
    write_text(path, "agent,seed,env_steps,loss\nsac,7,100,much\n")
    with pytest.raises(InputError, match=r"curve\.csv: row 1, column loss: given 'much'"):
        records.read_curve(tmp_path, "sac", 7)
    write_text(path, "agent,seed,env_steps,loss,other\nsac,7,200,1.5,\nsac,7,200,,3\n")
    both = {("loss", 200): 1.5, ("other", 200): 3.0}  # a row of training, and one of an evaluation
    assert records.read_curve(tmp_path, "sac", 7) == both


@pytest.mark.parametrize(
    "place",
    [
        "results/agents/{}/trajectory.npz",
        "results/timing/{}/timing.csv",
        "results/agents/{}/seeds.csv",
        "models/{}/seed-0/curve.csv",
    ],
)
def test_files_of_another_agent_are_not_mirrored(untracked_project: Path, place: str) -> None:
    one, other = (untracked_project / place.format(agent) for agent in ("sac", "pgpe"))
    shutil.copy(other, one)
    with pytest.raises(InputError, match=r"given .*'pgpe', allowed: '?sac") as caught:
        tracked(untracked_project)
    assert str(one) in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("comparison", {"agents": []}),
        ("comparison", {"agents": {"sac": 1}}),
        ("comparison", {"agents": {"sac": {"seeds": "two"}}}),
        ("comparison", {"agents": {"sac": {"seeds": 2, "return": {"iqm": "x"}}}}),
        ("comparison", {"claims": [1]}),
        ("comparison", {"probability_of_improvement": {"sac>pgpe": None}}),
        ("robustness", {"agents": {"sac": {"friction": {"retention": []}}}}),
        ("speed", {"agents": {"sac": {"train_seconds": {}}}}),
        ("speed", {"claims": 1}),
        ("comparison", "["),
        ("comparison", "[" * 100_000),
        ("speed", "[]"),
    ],
)
def test_results_of_other_types_are_named_in_a_line(
    untracked_project: Path, name: str, content: object
) -> None:
    path = getattr(Paths(untracked_project), name)
    write_text(path, content if isinstance(content, str) else json.dumps(content))
    with pytest.raises(InputError, match=f"{name}.json.*; run `dvc repro --force") as caught:
        tracked(untracked_project)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 700


def test_a_comparison_is_a_table_the_best_first_and_its_claims() -> None:
    interval = {"iqm": 1234.5, "low": 0.001234, "high": 2345678.0, "mean": 1300.0, "worst": -4.0}
    fluidity = {"iqm": -2.0, "low": -3.0, "high": -1.0}
    few = {"seeds": 2, "return": {"iqm": 1.0, "low": 0.0, "high": 2.0}, "fluidity": fluidity}
    agents = {"a": few | {"train_seconds": 40}, "b": {"seeds": 2, "return": interval}}
    claim = {"text": "A leads", "verdict": "refuted", "p_adjusted": 0.01234}
    text = descriptions.comparison({"agents": agents | {"c": {"seeds": 2}}, "claims": [claim]})
    rows = [line.replace(descriptions.HARD_SPACE, " ") for line in text.splitlines()]
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]
    assert cells[0][:5] == ["agent", "return", "mean", "worst seed", "fluidity"]
    assert cells[2] == ["b", "1,234 [0.00123, 2,345,678]", "1,300", "-4", *"––"]
    assert cells[3] == ["a", "1 [0, 2]", "–", "–", "-2 [-3, -1]", "40"]
    assert cells[4] == ["c", *"–––––"]
    assert rows[-1] == "- **refuted** (adjusted p = 0.012): A leads"
    text = descriptions.comparison({"claims": [claim] * 1000})
    assert len(text) < 8000, "of which MLflow would cut the rest off"
    assert text.splitlines()[-2:] == ["", "(The rest is in `comparison.json` and `speed.json`.)"]
