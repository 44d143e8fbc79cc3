"""The claims, each fixed beforehand in docs/claims.md.

A claim is a text, the number of the article's statement that it tests (None for claims of a
sceptic), and a function that compares the agents. An agent represents its algorithm, whatever its
name: with two SAC agents there are two claims on SAC and DQN. A claim whose agents or variants are
missing is left out.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Literal

from jumping_ant.judging.claims import findings
from jumping_ant.judging.claims.field import (
    Field,
    differs_by_robot,
    drawn_actions,
    effort,
    speed_up,
)
from jumping_ant.judging.claims.findings import Finding, Sample
from jumping_ant.judging.results import AgentResults
from jumping_ant.params.blocks import CompareParams
from jumping_ant.words.wording import number

MUCH_BETTER = 2.0  # what "much" is taken to mean: a factor on the return

Compare = Callable[[CompareParams], Finding]
Unit = Literal["env_steps", "seconds"]
WORDS: dict[Unit, str] = {"env_steps": "control steps", "seconds": "training seconds"}
RETURN, FLUIDITY = "Return", "Fluidity (closer to 0 is more fluid)"


@dataclass(frozen=True)
class Claim:
    """A claim: its text, the number of the article's statement, and how to judge it."""

    text: str
    statement: int | None
    find: Compare


def claims(field: Field) -> Iterator[Claim]:
    """Yield all claims that the available agents can test."""
    by_commands = [agent for agent in field.random if drawn_actions(agent) == "commands"]
    for dqn, random in product(field.dqn, (by_commands or field.random)[:1]):
        yield _learns_to_jump(dqn, random)
    for learner in field.learners:
        if metronome := field.metronome(learner):
            yield _beats_open_loop(learner, metronome)
    for sac, dqn in product(field.sac, field.dqn):
        yield _less_fluid(sac, dqn)
        yield _longer_training(sac, dqn)
        yield _much_better(sac, dqn)
    for learner in (agent for agent in (*field.sac, *field.pgpe) if "rounded" in agent.variants):
        yield _rounding_costs(learner)
        if learner.algorithm == "sac" and field.dqn:
            yield _rounding_stiffens(learner)
    for torques, commands in field.action_sets:
        yield _commands_cost(torques, commands)
    for learner, a2c in product([*field.ppo, *field.sac], field.a2c):
        yield _steadier_than_a2c(learner, a2c)
        if field.random:
            yield _more_efficient_than_a2c(learner, a2c, field.threshold)
    if field.random:
        for simple, complex_ in [*product(field.dqn, field.ddpg), *product(field.ddpg, field.td3)]:
            yield _harder(simple, complex_, field.threshold)
    for two, one in field.critics:
        yield _second_critic(two, one)
    for pgpe, rival in product(field.pgpe, [*field.sac, *field.dqn]):
        yield _robust(pgpe, rival)
        if field.random:
            yield _heavy(pgpe, rival, "env_steps", field.threshold)
            yield _heavy(pgpe, rival, "seconds", field.threshold)
        if pgpe.step_seconds and rival.step_seconds:
            yield _parallel(pgpe, rival)
    for pgpe, rival in product(field.pgpe, field.sparse):
        yield _for_sparse_rewards(pgpe, rival)
    for pgpe in field.pgpe:
        if {"final", "best_sample"} <= pgpe.variants.keys():
            yield _centre_is_best(pgpe)
    for pgpe, rival in product(field.pgpe, field.evolution):
        yield _best_of_evolution(pgpe, rival)
    for pgpe, plain in field.constants:
        yield _steadier(pgpe, plain)
    for imitator, imitated in field.imitated if field.random else ():
        yield _skips_exploration(imitator, imitated, field.threshold)
    for agent, plain in product([*field.learners, *field.open_loop], field.unedited):
        if differs_by_robot(agent, plain):
            yield _jumps_higher(agent, plain)


def _returns_more(
    agent: AgentResults, other: AgentResults, statement: int | None, text: str
) -> Claim:
    """Return the claim that an agent returns more than another."""
    return Claim(
        text,
        statement,
        lambda params: findings.independent(
            RETURN, _sample(agent, "return"), _sample(other, "return"), params
        ),
    )


