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
    TuningParams,
)

RESERVED_NAMES = {"lineup"}  # names of files in media/
# File systems allow 255 characters, of which DVC and MLflow need some.
AgentName = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$", max_length=60)]

# Seeds of start states that no block names. Those of training, and of the article's own tests, are
# derived (see `base.seeding`): numbers of 128 bits, which are none of these.
TUNING_SEEDS = range(7_000_000, 8_000_000)  # of `make tune`; its training seeds are of these, too
SELECTION_EPISODES = 20  # first ones of validation: PGPE's best sample is chosen on them
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
    tuning: TuningParams
    """How `make tune` searches for settings."""
    evaluate: EvaluateParams
    """The held-out episodes, the same for every policy, with deterministic actions."""
    robustness: RobustnessParams
    """Held-out episodes under perturbations."""
    record: RecordParams
    """Each agent's median episode, as a video and as a Rerun recording."""
    compare: CompareParams
    """Interquartile means over seeds with their intervals, and tests of the claims."""

    @field_validator("agents")
    @classmethod
    def _names_are_free(cls, agents: dict[str, Any]) -> dict[str, Any]:
        taken = sorted(RESERVED_NAMES & agents.keys())
        if taken:
            raise ValueError(f"{taken[0]!r} names a file of media/; allowed: any other")
        return agents

    @model_validator(mode="after")
    def _seeds_differ(self) -> "Params":
        seed, count = Counter(self.seeds).most_common(1)[0]
        if count > 1:
            raise ValueError(f"seeds holds {seed} more than once; allowed: each seed once")
        if tuned := sorted(set(self.seeds).intersection(TUNING_SEEDS)):
            raise ValueError(
                f"seeds holds {tuned[0]}, allowed: none of {_shown(TUNING_SEEDS)}, on which "
                "`make tune` chooses settings"
            )
        return self

    @model_validator(mode="after")
    def _agents_fit_the_task(self) -> "Params":
        for name, agent in self.agents.items():
            if fault := agent.fault(self.env):
                raise ValueError(f"agents.{name}.{fault}")
        return self

    @model_validator(mode="after")
    def _demonstrations_can_be_made(self) -> "Params":
        for algorithm, demonstrations in self.demonstrations.items():
            agent = self.agents.get(demonstrations.agent)
            if agent is None or not _can_demonstrate(agent):
                able = [name for name, agent in self.agents.items() if _can_demonstrate(agent)]
                raise ValueError(
                    f"demonstrations.{algorithm}.agent: given {demonstrations.agent!r}, allowed: "
                    f"learners that choose torques ({', '.join(able) or 'there is none'})"
                )
        return self

    @model_validator(mode="after")
    def _perturbations_can_be_played(self) -> "Params":
        given, most = self.robustness.episodes, self.evaluate.episodes
        if given > most:
            raise ValueError(
                f"robustness.episodes: given {given}, allowed: at most evaluate.episodes, {most}"
            )
        levels = self.robustness.perturbations.model_dump()
        played, filmed = [name for name in levels if levels[name]], self.robustness.filmed
        if filmed is not None and filmed not in played:
            raise ValueError(
                f"robustness.filmed: given {filmed!r}, allowed: null, or a perturbation that has "
                f"levels ({', '.join(played) or 'there is none'})"
            )
        return self

    @model_validator(mode="after")
    def _episodes_differ(self) -> "Params":
        for (key, ranges), (later_key, later_ranges) in combinations(self._episodes().items(), 2):
            if key.startswith("demonstrations.") and later_key.startswith("demonstrations."):
                continue  # imitators may learn from the same episodes
            for seeds, later_seeds in product(ranges, later_ranges):
                if seeds.start < later_seeds.stop and later_seeds.start < seeds.stop:
                    raise ValueError(
                        f"{later_key}: given episodes of the seeds {_shown(later_seeds)}, allowed: "
                        f"none of {_shown(seeds)}, those of {key}"
                    )
        return self

    def _episodes(self) -> dict[str, list[range]]:
        """Return all seeds of episodes that are plain numbers, by the key that says the first.

        Held-out episodes must be new to a policy: to its training, to the choice among its
        snapshots, and to the choice of its settings.
        """
        training = self.training
        in_race = training.evaluation_episodes + training.finalist_episodes
        validation = max(in_race, SELECTION_EPISODES)
        return {
            "make tune": [TUNING_SEEDS],
            "training.evaluation_seed": [_count_up(training.evaluation_seed, validation)],
            "evaluate.seed": [self.evaluate.block(seed) for seed in self.seeds],
            **{  # an episode lasts for at least one step
                f"demonstrations.{algorithm}.seed": [
                    _count_up(block.seed, -(-block.steps // EPISODES_AT_ONCE) * EPISODES_AT_ONCE)
                ]
                for algorithm, block in self.demonstrations.items()
            },
        }

    @model_validator(mode="after")
    def _imitators_fit_their_demonstrations(self) -> "Params":
        for name, agent in self.agents.items():
            if not agent.learns_from_demonstrations:
                continue
            demonstrations = self.demonstrations.get(agent.algorithm)
            if demonstrations is None:
                raise ValueError(
                    f"demonstrations: given none for agents.{name}, allowed: "
                    f"{agent.algorithm}: {{agent: ...}}, which says who demonstrates"
                )
            expert = self.agents[demonstrations.agent]
            for key in ("robot", "actions"):
                if getattr(agent, key) != getattr(expert, key):
                    raise ValueError(
                        f"agents.{name}.{key}: given another than that of {demonstrations.agent}, "
                        f"whom it imitates; allowed: the same"
                    )
            if agent.max_env_steps > demonstrations.steps:
                raise ValueError(
                    f"agents.{name}.total_steps: given {agent.max_env_steps}, allowed: at most "
                    f"demonstrations.{agent.algorithm}.steps, {demonstrations.steps}"
                )
        return self

    def demonstrator(self, agent: AgentBlock) -> str:
        """Return the name of the agent that an agent imitates; empty if it imitates none."""
        if not agent.learns_from_demonstrations:
            return ""
        return self.demonstrations[agent.algorithm].agent

    def agent(self, name: str) -> AgentBlock:
        """Return one agent's block, or raise an InputError that lists the existing ones."""
        if name not in self.agents:
            raise InputError(f"agent: given {name!r}, allowed: {', '.join(self.agents)}")
        return self.agents[name]


def _count_up(first: int, count: int) -> range:
    return range(first, first + count)


def _shown(seeds: range) -> str:
    return f"{seeds.start} to {seeds.stop - 1}"


def _can_demonstrate(agent: AgentBlock) -> bool:
    """Return whether an agent learns to choose torques, and not from demonstrations itself."""
    actions = getattr(agent, "actions", None)
    learns = not agent.is_baseline and not agent.learns_from_demonstrations
    return learns and isinstance(actions, ActionParams) and actions.kind == "torques"
