"""The blocks of `params.yaml`, except those of its agents.

Models reject unknown keys, check types strictly, and state the range of each number. The settings
of an agent are next to its algorithm (see `jumping_ant.agents.catalogue`), those of learners with
their library's defaults, which `params.yaml` may leave out.
"""

import difflib
import re
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, field_validator, model_validator

# Upper bounds keep physics and memory finite; they are far beyond what is useful.
Number = Annotated[float, Field(ge=-1e6, le=1e6)]
Positive = Annotated[float, Field(gt=0, le=1e6)]
NonNegative = Annotated[float, Field(ge=0, le=1e6)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=1, le=10**6)]
Steps = Annotated[int, Field(ge=1, le=10**10)]
Seed = Annotated[int, Field(ge=0, lt=2**31)]
SELECTION_EPISODES = 20  # first ones of validation: PGPE's best sample is chosen on them

GYMNASIUM_ROBOTS = {
    "ant": "ant.xml",
    "hopper": "hopper.xml",
    "walker2d": "walker2d_v5.xml",  # in the older file one foot is more slippery
    "half_cheetah": "half_cheetah.xml",
    "humanoid": "humanoid.xml",
}


def refusal(key: str, given: Any, allowed: Any) -> ValueError:
    """Return the error that refuses a value."""
    return ValueError(f"{key}: given {given}, allowed: {allowed}")


class Block(BaseModel):
    """A block of `params.yaml`: typed, without unknown keys, immutable."""

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False, use_attribute_docstrings=True
    )

    @model_validator(mode="before")
    @classmethod
    def _keys_are_known(cls, content: Any) -> Any:
        """Name the key that was meant, which pydantic does not."""
        for key in content if isinstance(content, dict) else ():
            if key not in cls.model_fields:
                close = difflib.get_close_matches(str(key), cls.model_fields, n=1)
                hint = f" (did you mean {close[0]!r}?)" if close else ""
                raise ValueError(
                    f"unknown key {str(key)[:60]!r}{hint}, allowed: {', '.join(cls.model_fields)}"
                )
        return content


def _is_a_source(source: str) -> str:
    if source not in GYMNASIUM_ROBOTS and not re.fullmatch(r"robots/[A-Za-z0-9_-]+\.xml", source):
        allowed = f"{', '.join(GYMNASIUM_ROBOTS)}, or a file robots/NAME.xml"
        raise ValueError(f"given {source!r}, allowed: {allowed}")
    return source


class RobotParams(Block):
    """A robot and its edits (see `jumping_ant.sim.robot`); null leaves a value as it is."""

    source: Annotated[str, AfterValidator(_is_a_source)]
    """A robot of Gymnasium (ant, hopper, walker2d, half_cheetah, humanoid), or robots/NAME.xml."""
    density: Positive | None
    """[kg/m^3] Density of every part (Gymnasium's Ant: 5). Half the density is half the mass."""
    gear: Positive | None
    """[N m] Peak torque of every motor (Gymnasium's Ant: 150)."""
    joint_gear: dict[str, Positive]
    """[N m] Overrides of `gear` by kind of joint (hip, ankle) or by joint (hip_1)."""
    torso_radius: Positive | None
    """[m] Radius of the geom `torso_geom` (Gymnasium's Ant: 0.25)."""
    leg_length: Positive | None
    """[-] Factor on the length of every segment except the torso."""
    damping: NonNegative | None
    """[N m s/rad] Damping of every hinge except the torso's (Gymnasium's Ant: 1)."""
    friction: Annotated[list[Positive], Field(min_length=3, max_length=3)] | None
    """[-, m, m] Sliding, torsional and rolling friction of every part and the floor (Gymnasium's
    Ant: 1, 0.5, 0.5); contacts of condim 3 only slide."""
    contact_margin: NonNegative | None
    """[m] Contact margin of parts and floor (Gymnasium's Ant: 0.01); two that meet add theirs."""
    edits: dict[str, dict[str, dict[str, bool | int | float | str | list[float]]]]
    """Any other MJCF attribute: {element: {name pattern: {attribute: value}}}."""


