"""The whole of `params.yaml`: an experiment."""

from collections import Counter
from itertools import combinations, product
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

from pydantic import Field, field_validator, model_validator

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.catalogue import ALGORITHMS, demonstrated
from jumping_ant.base.errors import InputError
from jumping_ant.params.blocks import (
    ActionParams,
    Block,
    CompareParams,
    ComputeParams,
    DemonstrationParams,
    EnvParams,
    EvaluateParams,
    RecordParams,
    RobotParams,
    RobustnessParams,
    Seed,
    TrainingParams,
    refusal,
)

RESERVED_NAMES = {"lineup", "you"}  # a file in media/, and the visitor of the live page
# File systems allow 255 characters, of which DVC and MLflow need some.
AgentName = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$", max_length=60)]

# Seeds of start states. Those of training are derived numbers of 128 bits (see `base.seeding`).
TUNING_SEEDS = range(7_000_000, 8_000_000)  # of `make tune`; its training seeds are of these, too
EPISODES_AT_ONCE = 16  # demonstrations are played in batches of so many

if TYPE_CHECKING:
    AnyAgent = AgentBlock
    Demonstrated = str
else:  # any agent of the catalogue, and any algorithm that needs demonstrations
    Demonstrated = Literal[tuple(sorted(demonstrated()))]
    AnyAgent = Annotated[
        Union[tuple(algorithm.settings for algorithm in ALGORITHMS.values())],  # noqa: UP007
        Field(discriminator="algorithm"),
    ]


class Params(Block):
    """The whole of `params.yaml`."""

    seeds: Annotated[
        list[Seed], Field(min_length=1, max_length=1000, json_schema_extra={"uniqueItems": True})
    ]
    """Training seeds: one run for each agent and seed. A seed is the unit of every statistic."""
    robot: RobotParams
    """The robot and its edits."""
    env: EnvParams
    """The task."""
    agents: Annotated[
        dict[AgentName, AnyAgent],
        Field(min_length=1, json_schema_extra={"additionalProperties": False}),
    ]
    """The agents that are trained, evaluated, filmed and compared, by name."""
    demonstrations: dict[Demonstrated, DemonstrationParams]
    """What agents learn from whose algorithm needs demonstrations, by algorithm."""
    training: TrainingParams
    """How learning curves are measured during training."""
    compute: ComputeParams
    """How the work is distributed. No result depends on it."""
    evaluate: EvaluateParams
    """The held-out episodes, the same for every policy, with deterministic actions."""
    robustness: RobustnessParams
    """Held-out episodes under perturbations."""
    record: RecordParams
    """Each agent's median episode, as a video and as a Rerun recording."""
    claims: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$", max_length=60)]
    """Which claims on the agents are tested: those of `claims/NAME.yaml`, or none."""
    compare: CompareParams
    """Interquartile means over seeds with their intervals, and tests of the claims."""

    @field_validator("agents")
    @classmethod
    def _names_are_free(cls, agents: dict[str, Any]) -> dict[str, Any]:
        if taken := sorted(RESERVED_NAMES & agents.keys()):
            raise ValueError(f"{taken[0]!r} names something else; allowed: any other")
        return agents

    @model_validator(mode="after")
    def _blocks_fit(self) -> "Params":
        self._check_seeds()
        for name, agent in self.agents.items():
            if fault := agent.fault(self.env):
                raise ValueError(f"agents.{name}.{fault}")
        self._check_demonstrations()
        self._check_episodes()
        return self

    def _check_seeds(self) -> None:
        seed, count = Counter(self.seeds).most_common(1)[0]
        if count > 1:
            raise refusal("seeds", f"{seed} more than once", "each seed once")
        if tuned := sorted(set(self.seeds).intersection(TUNING_SEEDS)):
            allowed = f"none of {_shown(TUNING_SEEDS)}, on which `make tune` chooses settings"
            raise refusal("seeds", tuned[0], allowed)

    def _check_demonstrations(self) -> None:
        """Demonstrators can demonstrate, and imitators are like them and learn no longer."""
        able = [name for name, agent in self.agents.items() if _can_demonstrate(agent)]
        for algorithm, block in self.demonstrations.items():
            if block.agent not in able:
                allowed = f"learners that choose torques ({', '.join(able) or 'there is none'})"
                raise refusal(f"demonstrations.{algorithm}.agent", repr(block.agent), allowed)
        for name, agent in self.agents.items():
            if not agent.learns_from_demonstrations:
                continue
            shown = self.demonstrations.get(agent.algorithm)
            if shown is None:
                allowed = f"{agent.algorithm}: {{agent: ...}}, which says who demonstrates"
                raise refusal("demonstrations", f"none for agents.{name}", allowed)
            for key in ("robot", "actions"):
                if getattr(agent, key) != getattr(self.agents[shown.agent], key):
                    given = f"another than that of {shown.agent}, whom it imitates"
                    raise refusal(f"agents.{name}.{key}", given, "the same")
            if agent.max_env_steps > shown.steps:
                allowed = f"at most demonstrations.{agent.algorithm}.steps, {shown.steps}"
                raise refusal(f"agents.{name}.total_steps", agent.max_env_steps, allowed)

    def _check_episodes(self) -> None:
        """No episode serves two purposes, so that held-out ones are new to every policy.

        Only imitators may learn from the same ones.
        """
        for (key, ranges), (later_key, later_ranges) in combinations(self._episodes().items(), 2):
            if key.startswith("demonstrations.") and later_key.startswith("demonstrations."):
                continue
            for seeds, later_seeds in product(ranges, later_ranges):
                if seeds.start < later_seeds.stop and later_seeds.start < seeds.stop:
                    given = f"episodes of the seeds {_shown(later_seeds)}"
                    allowed = f"none of {_shown(seeds)}, those of {key}"
                    raise refusal(later_key, given, allowed)

    def _episodes(self) -> dict[str, list[range]]:
        """Return all seeds of episodes that are plain numbers, by the key that says the first."""
        episodes = {
            "make tune": [TUNING_SEEDS],
            "training.evaluation_seed": [self.training.block(seed) for seed in self.seeds],
            "evaluate.seed": [self.evaluate.block(seed) for seed in self.seeds],
        }
        for algorithm, block in self.demonstrations.items():  # an episode has at least one step
            most = -(-block.steps // EPISODES_AT_ONCE) * EPISODES_AT_ONCE
            episodes[f"demonstrations.{algorithm}.seed"] = [range(block.seed, block.seed + most)]
        return episodes

    def demonstrator(self, agent: AgentBlock) -> str:
        """Return the name of the agent that an agent imitates; empty if it imitates none."""
        imitates = agent.learns_from_demonstrations
        return self.demonstrations[agent.algorithm].agent if imitates else ""

    def agent(self, name: str) -> AgentBlock:
        """Return one agent's block, or raise an InputError that lists the existing ones."""
        if name not in self.agents:
            raise InputError(f"agent: given {name!r}, allowed: {', '.join(self.agents)}")
        return self.agents[name]


def _shown(seeds: range) -> str:
    return f"{seeds.start} to {seeds.stop - 1}"


def _can_demonstrate(agent: AgentBlock) -> bool:
    """Return whether an agent learns to choose torques, and not from demonstrations itself."""
    actions = getattr(agent, "actions", None)
    learns = not agent.is_baseline and not agent.learns_from_demonstrations
    return learns and isinstance(actions, ActionParams) and actions.kind == "torques"