def _learns_to_jump(dqn: AgentResults, random: AgentResults) -> Claim:
    parts = {"flight": "Share of time in flight", "apex": "Apex of a jump [m]"}
    return Claim(
        f"{dqn.label} learns to jump: it is in the air for longer than {random.label}, and its "
        "jumps are higher.",
        1,
        lambda params: findings.both(
            [
                findings.independent(label, _sample(dqn, name), _sample(random, name), params)
                for name, label in parts.items()
            ]
        ),
    )


def _beats_open_loop(learner: AgentResults, metronome: AgentResults) -> Claim:
    return _returns_more(
        learner,
        metronome,
        None,
        f"{learner.label} returns more than {metronome.label}, which does not look at the robot.",
    )


def _less_fluid(sac: AgentResults, dqn: AgentResults) -> Claim:
    return Claim(
        f"{dqn.label} moves less fluidly than {sac.label}.",
        2,
        lambda params: findings.independent(
            FLUIDITY, _sample(sac, "fluidity"), _sample(dqn, "fluidity"), params
        ),
    )


def _rounding_stiffens(sac: AgentResults) -> Claim:
    return Claim(
        f"Discrete actions make movements less fluid: {sac.label} with its actions rounded to the "
        "five commands moves less fluidly than with its own.",
        2,
        lambda params: findings.paired(FLUIDITY, *_own_and_rounded(sac, "fluidity"), params),
    )


def _longer_training(sac: AgentResults, dqn: AgentResults) -> Claim:
    return Claim(
        f"{sac.label} takes more time to train than {dqn.label}, in all.",
        3,
        lambda params: findings.independent(
            "Training time [s]",
            Sample(sac.label, sac.train_seconds),
            Sample(dqn.label, dqn.train_seconds),
            params,
        ),
    )


def _much_better(sac: AgentResults, dqn: AgentResults) -> Claim:
    return Claim(
        f"{sac.label} ends much better than {dqn.label}: at least {MUCH_BETTER:g} times its "
        "return.",
        4,
        lambda params: findings.independent(
            RETURN, _sample(sac, "return"), _sample(dqn, "return"), params, MUCH_BETTER
        ),
    )


def _rounding_costs(learner: AgentResults) -> Claim:
    return Claim(
        f"Discrete actions are inefficient: {learner.label} with its actions rounded to the five "
        "commands returns less than with its own.",
        5,
        lambda params: findings.paired(RETURN, *_own_and_rounded(learner, "return"), params),
    )


def _commands_cost(torques: AgentResults, commands: AgentResults) -> Claim:
    return _returns_more(
        torques,
        commands,
        5,
        f"Discrete actions are inefficient: {torques.label} returns more than {commands.label}, "
        "which chooses among the five commands.",
    )


def _steadier_than_a2c(learner: AgentResults, a2c: AgentResults) -> Claim:
    return Claim(
        f"{learner.label} is steadier than {a2c.label}: its return varies less from seed to seed.",
        6,
        lambda params: findings.less_spread(
            RETURN, _sample(learner, "return"), _sample(a2c, "return"), params
        ),
    )


def _more_efficient_than_a2c(learner: AgentResults, a2c: AgentResults, threshold: float) -> Claim:
    return Claim(
        f"{learner.label} is more efficient than {a2c.label}, which needs more control steps to "
        "learn anything.",
        6,
        lambda params: _more_steps(a2c, learner, threshold, params),
    )


def _harder(simple: AgentResults, complex_: AgentResults, threshold: float) -> Claim:
    return Claim(
        f"The more complex the model, the harder the training: {complex_.label} needs more control "
        f"steps than {simple.label} to learn anything.",
        7,
        lambda params: _more_steps(complex_, simple, threshold, params),
    )


def _second_critic(two: AgentResults, one: AgentResults) -> Claim:
    return _returns_more(
        two,
        one,
        8,
        f"A second critic helps: {two.label} returns more than {one.label}, which has one.",
    )


