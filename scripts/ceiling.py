"""Plan through the true simulator, to see how far the learners are from what the robot can do.

Usage: python -m scripts.ceiling [--actions ACTIONS ...] [--starts N]

From each of a few held-out starts, the cross-entropy method (Rubinstein 1999) plans the next
decisions, takes the first of the best plan, and plans again: model predictive control. Unlike a
policy it knows the simulator, but the robot does return as much, so the best possible return is no
less. Plans are of full torque forwards or backwards for every motor, or of the article's commands.
Writes results/ceiling.json, after each kind of actions; `make publish` then writes the learners'
shares of the way from the metronome to the plan into docs/results.md.
"""

import time
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from jumping_ant.actions import ActionSet
from jumping_ant.base import command_line, machine, output
from jumping_ant.base.errors import reported
from jumping_ant.base.files import PROJECT_ROOT, read_json, write_json
from jumping_ant.experiment import params_file
from jumping_ant.experiment.models import Params
from jumping_ant.looks import wording
from jumping_ant.params.blocks import ActionParams
from jumping_ant.sim import robot
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World

PATH = PROJECT_ROOT / "results" / "ceiling.json"
ACTIONS = {
    "torques": ActionParams(kind="levels", levels=2, amplitude=1.0, hold=3),
    "commands": ActionParams(kind="commands", amplitude=0.5, hold=3),
}
METRONOMES = {"torques": "metronome-full", "commands": "metronome"}  # of the same amplitude
STARTS = 4
HORIZON = 8  # [decisions] of a plan: longer than a jump
SAMPLES, ELITES, ROUNDS = 48, 6, 2  # plans per round, those that the next is drawn from, rounds
LEAST = 0.05  # probability of every option, so that each is still tried
SEED = 0  # of the plans


class Planner:
    """Plans of the next decisions, drawn from a distribution that the best plans improve."""

    def __init__(self, world: World, actions: ActionSet, generator: np.random.Generator) -> None:
        self._generator = generator
        self._envs = RobotVectorEnv(
            world, SAMPLES, machine.num_cores(), AutoresetMode.DISABLED, actions
        )
        self._shape = (HORIZON, *np.shape(self._envs.single_action_space.sample()))  # of a plan
        self._options = len(actions.table) if actions.table is not None else actions.levels or 0
        self._chances = np.full((*self._shape, self._options), 1 / self._options)
        self._best = self._draw(1)[0]

    def decide(self, state: dict[str, Any]) -> NDArray[Any]:
        """Return the first choice of the best plan from a state of a single environment."""
        highest = -np.inf
        for _ in range(ROUNDS):
            plans = np.concatenate([self._best[None], self._draw(SAMPLES - 1)])
            returns = self._play(plans, state)
            order = np.argsort(-returns, kind="stable")
            if (own := returns[order[0]]) > highest:
                highest, self._best = own, plans[order[0]]
            elite = plans[order[:ELITES], ..., None] == np.arange(self._options)
            self._chances = elite.mean(axis=0) * (1 - self._options * LEAST) + LEAST
        choice = self._best[0].copy()
        self._chances = np.roll(self._chances, -1, axis=0)  # what follows is planned anew
        self._chances[-1] = 1 / self._options
        self._best = np.concatenate([self._best[1:], self._draw(1)[0, -1:]])
        return choice

    def _draw(self, count: int) -> NDArray[np.int64]:
        """Draw plans: indices of options, shape (count, *plan)."""
        marks = self._generator.random((count, *self._shape, 1))
        return (marks > self._chances.cumsum(axis=-1)[..., :-1]).sum(axis=-1)

    def _play(self, plans: NDArray[np.int64], state: dict[str, Any]) -> NDArray[np.float64]:
        """Return what each plan returns from a state."""
        copies = {name: np.repeat(own, SAMPLES, axis=0) for name, own in state.items()}
        self._envs.load_state(copies)
        returns, alive = np.zeros(SAMPLES), np.ones(SAMPLES, dtype=np.bool_)
        for choices in np.moveaxis(plans, 1, 0):
            _, rewards, terminated, truncated, _ = self._envs.step(choices)
            returns += rewards * alive
            alive &= ~(terminated | truncated)
        return returns


def plan(world: World, actions: ActionSet, start: int) -> float:
    """Return the return of an episode that is planned from a start's seed."""
    planner = Planner(world, actions, np.random.default_rng([SEED, start]))
    env = RobotVectorEnv(world, 1, 1, AutoresetMode.DISABLED, actions)
    env.reset(seed=[start])
    total, has_ended = 0.0, False
    while not has_ended:
        _, rewards, terminated, truncated, _ = env.step(planner.decide(env.save_state())[None])
        total, has_ended = total + float(rewards[0]), bool(terminated[0] | truncated[0])
    return total


def shares(params: Params, agents: dict[str, Any], plans: dict[str, Any]) -> str:
    """Return the learners' shares of the way from the metronome to the plan, as Markdown.

    Args:
        params: The parameters, which tell each agent's actions.
        agents: What the comparison says of each agent.
        plans: The content of results/ceiling.json.
    """
    means = {name: own["return"]["mean"] for name, own in agents.items()}
    rows = []
    for name, mean in sorted(means.items(), key=lambda item: -item[1]):
        actions = getattr(params.agents.get(name), "actions", None)
        if actions is None or params.agents[name].is_baseline:
            continue
        kind = "commands" if actions.kind == "commands" and actions.amplitude <= 0.5 else "torques"
        least, most = means[METRONOMES[kind]], float(np.mean(plans[kind]["returns"]))
        share = round(100 * (mean - least) / (most - least))
        numbers = " | ".join(map(wording.number, (mean, least, most)))
        rows.append(f"| {name} | {numbers} | {share} % |")
    headings = ["| agent | mean return | metronome | plan | share of the way |", f"{'|---' * 5}|"]
    return "\n".join(headings + rows)


def main() -> None:
    """Parse the command line, plan and write."""
    parser = command_line.parser(__doc__)
    parser.add_argument("--actions", nargs="+", choices=ACTIONS, default=[*ACTIONS])
    parser.add_argument(
        "--starts", type=int, default=STARTS, help="held-out episodes, the first of as many seeds"
    )
    options = parser.parse_args()
    params = params_file.load()
    world = World(robot.build(params.robot), params.env)
    plans = read_json(PATH, "") if PATH.exists() else {}
    for name in options.actions:
        actions, began, returns = ActionSet.of(ACTIONS[name], params.env.commands), time.time(), []
        starts = [params.evaluate.block(seed)[0] for seed in params.seeds[: options.starts]]
        for start in starts:
            returns.append(plan(world, actions, start))
            print(f"{name}, start {start}: {returns[-1]:,.0f}", flush=True)
        plans[name] = {
            "starts": starts,
            "returns": returns,
            "horizon": HORIZON * actions.hold,
            "plans": SAMPLES * ROUNDS,
            "seconds": round(time.time() - began, 1),
        }
        write_json(PATH, plans)


if __name__ == "__main__":
    output.tolerate_failures()
    with reported():
        main()
