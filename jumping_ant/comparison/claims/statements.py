"""The article's statements and the claims that test them.

docs/measures-and-claims.md fixed them before the run that they judge.

An agent represents its algorithm, whatever its name: with two SAC agents there are two claims on
SAC and DQN. A claim whose agents or measurements are missing is left out. The claims on perturbed
episodes and on seconds are in `jumping_ant.comparison.retention` and `.timing`.
"""

from dataclasses import dataclass

from jumping_ant.comparison.claims.evidence import (
    Compare,
    at_full_torque,
    fewer_steps,
    less_spread,
    more,
    more_effort,
    more_in_version,
)
from jumping_ant.comparison.claims.field import Field, Select, each, pairs, twins
from jumping_ant.evaluation.episodes import PUBLISHED

STATEMENTS = {  # the article's, in our words
    1: "DQN finds out that jumping is best",
    2: "DQN's movements are not fluid, because its actions are discrete",
    3: "SAC takes more time to train",
    4: "SAC's results are much better",
    5: "Actor-critic methods suit continuous problems; discretising is inefficient",
    6: "PPO and SAC are steadier and more efficient than A2C",
    7: "The more complex the model, the harder the training",
    8: "A second critic helps",
    9: "Evolution is robust",
    10: "Evolution is computationally heavy",
    11: "Evolution is an alternative where rewards are sparse",
    12: "PGPE is the best evolutionary algorithm",
    13: "The centre of PGPE's search is its best policy",
    14: "A constant off the reward stabilises PGPE",
    15: "A population runs in parallel, the others update one policy",
    16: "Imitation skips exploration",
    17: "A lighter body and stronger legs jump higher",
}


@dataclass(frozen=True)
class Row:
    """A claim on any agents: its statement (None: a sceptic's), its text, and what it compares."""

    statement: int | None
    text: str
    compare: Compare


# Which agents, in the order of their labels in the texts, and the claims on them.
Table = tuple[tuple[Select, tuple[Row, ...]], ...]
CLAIMS: Table = (
    (Field.beside_random, (
        Row(1, "{0} learns to jump: it is in the air for longer than {1}, and its jumps are "
            "higher.", more("flight", "apex")),
    )),
    (Field.beside_open_loop, (
        Row(None, "{0} returns more than {1}, which does not look at the robot.",
            more("return", margin="returns")),
    )),
    (pairs("sac", "dqn"), (
        Row(2, "{1} moves less fluidly than {0}.", more("fluidity", margin="fluidity")),
        Row(4, "{0} ends better than {1}: it returns more.", more("return")),
        Row(4, "{0} ends much better than {1}: at least 2 times its return.",
            more("return", factor=2.0)),
    )),
    (each("sac pgpe"), (
        Row(2, "Discrete actions make movements less fluid: {0} with two levels for each motor "
            "moves less fluidly than with its own torques.",
            more_in_version("fluidity", PUBLISHED, "signed", "fluidity")),
        Row(5, "Discreteness costs return: {0} with two levels for each motor returns less than "
            "with its own torques.",
            more_in_version("return", PUBLISHED, "signed", "returns")),
        Row(5, "Having only five commands costs return: {0} with the nearest of them returns less "
            "than with two levels for each motor.",
            at_full_torque(more_in_version("return", "signed", "rounded_full", "returns"))),
        Row(5, "Half the torque costs return: {0} with the nearest of the five commands returns "
            "less at half than at full torque.",
            at_full_torque(more_in_version("return", "rounded_full", "rounded", "returns"))),
    )),
    (twins("torques instead of two levels"), (
        Row(5, "Discreteness costs return: {0} returns more than {1}, which was trained with two "
            "levels for each motor.", more("return", margin="returns")),
    )),
    (twins("torques instead of commands"), (
        Row(5, "Having only five commands costs return: {0} returns more than {1}, which was "
            "trained with the five commands.", more("return", margin="returns")),
    )),
    (twins("full torque"), (
        Row(5, "Half the torque costs return: {0} returns more than {1}, which was trained with "
            "half the torque.", more("return", margin="returns")),
    )),
    (pairs("ppo sac", "a2c"), (
        Row(6, "{0} is steadier than {1}: its return varies less from seed to seed.", less_spread),
        Row(6, "{0} is more efficient than {1}, which needs more control steps to learn anything.",
            fewer_steps),
    )),
    (pairs("dqn", "ddpg", "td3"), (
        Row(7, "The more complex the model, the harder the training: {1} needs more control steps "
            "than {0} to learn anything.", fewer_steps),
    )),
    (twins("critics"), (
        Row(8, "A second critic helps: {0} returns more than {1}, which has one.",
            more("return", margin="returns")),
    )),
    (pairs("pgpe", "sac dqn"), (
        Row(9, "{0} is robust: its return varies less from seed to seed than that of {1}.",
            less_spread),
        Row(10, "{0} is computationally heavy: it needs more control steps than {1} to learn "
            "anything.", more_effort("env_steps")),
    )),
    (Field.beside_sparse_rewards, (
        Row(11, "{0} is an alternative where rewards are sparse: it returns more than {1}, which "
            "learns from the returns of whole episodes, too.", more("return")),
    )),
    (each("pgpe"), (
        Row(13, "The centre of {0}'s search is its best policy: the best of the policies sampled "
            "around it does not return more by the margin.",
            more_in_version("return", "final", "best_sample", "returns", or_equal=True)),
    )),
    (Field.beside_evolution, (
        Row(12, "{0} is the best evolutionary algorithm: it returns more than {1}.",
            more("return", margin="returns")),
    )),
    (twins("constant"), (
        Row(14, "A constant off the reward steadies PGPE: the return of {0} varies less from seed "
            "to seed than that of {1}.", less_spread),
    )),
    (Field.imitators, (
        Row(16, "Imitation skips exploration: {0} needs fewer control steps than {1}, which it "
            "imitates, to learn anything.", fewer_steps),
    )),
    (twins("edits"), (
        Row(17, "A lighter body and stronger legs jump higher: {0} gets higher than {1}, whose "
            "robot is unedited.", more("apex")),
    )),
)  # fmt: skip
