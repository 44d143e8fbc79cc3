"""The comparison as one page: `results/report.html`.

It opens from disk without a network (see `jumping_ant.report.frame`); the films and recordings are
those in `media/` beside it. Nothing on it depends on a clock.
"""

import hashlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

import plotly.graph_objects as go
from ruamel.yaml import YAML

from jumping_ant.base.files import read_bytes, read_json
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import charting, comparison
from jumping_ant.comparison.results import AgentResults, load
from jumping_ant.experiment.models import Params
from jumping_ant.looks import style
from jumping_ant.looks.families import by_family
from jumping_ant.looks.measures import MEASURES
from jumping_ant.looks.style import Look, estimate, number
from jumping_ant.report import (
    charts,
    contests,
    films,
    frame,
    outcomes,
    pictures,
    sections,
    standings,
    withstanding,
)
from jumping_ant.report.films import FilmedEpisode
from jumping_ant.sim import robot
from jumping_ant.sim.rewards import active

# The default address at which `make ui` serves what `jumping_ant.tracking` writes.
MLFLOW = "http://127.0.0.1:5000"
# In a database that the project created, its experiment is the first besides MLflow's own.
RUNS = f"{MLFLOW}/#/experiments/1/runs?workflowType=machine_learning"
MODEL, POLICY_DIGEST = "jumping-ant-", "policy_digest"


def build(root: Path, params: Params) -> str:
    """Return the page's HTML, from the project's assets, models, results and media."""
    summary = read_json(Paths(root).comparison, "compare")
    withstood = read_json(Paths(root).robustness, "compare")
    summary |= {"claims": [*summary["claims"], *withstood["claims"]]}
    loaded = load(root, params)
    drawn = style.looks(charting.families(loaded))
    results = sections.ordered(loaded, summary["agents"])
    reward_terms, of_terms = outcomes.terms(results, summary["agents"])
    filmed = {name: films.read(root, params, agent) for name, agent in results.items()}
    context = sections.context(params, results, summary["claims"]) | {
        "question": f"Who teaches the {_robot_name(params)} to {_aim(params)}?",
        "title": _title(params, results),
        "agents": _agents(root, results, filmed, drawn),
        "lead": _lead(results, summary),
        "returns": outcomes.returns(results, summary["agents"], params.compare.confidence),
        "behaviour": outcomes.behaviour(results, summary["agents"]),
        "behaviour_measures": [MEASURES[name] for name in charting.BEHAVIOUR],
        "reward_terms": reward_terms,
        "of_terms": of_terms,
        "equal_steps": _budget(summary["equal_steps"]),
        "all_measures": MEASURES,
        "matrix_width": contests.improvement_width(len(results)),
        "confidence": f"{100 * params.compare.confidence:g}",
        "episodes": params.evaluate.episodes,
        "baseline_episodes": params.evaluate.baseline_episodes,
        "robust_steps": params.robustness.episode_steps,
        "robot": _robot(root),
        "params": _params_text(params),
        "policies": _policies(root, params, results),
        "mlflow": MLFLOW,
    }
    charts = _charts(root, params, results, summary, filmed, drawn)
    if withstood["perturbations"] and withstood["agents"]:
        charts["withstood"] = withstanding.overview(results, withstood)
        charts["levels"] = withstanding.levels(results, withstood, drawn)
    return frame.render(Path(__file__).parent, context, charts, ("charts.js", "films.js"))


def _charts(
    root: Path,
    params: Params,
    results: Mapping[str, AgentResults],
    summary: Mapping[str, Any],
    filmed: Mapping[str, FilmedEpisode],
    drawn: Mapping[str, Look],
) -> dict[str, go.Figure]:
    """Return each chart by its place in the template."""
    model = robot.load(robot.read(root))
    motors = [model.actuator(index).name for index in range(model.nu)]
    figures = {
        "ranking": standings.ranking(results, summary["agents"], drawn),
        "episodes": charts.episodes(results, drawn),
        "heights": films.heights(results, filmed, drawn, _leaders(results)),
    }
    figures |= {f"torques_{name}": films.torques(film, motors) for name, film in filmed.items()}
    if len(results) > 1:
        figures["improvement"] = contests.improvement(results, summary)
    return figures | sections.figures(params, results, summary, drawn, "env_steps")


def _leaders(results: Mapping[str, AgentResults]) -> list[str]:
    """Return all agents, or of many learners the best of each family, which comes first."""
    families = charting.families(results)
    grouped = by_family(families)
    return [own[0] for own in grouped.values()] if style.is_crowded(families) else list(families)