class TermParams(Block):
    """A term of the reward."""

    weight: Number
    """[1/step] Factor on the term; 0 switches it off."""


class TorsoHeightParams(TermParams):
    """The term for the torso's height: clip((height - floor) / span, 0, 1)."""

    floor: Number
    """[m] Torso height up to which the term is 0."""
    span: Positive
    """[m] Height above the floor at which the term saturates."""


class RewardParams(Block):
    """The reward per control step: the sum of its terms (see `jumping_ant.sim.rewards`).

    A term that is left out, or has the weight 0, does not count.
    """

    torso_height: TorsoHeightParams | None = None
    """Height of the torso, clipped to [0, 1]."""
    forward_velocity: TermParams | None = None
    """[m/s] Mean velocity of the torso along x."""
    alive: TermParams | None = None
    """1 unless the control step terminates the episode."""
    control_cost: TermParams | None = None
    """Minus the sum of the squared torques over peak torques."""
    upright: TermParams | None = None
    """Cosine of the torso's tilt: 1 upright, -1 on its back."""


Command = Annotated[list[Annotated[float, Field(ge=-1, le=1)]], Field(min_length=1)]


class EnvParams(Block):
    """The task (see `jumping_ant.sim.task`); null switches a limit off."""

    frame_skip: Count
    """[-] Simulation steps per control step."""
    reset_noise_scale: NonNegative
    """[-] Noise on the start state."""
    drop_height: Positive
    """[m] Height of the torso at starts in any orientation; no part may reach the floor."""
    max_episode_steps: Count
    """[control steps] Length at which an episode is truncated."""
    min_torso_height: Number | None
    """[m] An episode ends if the torso is below this height."""
    max_torso_height: Number | None
    """[m] An episode ends if the torso is above this height."""
    max_tilt: Positive | None
    """[rad] An episode ends if the torso tilts more than this."""
    commands: Annotated[list[Command], Field(min_length=1)]
    """[-] The table of commands: rows of torques over peak torque, in the actuators' order."""
    reward: RewardParams
    """The terms of the reward."""

    @field_validator("commands")
    @classmethod
    def _rows_are_alike(cls, commands: list[list[float]]) -> list[list[float]]:
        lengths = sorted({len(row) for row in commands})
        if len(lengths) > 1:
            given = f"rows of {lengths[0]} and of {lengths[-1]} torques"
            raise ValueError(f"given {given}, allowed: one per motor")
        return commands


class ActionParams(Block):
    """What an agent chooses from at each decision, and how long each choice is held."""

    kind: Literal["torques", "commands", "levels"]
    """Any torques, one of the commands of `env.commands`, or one of a few levels for each motor."""
    levels: Literal[2, 3] | None = Field(default=None, exclude_if=lambda levels: levels is None)
    """[-] Levels of each motor: -1 and 1, or -1, 0 and 1, times the amplitude; null otherwise."""
    amplitude: Annotated[float, Field(gt=0, le=1)]
    """[-] Factor on torques over peak torque; the article's commands have 0.5."""
    hold: Count
    """[control steps] How long each choice is held."""

    @model_validator(mode="after")
    def _levels_have_a_number(self) -> Self:
        if (self.kind == "levels") != (self.levels is not None):
            allowed = "2 or 3" if self.kind == "levels" else "none"
            raise ValueError(f"levels is {self.levels}, but kind {self.kind} takes {allowed}")
        return self


class TorqueParams(ActionParams):
    """The actions of agents that choose any torques."""

    kind: Literal["torques"]
    """Any torques."""


class CommandParams(ActionParams):
    """The actions of agents that choose among commands."""

    kind: Literal["commands"]
    """One of the commands of `env.commands`."""


class LevelParams(ActionParams):
    """The actions of agents that choose a level for each motor."""

    kind: Literal["levels"]
    """One of a few levels for each motor."""
    levels: Literal[2, 3]
    """[-] Levels of each motor: -1 and 1, or -1, 0 and 1, times the amplitude."""


