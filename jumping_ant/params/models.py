"""The parameters: what `params.yaml` holds, block by block.

Every number of the pipeline lives in that file. Models are closed to unknown keys, strict about
types, and state the range of each number; `jumping_ant.params.params_file` reads and checks the
file.
"""

from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    field_validator,
    model_validator,
)

from jumping_ant.base.errors import InputError

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=1)]
Seed = Annotated[int, Field(ge=0, lt=2**31)]
RESERVED_NAMES = {"lineup"}  # of files in media/
AgentName = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]*$")]


RATE = 100  # [1/s] of the simulation's steps
FRAME_RATES = [number for number in range(1, RATE + 1) if RATE % number == 0]


def _divides_the_rate(fps: int) -> int:
    """Refuse a frame rate that would need a frame between two steps."""
    if fps not in FRAME_RATES:
        raise ValueError(f"given {fps}, allowed: {', '.join(map(str, FRAME_RATES))}")
    return fps


class Block(BaseModel):
    """A block of `params.yaml`: typed, closed to unknown keys, immutable."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        frozen=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
    )


class RobotParams(Block):
    """Edits of Gymnasium's Ant (see `jumping_ant.sim.robot`)."""

    density: Positive
    """[kg/m^3] Density of every part (Gymnasium's Ant: 5). Half of it is half the mass."""
    gear: Positive
    """[N m] Peak torque of every motor (Gymnasium's Ant: 150)."""
    joint_gear: dict[str, Positive]
    """[N m] Overrides of `gear` by kind of joint (hip, ankle) or by joint (hip_1)."""
    torso_radius: Positive
    """[m] Radius of the torso (Gymnasium's Ant: 0.25); its mass grows with the cube."""
    leg_length: Positive
    """[-] Factor on the length of every segment of the legs."""
    damping: NonNegative
    """[N m s/rad] Damping of every leg joint (Gymnasium's Ant: 1)."""
    friction: Positive
    """[-] Sliding friction of feet and floor (Gymnasium's Ant: 1)."""
    torsional_friction: Positive
    """[m] Torsional friction of feet and floor (Gymnasium's Ant: 0.5); condim 3 leaves it idle."""
    rolling_friction: Positive
    """[m] Rolling friction of feet and floor (Gymnasium's Ant: 0.5); condim 3 leaves it idle."""


class RewardParams(Block):
    """The reward for torso height (see `jumping_ant.sim.rewards`)."""

    floor: float
    """[m] Torso height that earns nothing."""
    span: Positive
    """[m] Height above the floor at which the reward saturates."""
    scale: Positive
    """[1/step] Reward at saturation, per control step."""


class EnvParams(Block):
    """The jumping task (see `jumping_ant.sim.env` and `jumping_ant.sim.vector`)."""

    frame_skip: Count
    """[-] Simulation steps of 0.01 s in a control step."""
    reset_noise_scale: NonNegative
    """[-] Noise on the start state."""
    max_episode_steps: Count
    """[control steps] An episode is truncated here."""
    min_torso_height: float
    """[m] An episode ends below this height of the torso."""
    reward: RewardParams
    """The reward per control step: scale * clip((height - floor) / span, 0, 1)."""


class AgentBlock(Block):
    """What all agents have in common."""

    robot: Literal["edited", "unedited"]
    """Which robot it moves: the one of `robot`, or Gymnasium's Ant as it comes."""


class ActionParams(Block):
    """What an agent chooses from at each decision, and how long a choice lasts."""

    kind: Literal["torques", "commands"]
    """Any torques, or one of the five commands (see `jumping_ant.sim.task`)."""
    amplitude: Annotated[float, Field(gt=0, le=1)]
    """[-] Largest torque over peak torque; the article's commands have 0.5."""
    hold: Count
    """[control steps] Each choice is held for."""


class TorqueParams(ActionParams):
    """The actions of agents that choose any torques."""

    kind: Literal["torques"]
    """Any torques."""


class CommandParams(ActionParams):
    """The actions of agents that choose among the five commands."""

    kind: Literal["commands"]
    """One of the five commands (see `jumping_ant.sim.task`)."""


