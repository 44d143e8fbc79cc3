"""Evolution: EvoTorch's own problem and searches, on a batch of simulations."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import small_agents
import torch
from evotorch import Problem, SolutionBatch
from evotorch.neuroevolution import GymNE
from evotorch.neuroevolution.net import RunningStat

from jumping_ant.agents.events import Progress, Snapshot
from jumping_ant.agents.evolution.problem import JumpProblem, OscillatorProblem
from jumping_ant.agents.evolution.searchers import AugmentedRandomSearch, OpenAIES
from jumping_ant.agents.evolution.trainer import train
from jumping_ant.agents.job import Job
from jumping_ant.base.seeding import derive
from jumping_ant.params import params_file
from jumping_ant.params.blocks import ActionParams
from jumping_ant.policies import policy_file
from jumping_ant.policies.actions import ActionSet
from jumping_ant.sim.env import RobotEnv
from jumping_ant.sim.world import World

PARAMS = params_file.load()
AGENT = PARAMS.agents["pgpe"].model_copy(
    update={"population_size": 6, "generations": 3, "episode_steps": 40}
)


@pytest.mark.parametrize(
    ("kind", "hold", "amplitude", "decrease"),
    # GymNE takes something off every decision, not control step.
    [("torques", 1, 1.0, 1.0), ("torques", 3, 0.5, 0.0), ("commands", 3, 0.5, 0.0)],
)
def test_returns_are_those_of_gymne(
    monkeypatch: pytest.MonkeyPatch,
    robot_xml: str,
    kind: str,
    hold: int,
    amplitude: float,
    decrease: float,
) -> None:
    """Same parameter vectors, start states and normaliser as EvoTorch's own Gymnasium problem."""
    # A layer's product goes another way than ours (see `kernels`), which may round differently.
    monkeypatch.setattr("torch.nn.functional.linear", lambda x, w, b: torch.addmv(b, w, x))
    actions = ActionParams(kind=kind, hold=hold, amplitude=amplitude)
    num_outputs = 8 if kind == "torques" else len(PARAMS.env.commands)
    agent = AGENT.model_copy(update={"actions": actions, "decrease_rewards_by": decrease})
    task = PARAMS.env.model_copy(update={"max_episode_steps": agent.episode_steps})
    generator = np.random.default_rng(0)
    seen = generator.normal(0.5, 2.0, (500, 27)).astype(np.float32)
    solutions = torch.from_numpy(generator.normal(0, 0.2, (6, num_outputs * 28))).float()

    problem = JumpProblem(Job(World(robot_xml, PARAMS.env), agent, seed=10))
    for observation in seen:
        problem.normalizer.update(observation.copy())  # it keeps the first
    batch = SolutionBatch(problem, popsize=6)
    batch.set_values(solutions)
    problem.evaluate(batch)

    for index in range(6):

        def start_like_ours(seed: int = derive(10, "starts", index)) -> RobotEnv:
            actions = ActionSet.of(agent.actions, task.commands)
            env = RobotEnv(World(robot_xml, task), actions=actions)
            env.reset(seed=seed)  # a batch draws one episode when it is made
            return env

        reference = GymNE(
            start_like_ours,
            "Linear(obs_length, act_length)",
            observation_normalization=True,
            decrease_rewards_by=decrease,
            episode_length=agent.episode_steps,
        )
        stats = RunningStat()
        for observation in seen:
            stats.update(observation)
        reference.set_observation_stats(stats)
        network = reference.parameterize_net(solutions[index])
        theirs = reference._rollout(policy=network, update_stats=False)["cumulative_reward"]
        assert float(batch.evals[index]) == np.float32(theirs)


