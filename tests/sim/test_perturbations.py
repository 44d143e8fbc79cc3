"""Environments that are perturbed: each in what its condition says, and in nothing else."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from small_policies import linear_policy

from jumping_ant.params import presets
from jumping_ant.params.model import Params
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import OpenLoopPolicy
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import perturbations, robot, rollout
from jumping_ant.sim.perturbations import NAMES, NONE, SENSING, Array, Condition
from jumping_ant.sim.rollout import Play
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World

START, STEPS = 9_000_000, 30
LEVELS = {
    "torso_mass": 0.7,
    "friction": 0.5,
    "gravity": 1.5,
    "slope": 30.0,
    "damping": 3.0,
    "motor_strength": 0.5,
    "observation_noise": 0.2,
    "lost_sensors": 0.5,
    "observation_delay": 2,
    "action_delay": 3,
    "push": 20.0,
}
# What each changes in the model, besides constants that MuJoCo derives from it.
CHANGED = {
    "torso_mass": {"body_mass", "body_inertia"},
    "friction": {"geom_friction"},
    "gravity": {"opt.gravity"},
    "slope": {"opt.gravity"},
    "damping": {"dof_damping"},
    "motor_strength": {"actuator_gear"},
}
DERIVED = {"body_subtreemass", "body_invweight0", "dof_invweight0", "dof_M0", "actuator_acc0"}
DERIVED |= {"light_poscom0", "cam_poscom0"}
CONDITIONS = {name: Condition(name, float(level)) for name, level in LEVELS.items()}


@pytest.fixture(scope="module")
def world(robot_xml: str, known_params: Params) -> World:
    return World(robot_xml, known_params.env.model_copy(update={"max_episode_steps": STEPS}))


@pytest.fixture(scope="module")
def policy() -> Policy:
    """Jumps, and sees: its torques depend on every observation."""
    return linear_policy()


def perturbed(world: World, *played: tuple[Condition, int]) -> RobotVectorEnv:
    conditions, starts = zip(*played, strict=True)
    return perturbations.environments(world, conditions, starts)


def returns(
    world: World, policy: Policy, *played: tuple[Condition, int], num_threads: int = 1
) -> Array:
    plays = [Play(policy, start, condition) for condition, start in played]
    return rollout.returns(world, plays, num_threads)


def fields(model: mujoco.MjModel) -> dict[str, Any]:
    """Return all numbers of a model, by field."""
    values = {name: getattr(model, name) for name in dir(model) if name[0] != "_"}
    values |= {f"opt.{name}": getattr(model.opt, name) for name in dir(model.opt) if name[0] != "_"}
    numbers = np.ndarray | int | float
    return {name: value for name, value in values.items() if isinstance(value, numbers)}


def changes(model: mujoco.MjModel, usual: mujoco.MjModel) -> set[str]:
    before, after = fields(usual), fields(model)
    return {name for name in before if not np.array_equal(before[name], after[name])}


@pytest.mark.parametrize("name", NAMES)
def test_a_perturbation_changes_its_part_of_the_model(world: World, name: str) -> None:
    """In its own simulation alone, beside one that is not perturbed."""
    envs = perturbed(world, (CONDITIONS[name], START), (NONE, START))
    assert changes(envs.batch.get_model(0), world.model) - DERIVED == CHANGED.get(name, set())
    assert not changes(envs.batch.get_model(1), world.model)


def test_levels_are_what_they_say(world: World) -> None:
    envs = perturbed(world, *((CONDITIONS[name], START) for name in CHANGED))
    models = {name: envs.batch.get_model(row) for row, name in enumerate(CHANGED)}
    model, torso = world.model, world.anatomy.torso
    heavy, light = models["torso_mass"].body_inertia[torso], model.body_inertia[torso]
    masses, frictions = model.body_mass.copy(), model.geom_friction.copy()
    assert heavy / light == pytest.approx(0.7 / masses[torso])
    masses[torso] = 0.7
    frictions[:, 0] *= 0.5
    assert np.array_equal(models["torso_mass"].body_mass, masses)
    assert models["friction"].geom_friction == pytest.approx(frictions)
    assert models["gravity"].opt.gravity == pytest.approx(1.5 * model.opt.gravity)
    assert np.linalg.norm(models["slope"].opt.gravity) == pytest.approx(9.81)
    assert models["slope"].opt.gravity[2] == pytest.approx(-9.81 * np.cos(np.pi / 6))
    assert models["damping"].dof_damping == pytest.approx(3 * model.dof_damping)
    assert models["motor_strength"].actuator_gear == pytest.approx(0.5 * model.actuator_gear)


def test_returns_depend_on_no_neighbour_and_no_thread(world: World, policy: Policy) -> None:
    starts = range(START, START + len(NAMES))
    played = [*zip(CONDITIONS.values(), starts, strict=True)]
    usual = [episode.total() for episode in rollout.run(world, policy, starts)]
    together = returns(world, policy, *played, (NONE, START), num_threads=2)
    assert together[:-1].tolist() == [returns(world, policy, each)[0] for each in played]
    assert together[-1] == pytest.approx(usual[0], abs=1e-12)
    assert (together[:-1] != usual).all(), "every perturbation matters"


def test_a_policy_that_sees_nothing_is_not_disturbed_by_its_sensors(world: World) -> None:
    table = np.array(world.env.commands, np.float32)[[3, 4]]
    blind = OpenLoopPolicy(ActionSet(table, hold=3))
    sensing = [name for name in SENSING if name != "action_delay"]
    played = [(NONE, START), *((CONDITIONS[name], START) for name in sensing)]
    assert len(set(returns(world, blind, *played))) == 1


def observed(world: World, played: Sequence[tuple[Condition, int]], steps: int) -> list[Array]:
    """Return what policies see, from the start on, while all motors push."""
    envs = perturbed(world, *played)
    seen = [envs.reset(seed=[start for _, start in played])[0]]
    seen += [envs.step(np.full((len(played), 8), 0.5))[0] for _ in range(steps)]
    return seen


def test_observations_come_late(world: World) -> None:
    seen = observed(world, [(CONDITIONS["observation_delay"], START), (NONE, START)], 5)
    for step, (late, current) in enumerate(seen):
        assert np.array_equal(late, seen[max(0, step - 2)][1])
        assert step == 0 or not np.array_equal(late, current)


def test_lost_sensors_read_zero_and_more_of_them_include_fewer(world: World) -> None:
    shares = (0.05, 0.5, 1.0)
    seen = observed(world, [(Condition("lost_sensors", share), START) for share in shares], 3)
    lost = (np.array(seen) == 0).all(axis=0)
    assert lost.sum(axis=1).tolist() == [1, 14, 27]
    assert (lost[0] <= lost[1]).all()


def test_noise_is_of_each_starts_own_and_grows_with_the_level(world: World) -> None:
    mild, strong = (Condition("observation_noise", level) for level in (0.1, 0.2))
    other = [(mild, START + 1), (NONE, START + 1)]
    seen = observed(world, [(mild, START), (strong, START), (NONE, START), *other], 300)
    noise = np.stack(seen, axis=1)[[0, 1, 3]] - np.stack(seen, axis=1)[[2, 2, 4]]
    assert noise[1] == pytest.approx(2 * noise[0], abs=1e-9)
    assert not np.allclose(noise[2], noise[0])
    positions = world.anatomy.num_observed_positions
    assert noise[0][:, :positions].std() == pytest.approx(0.1, rel=0.05)
    assert noise[0][:, positions:].std() == pytest.approx(1.0, rel=0.05)


def test_actions_arrive_late(world: World) -> None:
    envs = perturbed(world, (Condition("action_delay", 2.0), START))
    envs.reset(seed=[START])
    torques = np.random.default_rng(0).uniform(-1, 1, (5, 1, 8))
    arrived = []
    for chosen in torques:
        envs.step(chosen)
        arrived.append(envs.batch.bind("ctrl")[0] / world.anatomy.control_limits)
    expected = np.concatenate([np.zeros((2, 8)), torques[:-2, 0]])
    assert np.array(arrived) == pytest.approx(expected)


def test_pushes_last_a_control_step_of_each_second(world: World) -> None:
    envs = perturbed(world, (CONDITIONS["push"], START), (NONE, START))
    envs.reset(seed=[START, START])
    forces = []
    for _ in range(25):
        envs.step(np.zeros((2, 8)))
        forces.append(envs.batch.bind("xfrc_applied").copy())
    pushed = np.array(forces)
    torso = world.anatomy.torso
    strength = np.linalg.norm(pushed[:, 0, torso, :2], axis=1)
    assert strength == pytest.approx(20.0 * np.isin(np.arange(25), [0, 20]))
    pushed[:, 0, torso, :2] = 0
    assert not pushed.any(), "nothing else pushes"


def test_a_simulation_that_falls_apart_ends_alone(
    world: World,
    policy: Policy,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Motors that are much too strong; MuJoCo warns in its log alone."""
    monkeypatch.chdir(tmp_path)
    conditions = [Condition("motor_strength", 1e6), NONE]
    together = returns(world, policy, *((condition, START) for condition in conditions))
    assert np.isfinite(together).all()
    assert together[1] == returns(world, policy, (NONE, START))[0]
    assert "WARNING" not in "".join(capfd.readouterr())
    assert "WARNING" in (tmp_path / "MUJOCO_LOG.TXT").read_text(encoding="utf-8")
    assert mujoco.MjLogConfig.get().logto_console, "as before"


def test_a_robot_in_a_plane_is_perturbed_in_it() -> None:
    params = presets.load("hopper")
    hopper = World(robot.build(params.robot), params.env)
    envs = perturbed(hopper, *((CONDITIONS[name], START) for name in ("slope", "push")))
    envs.reset(seed=[START] * 2)
    envs.step(np.zeros((2, hopper.anatomy.num_motors)))
    pushed = envs.batch.bind("xfrc_applied")[1, hopper.anatomy.torso]
    assert [envs.batch.get_model(0).opt.gravity[1], pushed[1]] == pytest.approx([0, 0], abs=1e-12)
