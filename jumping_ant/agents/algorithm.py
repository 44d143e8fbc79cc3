"""An algorithm's row of the catalogue, and the settings that all agents share."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, Self, TypeVar, get_args

from jumping_ant.agents.families import Family
from jumping_ant.agents.ranges import Ranges
from jumping_ant.params.blocks import Block, EnvParams

TORQUES = {"kind": "torques", "amplitude": 1.0, "hold": 3}  # of examples


class AgentBlock(Block):
    """Settings shared by the blocks of all agents; each algorithm adds its own."""

    is_baseline: ClassVar[bool] = False  # whether the agent learns nothing
    depends_on_seed: ClassVar[bool] = True  # whether seeds differ
    learns_from_demonstrations: ClassVar[bool] = False

    algorithm: str
    """Algorithm of the catalogue."""
    robot: Literal["edited", "unedited"]
    """Robot that the agent controls: the one of `robot`, or its unedited source."""

    @property
    @abstractmethod
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps]; 0 if nothing is trained."""

    def fault(self, env: EnvParams) -> str | None:
        """Return what does not fit the task (key, given, allowed), or None if the block fits."""
        return None

    def for_timing(self) -> Self | None:
        """Return settings with which each row of the learning curve is one unit of work.

        A unit is the work that threads share: a generation, or some rounds of rollouts and
        updates. Returns None if there is nothing to time.
        """
        return None


Settings = TypeVar("Settings", bound=AgentBlock)


def settings(algorithm: str = "", **defaults: Any) -> Callable[[type[Settings]], type[Settings]]:
    """Name the algorithm of a block, and give settings that it inherits other defaults."""

    def changed(block: type[Settings]) -> type[Settings]:
        if algorithm:
            block.model_fields["algorithm"].annotation = Literal[algorithm]  # type: ignore[assignment]
        for name, value in defaults.items():
            block.model_fields[name].default = value
        block.model_rebuild(force=True)
        return block

    return changed


@dataclass(frozen=True)
class Algorithm:
    """A row of the catalogue."""

    settings: type[AgentBlock]  # the model of its block in `params.yaml`
    family: Family  # by which results are grouped and coloured
    example: Mapping[str, Any]  # settings of a training of a few updates; others have defaults
    learner: str = ""  # `module:name` of what the trainer builds, imported when training starts
    logged: tuple[str, ...] = ()  # values that the learning curve keeps, by the learner's names
    trainer: str = ""  # module that trains; by default `trainer` beside the settings
    label: str = ""  # its name as it is printed; by default in capitals
    about: str = ""  # what it is in words, in recordings; by default the label
    policy_kind: str = ""  # of its policies (see `policy_file`); by default the algorithm's name
    ranges: Ranges = field(default_factory=dict)  # that a search for settings chooses from
    has_best_sample: bool = False  # whether the best of the distribution's samples is, too
    is_perturbed: bool = True  # whether its policies are played under perturbations

    def __post_init__(self) -> None:
        object.__setattr__(self, "label", self.label or self.name.upper())
        beside = self.settings.__module__.rpartition(".")[0]
        object.__setattr__(self, "trainer", self.trainer or f"{beside}.trainer")
        object.__setattr__(self, "about", self.about or self.label)
        object.__setattr__(self, "policy_kind", self.policy_kind or self.name)

    @property
    def name(self) -> str:
        """Name of the algorithm in `params.yaml`."""
        (name,) = get_args(self.settings.model_fields["algorithm"].annotation)
        return str(name)

    def example_agent(self) -> Any:
        """Return an agent of the algorithm that trains for a few updates."""
        agent = {"algorithm": self.name, "robot": "edited", **self.example}
        return self.settings.model_validate(agent)

    @property
    def package(self) -> str:
        """Name of the package in `jumping_ant.agents` that has its settings and its trainer."""
        return self.settings.__module__.split(".")[-2]

    @property
    def is_baseline(self) -> bool:
        """Whether the algorithm learns nothing."""
        return self.settings.is_baseline