def test_control_steps_after_a_fall_cost_nothing(robot_xml: str) -> None:
    """Against a count of each control step, in episodes that end within a decision."""
    task = PARAMS.env.model_copy(update={"max_torso_height": 0.8, "min_torso_height": 0.5})
    actions = ActionParams(kind="torques", amplitude=1.0, hold=3)
    changes = {"actions": actions, "decrease_rewards_by": 1.0, "episode_steps": 40}
    world, agent = World(robot_xml, task), AGENT.model_copy(update=changes)
    solutions = torch.from_numpy(np.random.default_rng(0).normal(0, 0.2, (6, 8 * 28))).float()
    problem = JumpProblem(Job(world, agent, seed=1))
    batch = SolutionBatch(problem, popsize=6)
    batch.set_values(solutions)
    problem.evaluate(batch)
    lengths, fitness = [], []
    for index, solution in enumerate(solutions.numpy()):
        env, length, total, has_ended = RobotEnv(world), 0, 0.0, False
        env.reset(seed=derive(1, "starts", index))
        observation, _ = env.reset()
        while not has_ended and length < agent.episode_steps:
            if length % actions.hold == 0:
                torques = solution[:-8].reshape(8, 27) @ observation + solution[-8:]
            observation, reward, has_ended, _, _ = env.step(np.clip(torques, -1, 1))
            length, total = length + 1, total + float(reward)
        lengths.append(length)
        fitness.append(total - length)
    assert any(length % actions.hold for length in lengths)
    assert problem.env_steps == sum(lengths)
    assert batch.evals[:, 0].numpy() == pytest.approx(fitness, abs=1e-3)


SEEING: Any = AGENT.model_copy(update={"observation_normalization": False})
SCORED = [
    (OscillatorProblem, small_agents.agents()["oscillator"], 0.0),
    *(
        (JumpProblem, SEEING.model_copy(update={"actions": actions}), 1e-3)
        for actions in (
            ActionParams(kind="torques", amplitude=1.0, hold=1),
            ActionParams(kind="levels", levels=2, amplitude=1.0, hold=1),
            ActionParams(kind="levels", levels=3, amplitude=1.0, hold=1),
        )
    ),
]


@pytest.mark.parametrize(("problem_class", "agent", "rounding"), SCORED)
def test_a_policy_scores_what_its_solution_scored(
    robot_xml: str, problem_class: Any, agent: Any, rounding: float
) -> None:
    world = World(robot_xml, PARAMS.env)
    problem = problem_class(Job(world, agent, seed=0))
    batch = problem.generate_batch(agent.population_size)
    num_numbers = batch.values.shape[1]
    batch.access_values()[:] += torch.linspace(0.1, 1.5, num_numbers) / num_numbers
    problem.evaluate(batch)
    assert len(set(problem.returns)) == agent.population_size
    for index, score in enumerate(problem.returns):
        policy = problem.policy(batch[index].values, torch.zeros(num_numbers))
        env = RobotEnv(world)
        env.reset(seed=derive(0, "starts", index))  # a batch draws one episode when it is made
        observation, _ = env.reset()
        policy.start([0])
        total = 0.0
        for _ in range(agent.episode_steps):
            observation, reward, *_ = env.step(policy.act(observation[None])[0])
            total += reward
        assert score == pytest.approx(total, rel=rounding, abs=1e-3 * rounding)


def test_oscillators_have_the_frequencies_of_their_logarithms(robot_xml: str) -> None:
    """At 2 and 4 Hz and with decisions of 0.1 s: three of them above zero, and one below."""
    agent: Any = small_agents.agents()["oscillator"]
    actions = ActionParams(kind="torques", amplitude=1.0, hold=2)
    job = Job(World(robot_xml, PARAMS.env), agent.model_copy(update={"actions": actions}), seed=0)
    solution = torch.zeros(26)
    solution[:8], solution[8:16] = 1.0, 0.1 * torch.pi
    solution[-2:] = torch.tensor([1.0, 2.0])
    policy = OscillatorProblem(job).policy(solution, solution)
    policy.start([0])
    torques = np.array([policy.act(np.zeros((1, 27)))[0, 0] for _ in range(7)])
    angles = np.pi * np.array([0.1, 0.5, 0.9, 1.3, 2.1, 2.5, 2.9])
    np.testing.assert_allclose(torques, np.sin(angles), atol=1e-6)