class RandomAgentParams(AgentBlock):
    """The baseline that draws an action at every decision and learns nothing."""

    trainer: Literal["random"]
    """Package of jumping_ant/agents/ that trains the agent."""
    algorithm: Literal["random"]
    """What it trains."""
    actions: ActionParams
    """What it draws from."""

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps]: none."""
        return 0


class OpenLoopParams(AgentBlock):
    """The sceptic's baseline: a square wave between two commands, blind to the state."""

    trainer: Literal["open_loop"]
    """Package of jumping_ant/agents/ that trains the agent."""
    algorithm: Literal["open_loop"]
    """What it trains."""
    amplitude: Annotated[float, Field(gt=0, le=1)]
    """[-] Torque over peak torque of both commands; the article's commands have 0.5."""
    half_periods: Annotated[list[Count], Field(min_length=1)]
    """[control steps] Rhythms to try: how long each command is held."""
    episodes: Count
    """[-] Episodes that each rhythm is tried for."""
    episode_steps: Count
    """[control steps] Of each of them."""

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps], if no episode ends early."""
        return len(self.half_periods) * self.episodes * self.episode_steps


class OffPolicyParams(AgentBlock):
    """What DQN and SAC have in common, named as in Stable-Baselines3.

    A transition is a decision: with actions held for several control steps it takes as many.
    """

    trainer: Literal["off_policy"]
    """Package of jumping_ant/agents/ that trains the agent."""
    actions: ActionParams
    """What the agent chooses from."""
    total_steps: Count
    """[control steps] Training budget of a seed."""
    episode_steps: Count | None
    """[control steps] Training episodes are cut here; null never cuts them."""
    long_episodes: Fraction
    """[-] Share of the environments whose episodes last for `env.max_episode_steps` instead."""
    tumbled_starts: Fraction
    """[-] Share of the training episodes that start in the air, in any orientation."""
    num_envs: Count
    """[-] Simulations stepped at once."""
    learning_rate: Positive
    """[-] Of Adam, at the start."""
    final_learning_rate: NonNegative
    """[-] Of Adam, at the end; linear in between."""
    buffer_size: Count
    """[transitions] Replay memory."""
    learning_starts: Annotated[int, Field(ge=0)]
    """[transitions] Random actions before the first update."""
    batch_size: Count
    """[transitions] In a gradient step."""
    tau: Fraction
    """[-] Share of the online networks in an update of the target networks."""
    gamma: Fraction
    """[-] Discount of a reward one decision later."""
    n_steps: Count
    """[decisions] Of real reward before the bootstrap."""
    train_freq: Count
    """[decisions of each environment] From one round of updates to the next."""
    gradient_steps: Count
    """[-] Gradient steps in a round of updates."""
    net_arch: Annotated[list[Count], Field(min_length=1)]
    """[units] Hidden layers."""
    velocity_scale: Positive
    """[-] Factor on the velocities that the agent observes."""
    log_interval: Count
    """[transitions] From one row of the learning curve to the next."""

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps]."""
        return self.total_steps

    @model_validator(mode="after")
    def _budget_holds_a_round(self) -> "OffPolicyParams":
        round_steps = self.num_envs * self.train_freq * self.actions.hold
        if self.total_steps < round_steps:
            raise ValueError(
                f"total_steps is {self.total_steps}, but one round of num_envs x train_freq x "
                f"actions.hold takes {round_steps}"
            )
        return self

    @model_validator(mode="after")
    def _budget_exceeds_the_random_start(self) -> "OffPolicyParams":
        random_steps = self.learning_starts * self.actions.hold
        if self.total_steps <= random_steps:
            raise ValueError(
                f"total_steps is {self.total_steps}, but learning_starts x actions.hold takes "
                f"{random_steps}, after which it would begin to learn"
            )
        return self


class DQNParams(OffPolicyParams):
    """Deep Q-network on the five discrete commands (Mnih et al. 2015)."""

    algorithm: Literal["dqn"]
    """What is trained."""
    actions: CommandParams
    """What the agent chooses from: commands."""
    target_update_interval: Count
    """[transitions] From one target update to the next."""
    exploration_fraction: Annotated[float, Field(gt=0, le=1)]
    """[-] Share of the budget over which exploration decays."""
    exploration_initial_eps: Fraction
    """[-] Chance of a random command at the start."""
    exploration_final_eps: Fraction
    """[-] Chance of a random command after the decay."""
    max_grad_norm: Positive
    """[-] Gradients are clipped to this norm."""


class SACParams(OffPolicyParams):
    """Soft actor-critic on continuous torques (Haarnoja et al. 2018)."""

    algorithm: Literal["sac"]
    """What is trained."""
    actions: TorqueParams
    """What the agent chooses from: torques."""
    ent_coef: Positive | Literal["auto"]
    """[-] Weight of the policy's entropy, or `auto` to learn it."""


