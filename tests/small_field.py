"""Agents of a run with results that tests choose, and claims about them."""

from dataclasses import replace

import numpy as np
import small_agents
from small_project import COMPARE

from jumping_ant.comparison import claims
from jumping_ant.comparison.results import AgentResults
from jumping_ant.params.claims import Claim

LOW, MIDDLE, HIGH = (np.linspace(start, 1.1 * start, 8) for start in (300.0, 700.0, 3000.0))
TORN = np.array([100.0, 150.0, 200.0, 290.0, 340.0, 500.0, 700.0, 900.0])  # on both sides of LOW
LEARNED = 500.0  # returns above this were learned


def agent(name, algorithm, returns=MIDDLE, reached_at=100, budget=1000, **block):
    """Return an agent whose seeds all reach their return at `reached_at`, and are at 0 before."""
    steps = np.array([0.95 * reached_at, reached_at, budget])
    curves = {
        seed: {
            "env_steps": steps,
            "seconds": steps * (1 + 0.001 * seed) / 1000,
            "evaluation_return_mean": np.where(steps >= reached_at, float(value), 0.0),
        }
        for seed, value in enumerate(returns)
    }
    whole = small_agents.agents()[algorithm]
    settings = type(whole).model_validate(whole.model_dump() | block)
    quantities = dict.fromkeys(("flight", "apex", "fluidity"), np.linspace(1.0, 1.2, len(returns)))
    quantities |= {"return": np.array(returns, dtype=float)}
    return AgentResults(name, settings, quantities, curves, episodes={"return": LOW})


def having(one, variants=None, **quantities):
    """Return an agent with other quantities, and with variants as {variant: {quantity: values}}."""
    others = {name: np.asarray(values, dtype=float) for name, values in quantities.items()}
    variants = {
        variant: {name: np.asarray(values, dtype=float) for name, values in columns.items()}
        for variant, columns in (variants or {}).items()
    }
    return replace(one, quantities=one.quantities | others, variants=variants)


def claim(measure="return", agent="sac", against="dqn", **more):
    return Claim.model_validate(
        {"text": "One is more.", "measure": measure, "agent": agent, "against": against} | more
    )


def judge(asked, *agents):
    return claims.judge(asked, {one.name: one for one in agents}, COMPARE, LEARNED)


def one_of(asked, *agents):
    """Return the verdict's entry on one claim."""
    judged = judge([asked], *agents)
    assert not judged["not_asked"]
    (entry,) = judged["claims"]
    return entry
