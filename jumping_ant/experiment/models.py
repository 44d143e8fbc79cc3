"""The whole of `params.yaml`: an experiment."""

from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import Field, field_validator, model_validator

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.base.errors import InputError
from jumping_ant.params.blocks import (
    Block,
    CompareParams,
    ComputeParams,
    EnvParams,
    EvaluateParams,
    RecordParams,
    RobotParams,
    Seed,
    TrainingParams,
)

RESERVED_NAMES = {"lineup"}  # names of files in media/
AgentName = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")]
if TYPE_CHECKING:
    AnyAgent = AgentBlock
else:  # any agent of the catalogue
    AnyAgent = Annotated[
        Union[tuple(algorithm.settings for algorithm in ALGORITHMS.values())],  # noqa: UP007
        Field(discriminator="algorithm"),
    ]


class Params(Block):
    """The whole of `params.yaml`."""

    seeds: Annotated[list[Seed], Field(min_length=1, json_schema_extra={"uniqueItems": True})]
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
    training: TrainingParams
    """How learning curves are measured during training."""
    compute: ComputeParams
    """How the work is distributed. No result depends on it."""
    evaluate: EvaluateParams
    """The held-out episodes, the same for every policy, with deterministic actions."""
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
        twice = sorted({seed for seed in self.seeds if self.seeds.count(seed) > 1})
        if twice:
            raise ValueError(f"seeds holds {twice[0]} more than once; allowed: each seed once")
        return self

    @model_validator(mode="after")
    def _agents_fit_the_task(self) -> "Params":
        for name, agent in self.agents.items():
            if fault := agent.fault(self.env):
                raise ValueError(f"agents.{name}.{fault}")
        return self

    def agent(self, name: str) -> AgentBlock:
        """Return one agent's block.

        Raises:
            InputError: No agent has that name; the message lists the existing ones.
        """
        if name not in self.agents:
            raise InputError(f"agent: given {name!r}, allowed: {', '.join(self.agents)}")
        return self.agents[name]
