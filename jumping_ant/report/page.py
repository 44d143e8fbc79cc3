"""The comparison as one page: `results/report.html`.

It opens from disk without a network: charts, their library, styles and pictures are embedded in the
file, and the films and recordings are those in `media/` beside it.
"""

import base64
import hashlib
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

import jinja2
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs
from ruamel.yaml import YAML

from jumping_ant.base.files import read_bytes, read_json
from jumping_ant.base.paths import Paths
from jumping_ant.comparison import charting, comparison
from jumping_ant.comparison.results import AgentResults, load
from jumping_ant.experiment.models import Params
from jumping_ant.looks import looks, naming, panels
from jumping_ant.looks.looks import Look
from jumping_ant.looks.measures import MEASURES
from jumping_ant.looks.naming import Family, by_family
from jumping_ant.looks.wording import estimate, number
from jumping_ant.report import charts, contests, films, outcomes, pictures, standings, statements
from jumping_ant.report.films import FilmedEpisode
from jumping_ant.sim import robot
from jumping_ant.sim.rewards import active

FOLDER = Path(__file__).parent
# The default address at which `make ui` serves what `jumping_ant.tracking` writes.
MLFLOW = "http://127.0.0.1:5000"
# In a database that the project created, its experiment is the first besides MLflow's own.
RUNS = f"{MLFLOW}/#/experiments/1/runs?workflowType=machine_learning"
MODEL, POLICY_DIGEST = "jumping-ant-", "policy_digest"


def build(root: Path, params: Params) -> str:
    """Return the page's HTML, from the project's assets, models, results and media."""
    summary = read_json(Paths(root).comparison, "compare")
    loaded = load(root, params)
    families = charting.families(loaded)
    drawn = looks.looks(families)
    results = {name: loaded[name] for name in _order(families, summary["agents"])}
    reward_terms, of_terms = outcomes.terms(results, summary["agents"])
    filmed = {name: films.read(root, params, agent) for name, agent in results.items()}
    plotly, script = get_plotlyjs(), (FOLDER / "script.js").read_text(encoding="utf-8")
    context = {
        "security_policy": _security_policy(plotly, script),
        "question": f"Who teaches the {_robot_name(params)} to {_aim(params)}?",
        "title": _title(params, results),
        "families": list(by_family(families)) if panels.is_crowded(families) else [""],
        "panels": list(panels.panels(families)),
        "agents": _agents(root, results, filmed, drawn),
        "lead": _lead(results, summary),
        "returns": outcomes.returns(results, summary["agents"], params.compare.confidence),
        "behaviour": outcomes.behaviour(results, summary["agents"]),
        "behaviour_measures": [MEASURES[name] for name in charting.BEHAVIOUR],
        "reward_terms": reward_terms,
        "of_terms": of_terms,
        "equal_steps": _budget(summary["equal_steps"]),
        "equal_seconds": _budget(summary["equal_seconds"]),
        "all_measures": MEASURES,
        "statements": statements.read(summary["claims"], len(params.seeds)),
        "verdicts": statements.count(summary["claims"]),
        "signs": statements.SIGNS,
        "matrix_width": contests.improvement_width(len(results)),
        "charts": _charts(root, params, results, summary, filmed, drawn),
        "confidence": f"{100 * params.compare.confidence:g}",
        "level": f"{1 - params.compare.confidence:.2g}",
        "seeds": len(params.seeds),
        "episodes": params.evaluate.episodes,
        "robot": _robot(root),
        "params": _params_text(params),
        "policies": _policies(root, params, results),
        "machines": _machines(root, params, results),
        "mlflow": MLFLOW,
        "plotly": plotly,
        "style": (FOLDER / "style.css").read_text(encoding="utf-8"),
        "script": script,
    }
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("template.html").render(context)


def _security_policy(*scripts: str) -> str:
    """Return what browsers may do with the page: run these scripts, and ask nobody for anything."""
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()) for script in scripts]
    allowed = " ".join(f"'sha256-{digest.decode()}'" for digest in digests)
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; "
        "img-src data: blob:; media-src 'self' file:; base-uri 'none'; form-action 'none'"
    )


def _order(families: Mapping[str, Family], agents: Mapping[str, Any]) -> list[str]:
    """Return the agents' names by family, in each of them the best first."""
    ranked = {name: families[name] for name in comparison.ranking(agents)}
    return [name for members in by_family(ranked).values() for name in members]


def _charts(
    root: Path,
    params: Params,
    results: Mapping[str, AgentResults],
    summary: Mapping[str, Any],
    filmed: Mapping[str, FilmedEpisode],
    drawn: Mapping[str, Look],
) -> dict[str, Any]:
    """Return each chart's JSON by its place in the template, which skips missing charts."""
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
    if charting.learners(results):
        figures |= _learning(params, results, summary, drawn)
        for against in charting.COSTS:
            figures[f"cost_{against}"] = standings.cost(results, summary, against, drawn)
    by_label = {agent.label: drawn[name] for name, agent in results.items()}
    for index, entry in enumerate(summary["claims"]):
        figures[f"claim_{index}"] = contests.claim(entry, by_label, params.seeds)
    return {name: json.loads(figure.to_json()) for name, figure in figures.items()}


def _learning(
    params: Params,
    results: Mapping[str, AgentResults],
    summary: Mapping[str, Any],
    drawn: Mapping[str, Look],
) -> dict[str, go.Figure]:
    """Return the charts of learning curves: a pair of them, or of many learners one a family."""
    curves = comparison.learning_curves(results, params.compare)
    grouped = panels.panels(charting.families(results))
    named = comparison.best_baseline(results, summary["agents"]) if len(grouped) > 1 else None
    return {
        f"learning_{against}_{number}": charts.learning(
            {name: results[name] for name in names}, curves, against, drawn, named
        )
        for number, names in enumerate(grouped.values())
        for against in charting.TIMES
    }


def _leaders(results: Mapping[str, AgentResults]) -> list[str]:
    """Return all agents, or of many learners the best of each family, which comes first."""
    families = charting.families(results)
    grouped = by_family(families)
    return [own[0] for own in grouped.values()] if panels.is_crowded(families) else list(families)


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
                "remark": naming.remark(agent.is_baseline, agent.block.robot),
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
    if panels.is_crowded(families):
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


def _machines(
    root: Path, params: Params, results: Mapping[str, AgentResults]
) -> list[dict[str, str]]:
    """Return the machines, with their versions, that policies were trained on."""
    found = {}
    for name in results:
        for seed in params.seeds:
            path = Paths(root).agent(name).seed(seed).machine
            machine = read_json(path, f"train@{name}")
            flat = {key: str(value) for key, value in machine.items() if key != "versions"}
            flat |= machine["versions"]
            found[json.dumps(flat)] = flat
    return list(found.values())


def _params_text(params: Params) -> str:
    """Return the parameters that results depend on, as YAML."""
    text = io.StringIO()
    YAML().dump(params.model_dump(exclude={"compute"}), text)
    return text.getvalue()
