"""What training takes in seconds: the numbers and claims of `results/speed.json`.

They are statements on a machine, and its claims are a family of their own: corrected with all
others, they would make every verdict depend on a clock. Agents train one after the other, each
beside other work, so claims rest on short pieces of all of them (`training.scaling`): the seconds
of a run are its control steps times the CPU seconds that one takes there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from jumping_ant.base import machine
from jumping_ant.comparison import claims, comparison
from jumping_ant.comparison.results import AgentResults, merged
from jumping_ant.params.claims import Claim
from jumping_ant.params.model import Params
from jumping_ant.training.scaling import Piece


def summarize(
    params: Params,
    asked: Sequence[Claim],
    results: Mapping[str, AgentResults],
    compared: Mapping[str, Any],
    pieces: Sequence[Piece],
) -> dict[str, Any]:
    """Return the agents' seconds, what they returned after equal ones, and the claims on them.

    Args:
        params: All parameters.
        asked: All claims.
        results: Of each agent, with the seconds of training by the clock in its curves.
        compared: The content of `results/comparison.json`, which has the returns.
        pieces: What pieces of training took.
    """
    timed = {
        name: _with_seconds(agent, [piece for piece in pieces if piece.agent == name])
        for name, agent in results.items()
    }
    equal, early = comparison.at_equal_budgets(timed, "seconds", params.compare.confidence)
    agents = {
        name: {
            "train_seconds": float(timed[name].budgets("seconds").mean()),
            "wall_seconds": float(agent.budgets("seconds").mean()),
        }
        | early.get(name, {})
        for name, agent in results.items()
    }
    together = merged(compared, {"agents": agents})["agents"]
    learned = claims.out_of_luck(results.values(), params.training.evaluation_episodes)
    return {
        "machine": machine.describe(),
        "agents": agents,
        "equal_seconds": equal,
        "pareto_seconds": comparison.front(results, together, "seconds"),
        **claims.judge(claims.on_seconds(asked), timed, params.compare, learned),
    }


def _with_seconds(agent: AgentResults, pieces: Sequence[Piece]) -> AgentResults:
    """Return an agent with what a clock tells: of each piece, and so at each row of its curves.

    Without pieces, curves keep the seconds of training.
    """
    if not pieces:
        return agent
    most = max(piece.threads for piece in pieces)
    alone = [piece for piece in pieces if piece.threads == 1]
    paces = np.array([piece.cpu_seconds / piece.env_steps for piece in alone])
    more = {"seconds_per_step": paces}
    if most > 1:
        together = np.array([piece.seconds for piece in pieces if piece.threads == most])
        more["speed_up"] = np.array([piece.seconds for piece in alone]) / together
    curves = {
        seed: curve | {"seconds": curve["env_steps"] * np.median(paces)}
        for seed, curve in agent.curves.items()
    }
    return replace(agent, quantities=agent.quantities | more, curves=curves)