def _best_of_evolution(pgpe: AgentResults, rival: AgentResults) -> Claim:
    return _returns_more(
        pgpe,
        rival,
        12,
        f"{pgpe.label} is the best evolutionary algorithm: it returns more than {rival.label}.",
    )


def _robust(pgpe: AgentResults, rival: AgentResults) -> Claim:
    return Claim(
        f"{pgpe.label} is robust: its return varies less from seed to seed than that of "
        f"{rival.label}.",
        9,
        lambda params: findings.less_spread(
            RETURN, _sample(pgpe, "return"), _sample(rival, "return"), params
        ),
    )


def _heavy(pgpe: AgentResults, rival: AgentResults, unit: Unit, threshold: float) -> Claim:
    words = WORDS[unit]
    return Claim(
        f"{pgpe.label} is computationally heavy: it needs more {words} than {rival.label} to learn "
        "anything.",
        10,
        lambda params: _more_effort(pgpe, rival, unit, threshold, params),
    )


def _for_sparse_rewards(pgpe: AgentResults, rival: AgentResults) -> Claim:
    return _returns_more(
        pgpe,
        rival,
        11,
        f"{pgpe.label} is an alternative where rewards are sparse: it returns more than "
        f"{rival.label}, which learns from the returns of whole episodes, too.",
    )


def _centre_is_best(pgpe: AgentResults) -> Claim:
    centre, sample = (
        Sample(f"{pgpe.label}, {label}", pgpe.variants[variant]["return"])
        for variant, label in (("final", "centre"), ("best_sample", "best of its samples"))
    )
    return Claim(
        f"The centre of {pgpe.label}'s search is its best policy: it returns more than the best of "
        "the policies sampled around it.",
        13,
        lambda params: findings.paired(RETURN, centre, sample, params),
    )


def _steadier(pgpe: AgentResults, plain: AgentResults) -> Claim:
    return Claim(
        f"A constant off the reward steadies PGPE: the return of {pgpe.label} varies less from "
        f"seed to seed than that of {plain.label}.",
        14,
        lambda params: findings.less_spread(
            RETURN, _sample(pgpe, "return"), _sample(plain, "return"), params
        ),
    )


def _parallel(pgpe: AgentResults, rival: AgentResults) -> Claim:
    return Claim(
        f"The population of {pgpe.label} parallelises: all cores speed it up more than "
        f"{rival.label}, which updates one policy.",
        15,
        lambda params: findings.independent(
            "Speed-up from one thread to all cores", speed_up(pgpe), speed_up(rival), params
        ),
    )


def _skips_exploration(imitator: AgentResults, imitated: AgentResults, threshold: float) -> Claim:
    return Claim(
        f"Imitation skips exploration: {imitator.label} needs fewer control steps than "
        f"{imitated.label}, which it imitates, to learn anything.",
        16,
        lambda params: _more_steps(imitated, imitator, threshold, params),
    )


def _jumps_higher(agent: AgentResults, plain: AgentResults) -> Claim:
    return Claim(
        f"A lighter body and stronger legs jump higher: {agent.label} gets higher than "
        f"{plain.label}, whose robot is unedited.",
        17,
        lambda params: findings.independent(
            "Apex of a jump [m]", _sample(agent, "apex"), _sample(plain, "apex"), params
        ),
    )


def _more_effort(
    slow: AgentResults, fast: AgentResults, unit: Unit, threshold: float, params: CompareParams
) -> Finding:
    return findings.more_effort(
        f"{WORDS[unit].capitalize()} to a return above {number(threshold)} that lasts",
        effort(slow, unit, threshold),
        effort(fast, unit, threshold),
        params,
    )


def _more_steps(
    slow: AgentResults, fast: AgentResults, threshold: float, params: CompareParams
) -> Finding:
    return _more_effort(slow, fast, "env_steps", threshold, params)


def _own_and_rounded(agent: AgentResults, quantity: str) -> tuple[Sample, Sample]:
    rounded = Sample(f"{agent.label}, rounded", agent.variants["rounded"][quantity])
    return _sample(agent, quantity), rounded


def _sample(agent: AgentResults, quantity: str) -> Sample:
    return Sample(agent.label, agent.quantities[quantity])
