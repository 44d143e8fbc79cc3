"""An algorithm's row of the catalogue, and the settings that all agents share."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, Self, TypeVar, get_args

from jumping_ant.agents.families import Family
from jumping_ant.agents.ranges import Ranges
from jumping_ant.params.blocks import Block, EnvParams
from jumping_ant.policies.policy_file import KINDS

TORQUES = {"kind": "torques", "amplitude": 1.0, "hold": 3}  # of examples


class AgentBlock(Block):
    """Settings shared by the blocks of all agents; each algorithm adds its own."""

    is_baseline: ClassVar[bool] = False  # whether the agent learns nothing
    depends_on_seed: ClassVar[bool] = True  # whether seeds differ
    learns_from_demonstrations: ClassVar[bool] = False

    algorithm: str
    """Algorithm of the catalogue, which says how the agent is trained."""
    robot: Literal["edited", "unedited"]
    """Robot that the agent controls: the one of `robot`, or its unedited source."""

    @property
    @abstractmethod
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps]; 0 if nothing is trained."""

    def has_ended(self, env_steps: int, updates: int) -> bool:
        """Return whether a seed has used up its budget after so many control steps and updates."""
        return env_steps >= self.max_env_steps

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


def defaults(**values: Any) -> Callable[[type[Settings]], type[Settings]]:
    """Give settings that a block inherits defaults of its own."""

    def changed(settings: type[Settings]) -> type[Settings]:
        for name, value in values.items():
            settings.model_fields[name].default = value
        settings.model_rebuild(force=True)
        return settings

    return changed


@dataclass(frozen=True)
class Algorithm:
    """A row of the catalogue.

    Attributes:
        settings: The model of its block in `params.yaml`.
        family: The kind of algorithm; results are grouped and coloured by it.
        example: Settings of a training of a few updates, for checks; others have their defaults.
        learner: `module:name` of what the trainer builds, imported when training starts; empty if
            the trainer needs none.
        logged: Logged values that the learning curve keeps, by the learner's names.
        counters: Counters of the learner in addition to those that its whole family keeps.
        trainer: The module that trains its agents; by default `trainer` beside the settings.
        label: The algorithm's name as it is printed; by default in capitals.
        about: What it is in words, in recordings; by default the label.
        policy_kind: The kind of its policies, a key of `KINDS`; by default the algorithm's name.
        ranges: What a search for settings may choose from; empty if there is nothing to search.
        has_rounded: Whether variants of its policies that round torques are played as well.
        has_best_sample: Whether a variant that is the best of a distribution's samples is, too.
        is_scaled: Whether its training is timed by the number of threads.
        is_perturbed: Whether its policies are played under perturbations.

    Raises:
        ValueError: There are no policies of such a kind.
    """

    settings: type[AgentBlock]
    family: Family
    example: Mapping[str, Any]
    learner: str = ""
    logged: tuple[str, ...] = ()
    counters: tuple[str, ...] = ()
    trainer: str = ""
    label: str = ""
    about: str = ""
    policy_kind: str = ""
    ranges: Ranges = field(default_factory=dict)
    has_rounded: bool = False
    has_best_sample: bool = False
    is_scaled: bool = False
    is_perturbed: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "label", self.label or self.name.upper())
        beside = self.settings.__module__.rpartition(".")[0]
        object.__setattr__(self, "trainer", self.trainer or f"{beside}.trainer")
        object.__setattr__(self, "about", self.about or self.label)
        object.__setattr__(self, "policy_kind", self.policy_kind or self.name)
        if self.policy_kind not in KINDS:
            raise ValueError(
                f"{self.name}: given policy_kind {self.policy_kind!r}, allowed: {[*KINDS]}"
            )

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
