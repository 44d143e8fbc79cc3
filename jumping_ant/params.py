"""`params.yaml`, read and checked.

Every number of the pipeline lives in that file. It is checked whole, before any work, against the
models below: unknown keys, wrong types and values out of range are refused with one line each that
names the key, what was given and what is allowed.

YAML is read as version 1.2, as DVC reads it: `3e-4` is a number.
"""

import difflib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, cast

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)
from pydantic_core import ErrorDetails
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from jumping_ant.errors import InputError
from jumping_ant.files import PROJECT_ROOT

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=1)]
Seed = Annotated[int, Field(ge=0, lt=2**31)]
RESERVED_NAMES = {"figures", "plots", "seeds", "timing"}  # folders of results/
AgentName = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")]


RATE = 100  # [1/s] of the simulation's steps


def _divides_the_rate(fps: int) -> int:
    """Refuse a frame rate that would need a frame between two steps."""
    if RATE % fps:
        divisors = ", ".join(str(number) for number in range(1, RATE + 1) if RATE % number == 0)
        raise ValueError(f"given {fps}, allowed: {divisors}")
    return fps


class Block(BaseModel):
    """A block of `params.yaml`: typed, closed to unknown keys, immutable."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class RobotParams(Block):
    """Edits of Gymnasium's Ant (see `jumping_ant.robot`)."""

    density: Positive
    gear: Positive
    joint_gear: dict[str, Positive]
    torso_radius: Positive
    leg_length: Positive
    friction: Positive


class RewardParams(Block):
    """The reward for torso height (see `jumping_ant.rewards`)."""

    floor: float
    span: Positive
    scale: Positive


class EnvParams(Block):
    """The jumping task (see `jumping_ant.env` and `jumping_ant.vector`)."""

    frame_skip: Count
    reset_noise_scale: NonNegative
    max_episode_steps: Count
    min_torso_height: float
    reward: RewardParams


class RandomAgentParams(Block):
    """The baseline: torques drawn uniformly at every step."""

    trainer: Literal["random"]
    algorithm: Literal["random"]

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps]: none."""
        return 0


class OffPolicyParams(Block):
    """What DQN and SAC have in common, named as in Stable-Baselines3."""

    trainer: Literal["off_policy"]
    total_steps: Count
    episode_steps: Count
    num_envs: Count
    learning_rate: Positive
    buffer_size: Count
    learning_starts: Annotated[int, Field(ge=0)]
    batch_size: Count
    tau: Fraction
    gamma: Fraction
    n_steps: Count
    train_freq: Count
    gradient_steps: Count
    net_arch: Annotated[list[Count], Field(min_length=1)]
    velocity_scale: Positive
    log_interval: Count

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps]."""
        return self.total_steps

    @model_validator(mode="after")
    def _budget_holds_a_round(self) -> "OffPolicyParams":
        if self.total_steps < self.num_envs * self.train_freq:
            raise ValueError(
                f"total_steps is {self.total_steps}, but one round of num_envs x train_freq takes "
                f"{self.num_envs * self.train_freq}"
            )
        return self


class DQNParams(OffPolicyParams):
    """Deep Q-network on the five discrete commands (Mnih et al. 2015)."""

    algorithm: Literal["dqn"]
    target_update_interval: Count
    exploration_fraction: Annotated[float, Field(gt=0, le=1)]
    exploration_initial_eps: Fraction
    exploration_final_eps: Fraction
    max_grad_norm: Positive


class SACParams(OffPolicyParams):
    """Soft actor-critic on continuous torques (Haarnoja et al. 2018)."""

    algorithm: Literal["sac"]
    ent_coef: Positive | Literal["auto"]


