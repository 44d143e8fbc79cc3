import numpy as np
import pytest
import torch
from evotorch import SolutionBatch
from evotorch.neuroevolution import GymNE
from evotorch.neuroevolution.net import RunningStat

from jumping_ant import params_file, policies
from jumping_ant.agents.evolution.problem import SOLUTION_LENGTH, JumpProblem
from jumping_ant.agents.evolution.trainer import train
from jumping_ant.env import JumpingAnt
from jumping_ant.events import Finished, Progress, Snapshot

PARAMS = params_file.load()
AGENT = PARAMS.agents["pgpe"].model_copy(
    update={"population_size": 6, "generations": 3, "episode_steps": 40}
)


def test_returns_are_those_of_gymne(robot_xml: str) -> None:
    """Same parameter vectors, start states and normaliser as EvoTorch's own Gymnasium problem."""
    generator = np.random.default_rng(0)
    seen = generator.normal(0.5, 2.0, (500, 27)).astype(np.float32)
    solutions = torch.from_numpy(generator.normal(0, 0.2, (6, SOLUTION_LENGTH))).float()

    problem = JumpProblem(robot_xml, PARAMS.env, AGENT, seed=10)
    for observation in seen:
        problem.normalizer.update(observation.copy())  # it keeps the first
    batch = SolutionBatch(problem, popsize=6)
    batch.set_values(solutions)
    problem.evaluate(batch)

    for index in range(6):

        def start_like_ours(seed: int = 10 + index) -> JumpingAnt:
            env = JumpingAnt(robot_xml, PARAMS.env)
            env.reset(seed=seed)  # a batch draws one episode when it is made
            return env

        reference = GymNE(
            start_like_ours,
            "Linear(obs_length, act_length)",
            observation_normalization=True,
            decrease_rewards_by=AGENT.decrease_rewards_by,
            episode_length=AGENT.episode_steps,
        )
        stats = RunningStat()
        for observation in seen:
            stats.update(observation)
        reference.set_observation_stats(stats)
        network = reference.parameterize_net(solutions[index])
        theirs = reference._rollout(policy=network, update_stats=False)["cumulative_reward"]
        assert float(batch.evals[index]) == np.float32(theirs)


def test_the_policy_scores_what_the_solution_scored(robot_xml: str) -> None:
    agent = AGENT.model_copy(update={"observation_normalization": False})
    problem = JumpProblem(robot_xml, PARAMS.env, agent, seed=0)
    batch = problem.generate_batch(6)
    problem.evaluate(batch)
    policy = problem.policy(batch[2].values)
    env = JumpingAnt(robot_xml, PARAMS.env)
    env.reset(seed=2)
    observation, _ = env.reset()
    total = 0.0
    for _ in range(agent.episode_steps):
        observation, reward, *_ = env.step(policy.act(observation[None])[0])
        total += reward
    assert problem.returns[2] == pytest.approx(total, rel=1e-3, abs=1e-6)


def test_the_seed_alone_determines_the_run(robot_xml: str) -> None:
    runs = [list(train(robot_xml, PARAMS.env, AGENT, seed, 3)) for seed in (1, 1, 2)]
    assert runs[0][-1].policy == runs[1][-1].policy
    assert runs[0][-1].policy != runs[2][-1].policy


def test_events_tell_the_run(robot_xml: str) -> None:
    events = list(train(robot_xml, PARAMS.env, AGENT, 0, evaluations=3))
    rows = [event for event in events if isinstance(event, Progress)]
    assert [row.updates for row in rows] == [1, 2, 3]
    assert [row.episodes for row in rows] == [6, 12, 18]
    assert rows[-1].env_steps <= AGENT.max_env_steps
    assert all(row.extra["return_best"] >= row.return_mean for row in rows)
    assert sum(isinstance(event, Snapshot) for event in events) == 3
    assert isinstance(events[-1], Finished)
    assert isinstance(policies.load(events[-1].policy), policies.LinearPolicy)
