"""What all agents withstand: the content of `results/robustness.json`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jumping_ant.comparison.claims import verdicts
from jumping_ant.comparison.claims.field import Field
from jumping_ant.comparison.results import AgentResults
from jumping_ant.experiment.models import Params
from jumping_ant.robustness import claims, retention, table


def summarize(root: Path, params: Params, results: Mapping[str, AgentResults]) -> dict[str, Any]:
    """Return what each agent keeps under each perturbation, and the claims on it.

    Args:
        root: The project's folder, with the tables of perturbed episodes.
        params: All parameters.
        results: Of each agent in undisturbed episodes.
    """
    played = {name: table.read(root, params, name) for name in results}
    field = Field(list(results.values()), params.training.evaluation_episodes)
    agents = {}
    for name, agent in results.items():
        if not played[name]:
            continue
        metronome = None if agent.is_baseline else field.metronome(agent)
        beside = played[metronome.name] if metronome else None
        agents[name] = retention.withstood(played[name], beside, params.compare.confidence)
    levels = params.robustness.perturbations.model_dump()
    return {
        "perturbations": [name for name in levels if levels[name]],
        "agents": agents,
        "claims": verdicts.check(
            results,
            params.compare,
            params.training.evaluation_episodes,
            claims.table(params, played),
        ),
    }
