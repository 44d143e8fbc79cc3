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

from jumping_ant.agents.families import by_family
from jumping_ant.base.files import read_bytes, read_json
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import claims, comparison
from jumping_ant.comparison.results import load
from jumping_ant.evaluation.measures import MEASURES
from jumping_ant.media import style
from jumping_ant.media.style import estimate, number
from jumping_ant.params.model import Params
from jumping_ant.report import (
    charts,
    films,
    frame,
    head_to_head,
    leaderboard,
    result_tables,
    robustness_charts,
)
from jumping_ant.report.films import Film
from jumping_ant.report.outcome import Outcome
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
    results = load(root, params)
    ranked = {name: results[name].family for name in comparison.ranking(summary["agents"])}
    ordered = [name for members in by_family(ranked).values() for name in members]
    outcome = Outcome(params, {name: results[name] for name in ordered}, summary)
    filmed = {name: films.read(root, params, agent) for name, agent in outcome.results.items()}
    context = {
        **_context(outcome),
        "agents": _agents(root, outcome, filmed),
        "robot": _robot(root),
        "policies": _policies(root, outcome),
    }
    figures = _figures(outcome) | films.figures(root, outcome, filmed)
    if withstood["perturbations"] and withstood["agents"]:
        figures["withstood"] = robustness_charts.overview(outcome, withstood)
        figures["levels"] = robustness_charts.levels(outcome, withstood)
    return frame.render(context, figures)


def _context(outcome: Outcome) -> dict[str, Any]:
    """Return what the templates show besides charts and files."""
    params, families, judged = outcome.params, outcome.families, outcome.summary["claims"]
    equal_steps, text = outcome.summary["equal_steps"], io.StringIO()
    YAML().dump(params.model_dump(exclude={"compute"}), text)  # results depend on all others
    reward_terms, of_terms = result_tables.terms(outcome)
    return {
        "question": f"Who teaches the {_robot_name(params)} to {_aim(params)}?",
        "title": f"{_robot_name(params)}: {_title(outcome)}",
        "lead": _lead(outcome),
        "families": list(by_family(families)) if outcome.is_crowded else [""],
        "panels": list(style.panels(families)),
        "imitates": "imitation" in families.values(),
        "returns": result_tables.returns(outcome),
        "behaviour": result_tables.behaviour(outcome),
        "behaviour_measures": [MEASURES[name] for name in result_tables.BEHAVIOUR],
        "reward_terms": reward_terms,
        "of_terms": of_terms,
        "equal_steps": "" if equal_steps is None else number(equal_steps),
        "all_measures": MEASURES,
        "matrix_width": head_to_head.improvement_width(len(outcome.results)),
        "confidence": f"{100 * params.compare.confidence:g}",
        "statements": head_to_head.statements(judged),
        "verdicts": head_to_head.count(judged),
        "not_asked": outcome.summary["not_asked"],
        "signs": head_to_head.SIGNS,
        "level": f"{claims.LEVEL:.2g}",
        "seeds": len(params.seeds),
        "settings": params,
        "params": text.getvalue(),
        "mlflow": MLFLOW,
    }


def _figures(outcome: Outcome) -> dict[str, go.Figure]:
    by_place = {
        "ranking": leaderboard.ranking(outcome),
        "episodes": charts.episodes(outcome),
    }
    if outcome.learners:
        for place, names in enumerate(style.panels(outcome.families).values()):
            by_place[f"learning_{place}"] = charts.learning(outcome, names)
        by_place["cost"] = leaderboard.cost(outcome)
    for index, entry in enumerate(outcome.summary["claims"]):
        by_place[f"claim_{index}"] = head_to_head.claim(outcome, entry["plot"])
    if len(outcome.results) > 1:
        by_place["improvement"] = head_to_head.improvement(outcome)
    return by_place


def _agents(root: Path, outcome: Outcome, filmed: Mapping[str, Film]) -> list[dict[str, Any]]:
    shown = []
    for name, agent in outcome.results.items():
        film = filmed[name]
        highest = film.heights.argmax()
        shown.append(
            {
                "name": name,
                "label": agent.label,
                "family": agent.family,
                "remark": style.remark(agent.is_baseline, agent.block.robot),
                "colour": outcome.looks[name].colour,
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
    words = {"torso_height": "jump", "forward_velocity": "run"}
    return next((words[name] for name in active(params.env.reward) if name in words), "move")


def _title(outcome: Outcome) -> str:
    """Return the learners that are compared, or all agents if none learns; many are counted."""
    names = outcome.learners or list(outcome.results)
    if outcome.is_crowded:
        num_families = len({outcome.families[name] for name in names})
        of_families = f" of {num_families} families" if num_families > 1 else ""
        return f"{len(names)} learners{of_families} compared"
    *others, last = [outcome.results[name].label for name in names]
    return f"{', '.join(others)} and {last} compared" if others else last


def _lead(outcome: Outcome) -> str:
    """Return the outcome in a sentence or two."""
    best, *others = outcome.ranked
    results, top = outcome.results, outcome.agents[best]["return"]
    num_seeds = outcome.agents[best]["seeds"]
    most = estimate(top["iqm"], top["low"], top["high"], num_seeds)
    if not others:
        return f"{results[best].label} returns {most}."
    aside = ", which learns nothing," if results[best].is_baseline else ""
    pair = outcome.summary["probability_of_improvement"][f"{best}>{others[0]}"]
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
    rows = {
        label: [_distinct(facts[when][key]) for when in ("before", "after")]
        for label, key in quantities.items()
    }
    pictures = {
        "Before its edits": films.portrait(robot.read(root, "unedited")),
        "With its edits": films.portrait(robot.read(root)),
    }
    return facts | {"rows": rows, "pictures": pictures}


def _distinct(value: float | Mapping[str, float]) -> str:
    values = value.values() if isinstance(value, Mapping) else [value]
    return " / ".join(sorted({number(one) for one in values}))


def _policies(root: Path, outcome: Outcome) -> list[dict[str, Any]]:
    rows = []
    for name, agent in outcome.results.items():
        for seed, value in zip(outcome.params.seeds, agent.quantities["return"], strict=True):
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