class PGPEParams(Block):
    """Policy gradients with parameter-based exploration (Sehnke et al. 2010), with ClipUp."""

    trainer: Literal["evolution"]
    algorithm: Literal["pgpe"]
    generations: Count
    population_size: Annotated[int, Field(ge=2, multiple_of=2)]
    episode_steps: Count
    center_learning_rate: Positive
    stdev_learning_rate: NonNegative
    stdev_init: Positive
    max_speed: Positive
    momentum: Fraction
    decrease_rewards_by: float
    observation_normalization: bool

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps], if no episode ends early."""
        return self.generations * self.population_size * self.episode_steps


ALGORITHMS: dict[str, type[Block]] = {
    "random": RandomAgentParams,
    "dqn": DQNParams,
    "sac": SACParams,
    "pgpe": PGPEParams,
}

# What is allowed, where pydantic's own words say it to programmers.
ALLOWED = {
    "bool_type": "true or false",
    "dict_type": "a block of keys",
    "invalid_key": "names as keys",
    "model_attributes_type": "a block of keys",
    "model_type": "a block of keys",
    "string_pattern_mismatch": "lower-case letters, digits, _ and -, the first a letter or digit",
    "string_type": "a name",
    "too_short": "at least one",
}

AgentParams = Annotated[
    RandomAgentParams | DQNParams | SACParams | PGPEParams, Field(discriminator="algorithm")
]


class TrainingParams(Block):
    """Evaluations while training (see `jumping_ant.training`)."""

    evaluations: Count
    evaluation_episodes: Count
    evaluation_seed: Seed


class ComputeParams(Block):
    """How the work is spread; no result depends on it."""

    workers: Annotated[int, Field(ge=0)]
    checkpoint_seconds: Positive


class EvaluateParams(Block):
    """Held-out episodes (see `jumping_ant.evaluation`)."""

    episodes: Count
    seed: Seed
    min_airborne_seconds: NonNegative


class RecordParams(Block):
    """Videos and recordings (see `jumping_ant.rendering` and `jumping_ant.recording`)."""

    width: Annotated[int, Field(ge=64, le=3840, multiple_of=2)]
    height: Annotated[int, Field(ge=64, le=2160, multiple_of=2)]
    fps: Annotated[int, Field(ge=1, le=RATE), AfterValidator(_divides_the_rate)]
    seconds: Positive
    shadow_size: Annotated[int, Field(ge=0, le=8192)]
    camera_distance: Positive
    camera_azimuth: float
    camera_elevation: Annotated[float, Field(ge=-90, le=90)]


class CompareParams(Block):
    """Statistics (see `jumping_ant.statistics` and `jumping_ant.comparison`)."""

    confidence: Annotated[float, Field(gt=0, lt=1)]
    bootstrap_samples: Annotated[int, Field(ge=100)]
    seed: Seed


class Params(Block):
    """The whole of `params.yaml`."""

    seeds: Annotated[list[Seed], Field(min_length=1)]
    robot: RobotParams
    env: EnvParams
    agents: Annotated[dict[AgentName, AgentParams], Field(min_length=1)]
    training: TrainingParams
    compute: ComputeParams
    evaluate: EvaluateParams
    record: RecordParams
    compare: CompareParams

    @field_validator("agents")
    @classmethod
    def _names_are_free(cls, agents: dict[str, Any]) -> dict[str, Any]:
        taken = sorted(RESERVED_NAMES & agents.keys())
        if taken:
            raise ValueError(f"{taken[0]!r} names a folder of results/; allowed: any other")
        return agents

    @model_validator(mode="after")
    def _seeds_differ(self) -> "Params":
        twice = sorted({seed for seed in self.seeds if self.seeds.count(seed) > 1})
        if twice:
            raise ValueError(f"seeds holds {twice[0]} more than once; each seed may stand once")
        return self

    def agent(self, name: str) -> AgentParams:
        """Return one agent's block.

        Raises:
            InputError: No agent has that name; the message lists those there are.
        """
        if name not in self.agents:
            raise InputError(f"agent: given {name!r}, allowed: {', '.join(self.agents)}")
        return self.agents[name]


def load(path: Path = PROJECT_ROOT / "params.yaml") -> Params:
    """Read and check a params file.

    Raises:
        InputError: The file is missing, is not YAML, or does not fit the models; one line a fault.
    """
    try:
        content = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path.name}: {error.strerror}: {path}") from error
    except (YAMLError, ValueError, RecursionError) as error:  # the latter from odd scalars, depth
        raise InputError(f"{path.name}: not YAML: {' '.join(str(error).split())}") from error
    return check(content, path.name)


def check(content: Any, where: str = "params.yaml") -> Params:
    """Check params given as plain dictionaries and lists.

    Args:
        content: What the YAML file holds.
        where: The file's name, for the messages.

    Raises:
        InputError: The content does not fit the models; one line a fault.
    """
    try:
        return Params.model_validate(content)
    except ValidationError as error:
        faults: dict[str, list[str]] = {}  # a union's members complain one by one of one fault
        for detail in error.errors():
            fault, allowed = _explain(detail)
            faults.setdefault(fault, []).append(allowed)
        texts = [f"{where}: {fault}{' or '.join(allowed)}" for fault, allowed in faults.items()]
        lines = [" ".join(text.splitlines()) for text in texts]  # a key may hold a line break
        raise InputError("\n".join(lines)) from error


def _explain(error: ErrorDetails) -> tuple[str, str]:
    """Say one validation error as: key and what was given; what is allowed."""
    # The discriminator's tag and a union's member names stand in the location too.
    parts = list(_keys(error["loc"]))
    key = ".".join(map(str, parts)) or "the file"
    if error["type"] == "extra_forbidden":
        names = list(_block_at(error["loc"][:-1]).model_fields)
        close = difflib.get_close_matches(str(parts[-1]), names, n=1)
        hint = f" (did you mean {close[0]!r}?)" if close else ""
        return f"{key}: unknown key{hint}; allowed: ", ", ".join(names)
    if error["type"] == "missing":
        return f"{key}: missing; it must be given", ""
    if error["type"] == "union_tag_invalid":
        given = _show(error["input"].get("algorithm"))
        return f"{key}.algorithm: given {given}, allowed: ", ", ".join(ALGORITHMS)
    if error["type"] == "union_tag_not_found":
        return f"{key}.algorithm: missing; allowed: ", ", ".join(ALGORITHMS)
    if error["type"] == "value_error":
        return f"{key}: {error['msg'].removeprefix('Value error, ')}", ""
    plain = error["msg"].removeprefix("Input should be ").removeprefix("a valid ")
    return f"{key}: given {_show(error['input'])}, allowed: ", ALLOWED.get(error["type"], plain)


def _show(given: Any) -> str:
    """Show a value, long ones by their beginning."""
    try:
        shown = repr(given)
    except ValueError:  # Python does not print whole numbers of thousands of digits
        shown = "a number too long to show"
    return shown if len(shown) <= 60 else shown[:57] + "..."


def _keys(location: tuple[int | str, ...]) -> Iterator[int | str]:
    """Yield the keys of a location in the file, without the names pydantic puts between them."""
    for depth, part in enumerate(location):
        is_tag = depth == 2 and location[0] == "agents"
        is_union_member = depth == 4 and isinstance(part, str)
        if not is_tag and not is_union_member and part != "[key]":
            yield part


def _block_at(location: tuple[int | str, ...]) -> type[Block]:
    """Return the model of the block at a location of a validation error."""
    if location[:1] == ("agents",):
        return ALGORITHMS[str(location[2])]
    model: type[Block] = Params
    for part in location:
        annotation = model.model_fields[str(part)].annotation
        model = cast(type[Block], annotation)
    return model