class PGPEParams(AgentBlock):
    """Policy gradients with parameter-based exploration (Sehnke et al. 2010), with ClipUp."""

    trainer: Literal["evolution"]
    """Package of jumping_ant/agents/ that trains the agent."""
    algorithm: Literal["pgpe"]
    """What it trains."""
    actions: TorqueParams
    """What the policies' outputs become: torques."""
    generations: Count
    """[-] Training budget of a seed."""
    population_size: Annotated[int, Field(ge=2, multiple_of=2)]
    """[policies] In a generation, in mirrored pairs."""
    episode_steps: Count
    """[control steps] That each policy is tried for."""
    center_learning_rate: Positive
    """[-] Length of a ClipUp step of the distribution's centre."""
    stdev_learning_rate: NonNegative
    """[-] Rate at which the distribution's width is learned."""
    stdev_init: Positive
    """[-] Width at the start."""
    max_speed: Positive
    """[-] Longest step of the centre."""
    momentum: Fraction
    """[-] Of ClipUp."""
    decrease_rewards_by: float
    """[1/step] Taken off the reward of every control step survived."""
    observation_normalization: bool
    """Whether observations are normalised by their running statistics."""

    @property
    def max_env_steps(self) -> int:
        """Budget of a seed [control steps], if no episode ends early."""
        return self.generations * self.population_size * self.episode_steps


ALGORITHMS: dict[str, type[Block]] = {
    "random": RandomAgentParams,
    "open_loop": OpenLoopParams,
    "dqn": DQNParams,
    "sac": SACParams,
    "pgpe": PGPEParams,
}

AgentParams = Annotated[
    RandomAgentParams | OpenLoopParams | DQNParams | SACParams | PGPEParams,
    Field(discriminator="algorithm"),
]


class TrainingParams(Block):
    """Validation while training (see `jumping_ant.training.driver`)."""

    evaluations: Count
    """[-] Spread evenly over the budget."""
    evaluation_episodes: Count
    """[-] In each of them."""
    evaluation_seed: Seed
    """Of the first episode; the others count up from it."""
    publish: Literal["best", "final"]
    """Which policy of a seed is its result: the best one by validation, or the last one."""


class ComputeParams(Block):
    """How the work is spread; no result depends on it."""

    workers: Annotated[int, Field(ge=0)]
    """[processes] Seeds trained at once; 0 takes every core."""
    checkpoint_seconds: Positive
    """[s] From one checkpoint of a seed to the next."""


class EvaluateParams(Block):
    """Held-out episodes (see `jumping_ant.judging.evaluation`)."""

    episodes: Count
    """[-] Held-out episodes for each seed."""
    seed: Seed
    """Of the first episode; the others count up from it."""
    min_airborne_seconds: NonNegative
    """[s] Off the ground for this long counts as a jump."""


class RecordParams(Block):
    """Videos and recordings (see `rendering` and `recording` in `jumping_ant.showing`)."""

    width: Annotated[int, Field(ge=64, le=3840, multiple_of=2)]
    """[pixels] Of the video."""
    height: Annotated[int, Field(ge=64, le=2160, multiple_of=2)]
    """[pixels] Of the video."""
    fps: Annotated[
        int,
        Field(ge=1, le=RATE, json_schema_extra={"enum": FRAME_RATES}),
        AfterValidator(_divides_the_rate),
    ]
    """[frames/s] A divisor of 100, the rate of the simulation."""
    seconds: Positive
    """[s] Filmed from the start of the episode."""
    shadow_size: Annotated[int, Field(ge=0, le=8192)]
    """[pixels] Of the shadow map; 0 draws no shadows."""
    camera_distance: Positive
    """[m] From the torso."""
    camera_azimuth: float
    """[degrees] Of the view."""
    camera_elevation: Annotated[float, Field(ge=-90, le=90)]
    """[degrees] Of the view; negative looks down."""


class CompareParams(Block):
    """Statistics (see `jumping_ant.judging.statistics` and `jumping_ant.judging.claims`)."""

    confidence: Annotated[float, Field(gt=0, lt=1)]
    """[-] Of every interval; what it lacks to 1 is the level of all claims together."""
    power: Annotated[float, Field(gt=0, lt=1)]
    """[-] Chance of a decision that the number of seeds an open claim needs is computed for."""
    bootstrap_samples: Annotated[int, Field(ge=100)]
    """[-] Resamples behind an interval of a statistic that has no formula."""
    seed: Seed
    """Of resamples and of random arrangements."""


class Params(Block):
    """The whole of `params.yaml`."""

    seeds: Annotated[list[Seed], Field(min_length=1, json_schema_extra={"uniqueItems": True})]
    """Training seeds: one run for each agent and seed. A seed is the unit of every statistic."""
    robot: RobotParams
    """Edits of Gymnasium's Ant."""
    env: EnvParams
    """The task: keep the torso high."""
    agents: Annotated[
        dict[AgentName, AgentParams],
        Field(min_length=1, json_schema_extra={"additionalProperties": False}),
    ]
    """The agents that are trained, evaluated, filmed and compared, by name."""
    training: TrainingParams
    """How learning curves are measured while training."""
    compute: ComputeParams
    """How the work is spread. No result depends on it."""
    evaluate: EvaluateParams
    """The held-out episodes, the same for every policy, with deterministic actions."""
    record: RecordParams
    """Each agent's median episode, as video and as Rerun recording."""
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