def _agents(
    root: Path,
    results: Mapping[str, AgentResults],
    filmed: Mapping[str, FilmedEpisode],
    drawn: Mapping[str, Look],
) -> list[dict[str, Any]]:
    """Return what is shown with each agent's film."""
    shown = []
    for name, agent in results.items():
        film = filmed[name]
        highest = film.heights.argmax()
        shown.append(
            {
                "name": name,
                "label": agent.label,
                "family": agent.family,
                "remark": style.remark(agent.is_baseline, agent.block.robot),
                "colour": drawn[name].colour,
                "seed": film.seed,
                "episode": film.episode,
                "episode_return": number(film.episode_return),
                "poster": pictures.still(Paths(root).agent(name).film, film.times[highest]),
                "highest": f"{film.heights[highest]:.1f}",
                "model": f"{MODEL}{name}",
                "model_url": f"{MLFLOW}/#/models/{MODEL}{name}",
            }
        )
    return shown


def _robot_name(params: Params) -> str:
    """Return the robot's display name: Ant, Half cheetah, or the name of its file."""
    return Path(params.robot.source).stem.replace("_", " ").capitalize()


def _aim(params: Params) -> str:
    """Return the main aim of the reward, in one word."""
    words = {"torso_height": "jump", "forward_velocity": "run"}
    return next((words[name] for name in active(params.env.reward) if name in words), "move")


def _title(params: Params, results: Mapping[str, AgentResults]) -> str:
    """Return the page's title: it names the learners, or all agents if none learns, or counts."""
    families = {name: results[name].family for name in charting.learners(results)}
    if style.is_crowded(families):
        groups = by_family(families)
        return (
            f"{_robot_name(params)}: {len(families)} learners of {len(groups)} families compared"
            if len(groups) > 1
            else f"{_robot_name(params)}: {len(families)} learners compared"
        )
    *others, last = [results[name].label for name in families or results]
    names = f"{', '.join(others)} and {last} compared" if others else last
    return f"{_robot_name(params)}: {names}"


def _budget(value: float | None) -> str:
    """Return the smallest budget among the learners, as text; empty if there are none."""
    return "" if value is None else number(value)


def _lead(results: Mapping[str, AgentResults], summary: Mapping[str, Any]) -> str:
    """Return the outcome in a sentence or two."""
    agents = summary["agents"]
    best, *others = comparison.ranking(agents)
    top, num_seeds = agents[best]["return"], agents[best]["seeds"]
    most = estimate(top["iqm"], top["low"], top["high"], num_seeds)
    if not others:
        return f"{results[best].label} returns {most}."
    aside = ", which learns nothing," if results[best].is_baseline else ""
    pair = summary["probability_of_improvement"][f"{best}>{others[0]}"]
    chance = estimate(pair["p"], pair["low"], pair["high"], num_seeds)
    return (
        f"{results[best].label}{aside} returns most: {most}. One of its seeds beats one of "
        f"{results[others[0]].label}, which comes second, with probability {chance}."
    )


def _robot(root: Path) -> dict[str, Any]:
    """Return the robot before and after its edits: numbers and pictures."""
    facts = read_json(Paths(root).physique, "build")
    before, after = facts["before"], facts["after"]

    def torque(physique: Mapping[str, Any]) -> str:
        return " / ".join(sorted({number(value) for value in physique["peak_torque"].values()}))

    return {
        "rows": [
            ("Mass [kg]", number(before["mass"]), number(after["mass"])),
            ("Peak torque of a motor [N m]", torque(before), torque(after)),
            (
                "Summed peak torque over weight [m]",
                number(before["peak_torque_over_weight"]),
                number(after["peak_torque_over_weight"]),
            ),
        ],
        "source": facts["source"],
        "versions": facts["versions"],
        "pictures": [
            ("Before its edits", pictures.portrait(robot.read(root, "unedited"))),
            ("With its edits", pictures.portrait(robot.read(root))),
        ],
    }


def _policies(
    root: Path, params: Params, results: Mapping[str, AgentResults]
) -> list[dict[str, str]]:
    """Return every policy with its digest, return and links."""
    rows = []
    for name, agent in results.items():
        for seed, value in zip(params.seeds, agent.quantities["return"], strict=True):
            path = Paths(root).agent(name).seed(seed).policy
            sha256 = hashlib.sha256(read_bytes(path, f"train@{name}")).hexdigest()
            query = quote(f"tags.{POLICY_DIGEST} = '{sha256}'")
            rows.append(
                {
                    "agent": agent.label,
                    "seed": str(seed),
                    "return": number(value),
                    "path": str(path.relative_to(root)),
                    "sha256": sha256,
                    "run_url": f"{RUNS}&searchFilter={query}",
                }
            )
    return rows


def _params_text(params: Params) -> str:
    """Return the parameters that results depend on, as YAML."""
    text = io.StringIO()
    YAML().dump(params.model_dump(exclude={"compute", "tuning"}), text)
    return text.getvalue()