def test_events_tell_the_run(robot_xml: str) -> None:
    events = list(train(Job(World(robot_xml, PARAMS.env), AGENT, 0, evaluations=3)))
    rows = [event for event in events if isinstance(event, Progress)]
    assert [row.updates for row in rows] == [1, 2, 3]
    assert [row.episodes for row in rows] == [6, 12, 18]
    assert all(row.extra["return_best"] >= row.return_mean for row in rows)
    assert sum(isinstance(event, Snapshot) for event in events) == 3
    policy: Any = policy_file.parse(events[-1].policy)
    spread = np.append(policy.weight_spread, policy.bias_spread)
    assert spread.mean() == pytest.approx(rows[-1].extra["stdev_mean"]) and spread.std() > 0


def problem_of(fitness: Callable[[np.ndarray], np.ndarray]) -> tuple[Problem, list[np.ndarray]]:
    """Return a problem of three numbers with a fitness, and the generations that it is to see."""
    seen: list[np.ndarray] = []

    def returns(values: torch.Tensor) -> torch.Tensor:
        seen.append(values.numpy().astype(np.float64))
        return torch.from_numpy(fitness(seen[-1])).float()

    bounds = {"solution_length": 3, "initial_bounds": (0, 0)}
    return Problem("max", returns, **bounds, vectorized=True, seed=0), seen


def returns_of(policies: np.ndarray) -> np.ndarray:
    return 3 * policies[:, 0] - policies[:, 1] ** 2


def test_random_search_takes_the_step_of_its_paper() -> None:
    """Mania, Guy and Recht 2018, algorithm 2, on returns that anyone can compute."""
    problem, seen = problem_of(returns_of)
    searcher = AugmentedRandomSearch(problem, popsize=8, learning_rate=0.25, delta_std=0.5, n_top=2)
    searcher.step()
    (policies,) = seen
    directions = policies[:4] / 0.5
    np.testing.assert_allclose(policies[4:], -policies[:4])
    forward, backward = np.split(returns_of(policies), 2)
    best = np.argsort(np.maximum(forward, backward))[-2:]
    deviation = np.concatenate([forward[best], backward[best]]).std()
    step = ((forward - backward)[best, None] * directions[best]).sum(0)
    expected = 0.25 / (2 * deviation) * step
    np.testing.assert_allclose(searcher.center.numpy(), expected, rtol=1e-5)
    for _ in range(20):
        searcher.step()
    assert searcher.center[0] > 1 and searcher.generation == 21


def test_openais_strategy_takes_the_step_of_its_paper() -> None:
    """Salimans et al. 2017: Adam on the gradient of ranks from -0.5 to 0.5, less the decay."""
    problem, seen = problem_of(lambda policies: np.exp(returns_of(policies)))
    searcher = OpenAIES(problem, popsize=8, learning_rate=0.25, noise_stdev=0.5, weight_decay=0.1)
    center = torch.zeros(3, dtype=torch.float64, requires_grad=True)
    adam = torch.optim.Adam([center], lr=0.25, maximize=True)
    for generation in range(6):
        searcher.step()
        policies = seen[generation]
        ranks = np.argsort(np.argsort(returns_of(policies))) / 7 - 0.5
        noise = (policies - center.detach().numpy()) / 0.5
        np.testing.assert_allclose(noise[:4], -noise[4:], atol=1e-5)
        gradient = (ranks[:, None] * noise).sum(axis=0) / (8 * 0.5)
        center.grad = torch.from_numpy(gradient) - 0.1 * center.detach()
        adam.step()
        np.testing.assert_allclose(searcher.center, center.detach(), rtol=1e-4, atol=1e-6)
    assert searcher.center[0] > 0.5 and searcher.generation == 6