class DemonstrationParams(Block):
    """Demonstrations of a trained agent (see `jumping_ant.training.demonstrating`)."""

    agent: str
    """The agent that demonstrates: a learner that chooses torques."""
    steps: Steps
    """[control steps] Minimum length of all its episodes together."""
    episode_steps: Count
    """[control steps] Its episodes are truncated here."""
    tumbled_starts: Fraction
    """[-] Share of its episodes that start in the air, in any orientation."""
    seed: Seed
    """Seed of the first episode; the others count up from it."""


class TrainingParams(Block):
    """Validation during training (see `jumping_ant.training.driver`)."""

    evaluations: Count
    """[-] Number of evaluations, spread evenly over the budget."""
    evaluation_episodes: Count
    """[-] Episodes per evaluation."""
    finalists: Count
    """[snapshots] At the end the best so many play more; the best mean of them is published."""
    finalist_episodes: Count
    """[-] Further episodes of each finalist."""
    evaluation_seed: Seed
    """Start of the first block: that of training seed s begins at so many episodes times s."""
    publish: Literal["best", "final"]
    """Which policy of a seed is its result: the best one by validation, or the last one."""

    def block(self, seed: int) -> range:
        """Return the seeds of a training seed's validation episodes."""
        size = max(self.evaluation_episodes + self.finalist_episodes, SELECTION_EPISODES)
        first = self.evaluation_seed + size * seed
        return range(first, first + size)


class ComputeParams(Block):
    """How the work is distributed; no result depends on it."""

    workers: Annotated[int, Field(ge=0, le=10_000)]
    """[processes] Seeds trained in parallel; 0 uses every core."""
    checkpoint_seconds: Positive
    """[s] Time between two checkpoints of a seed."""
    live_after_seconds: NonNegative
    """[s] Training time before MLflow shows curves live, which takes seconds to start."""


class EvaluateParams(Block):
    """Held-out episodes (see `jumping_ant.evaluation.evaluation`)."""

    episodes: Annotated[int, Field(ge=1, le=10_000)]
    """[-] For each seed, of learners and of the variants of their policies that claims are on."""
    baseline_episodes: Count
    """[-] For each seed, of baselines and of all other variants: the first of the seed's block."""
    seed: Seed
    """Start of the first block: that of training seed s begins at seed + episodes x s."""

    @model_validator(mode="after")
    def _blocks_hold_all_episodes(self) -> Self:
        if self.baseline_episodes > self.episodes:
            allowed = f"at most episodes, {self.episodes}"
            raise refusal("baseline_episodes", self.baseline_episodes, allowed)
        return self

    def block(self, seed: int) -> range:
        """Return the seeds of a training seed's held-out episodes, alike in every run."""
        first = self.seed + self.episodes * seed
        return range(first, first + self.episodes)


class RobustnessParams(Block):
    """Held-out episodes under perturbations (see `jumping_ant.sim.perturbations`)."""

    episode_steps: Count
    """[control steps] Episodes are truncated here."""


class RecordParams(Block):
    """Videos and recordings (see `jumping_ant.media`)."""

    width: Annotated[int, Field(ge=64, le=3840, multiple_of=2)]
    """[pixels] Width of the video."""
    height: Annotated[int, Field(ge=64, le=2160, multiple_of=2)]
    """[pixels] Height of the video."""
    fps: Annotated[int, Field(ge=1, le=240)]
    """[frames/s] Frame rate; a divisor of the simulation's rate, which is 100 for the Ant."""
    seconds: Positive
    """[s] Time filmed from the start of the episode."""


class CompareParams(Block):
    """Statistics (see `jumping_ant.comparison`)."""

    confidence: Annotated[float, Field(ge=0.5, le=0.9999)] = 0.95
    """[-] Confidence level of every interval."""
    bootstrap_samples: Annotated[int, Field(ge=100, le=10**6)]
    """[-] Bootstrap resamples for the interval of a statistic that has no formula."""
    margin: Positive
    """[-] The smallest difference in return of practical size, in comparisons of two runs or two
    settings; each claim has its own."""
    seed: Seed = 0
    """Seed of resamples and of random arrangements."""
