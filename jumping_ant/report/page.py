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

from ruamel.yaml import YAML

from jumping_ant.agents.families import by_family
from jumping_ant.base.files import read_bytes, read_json
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import comparison
from jumping_ant.comparison.results import AgentResults, load
from jumping_ant.evaluation.measures import MEASURES
from jumping_ant.media import style
from jumping_ant.media.style import Look, estimate, number
from jumping_ant.params.model import Params
from jumping_ant.report import (
    charting,
    charts,
    films,
    frame,
    head_to_head,
    leaderboard,
    result_tables,
    robustness_charts,
)
from jumping_ant.report.films import Film
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
    agents, equal_steps = summary["agents"], summary["equal_steps"]
    loaded = load(root, params)
    drawn = style.looks(charting.families(loaded))
    results = frame.ordered(loaded, agents)
    reward_terms, of_terms = result_tables.terms(results, agents)
    filmed = {name: films.read(root, params, agent) for name, agent in results.items()}
    context = frame.context(params, results, summary["claims"]) | {
        "question": f"Who teaches the {_robot_name(params)} to {_aim(params)}?",
        "title": f"{_robot_name(params)}: {_title(results)}",
        "agents": _agents(root, results, filmed, drawn),
        "lead": _lead(results, summary),
        "returns": result_tables.returns(results, agents, params.compare.confidence),
        "behaviour": result_tables.behaviour(results, agents),
        "behaviour_measures": [MEASURES[name] for name in result_tables.BEHAVIOUR],
        "reward_terms": reward_terms,
        "of_terms": of_terms,
        "equal_steps": "" if equal_steps is None else number(equal_steps),
        "all_measures": MEASURES,
        "matrix_width": head_to_head.improvement_width(len(results)),
        "confidence": f"{100 * params.compare.confidence:g}",
        "settings": params,
        "robot": _robot(root),
        "params": _params_text(params),
        "policies": _policies(root, params, results),
        "mlflow": MLFLOW,
    }
    figures = {
        "ranking": leaderboard.ranking(results, agents, drawn),
        "episodes": charts.episodes(results, drawn),
        **films.figures(root, results, filmed, drawn),
        **frame.figures(params, results, summary, drawn),
    }
    if len(results) > 1:
        figures["improvement"] = head_to_head.improvement(results, summary)
    if withstood["perturbations"] and withstood["agents"]:
        figures["withstood"] = robustness_charts.overview(results, withstood)
        figures["levels"] = robustness_charts.levels(results, withstood, drawn)
    return frame.render(Path(__file__).parent, context, figures, ("charts.js", "films.js"))


def _agents(
    root: Path,
    results: Mapping[str, AgentResults],
    filmed: Mapping[str, Film],
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
                "episode": film.episode,
                "episode_return": number(film.episode.episode_return),
                "poster": films.still(Paths(root).agent(name).film, film.times[highest]),
                "highest": f"{film.heights[highest]:.1f}",
                "model": f"{MODEL}{name}",
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


def _title(results: Mapping[str, AgentResults]) -> str:
    """Return the learners that are compared, or all agents if none learns; many are counted."""
    families = {name: results[name].family for name in charting.learners(results)}
    if style.is_crowded(families):
        num_families = len(by_family(families))
        of_families = f" of {num_families} families" if num_families > 1 else ""
        return f"{len(families)} learners{of_families} compared"
    *others, last = [results[name].label for name in families or results]
    return f"{', '.join(others)} and {last} compared" if others else last


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
    quantities = {
        "Mass [kg]": "mass",
        "Peak torque of a motor [N m]": "peak_torque",  # one for each motor
        "Summed peak torque over weight [m]": "peak_torque_over_weight",
    }

    def text(value: float | Mapping[str, float]) -> str:
        values = value.values() if isinstance(value, Mapping) else [value]
        return " / ".join(sorted({number(one) for one in values}))

    rows = {
        label: [text(facts[when][key]) for when in ("before", "after")]
        for label, key in quantities.items()
    }
    pictures = {
        "Before its edits": films.portrait(robot.read(root, "unedited")),
        "With its edits": films.portrait(robot.read(root)),
    }
    return facts | {"rows": rows, "pictures": pictures}


def _policies(
    root: Path, params: Params, results: Mapping[str, AgentResults]
) -> list[dict[str, Any]]:
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
                    "seed": seed,
                    "return": number(value),
                    "path": path.relative_to(root),
                    "sha256": sha256,
                    "run_url": f"{RUNS}&searchFilter={query}",
                }
            )
    return rows


def _params_text(params: Params) -> str:
    """Return the parameters that results depend on, as YAML."""
    text = io.StringIO()
    YAML().dump(params.model_dump(exclude={"compute"}), text)
    return text.getvalue()
