"""The layers that results rest on, from the C library to a short training of every algorithm.

Each layer is a digest of what it computes from fixed numbers, whatever params.yaml says. A layer
rests on those before it, so that the first one that differs between two machines is the cause.
"""

import hashlib
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache, partial
from typing import Any

import mujoco
import numpy as np
import torch
from matplotlib.figure import Figure
from numpy.typing import NDArray

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.agents.events import Finished
from jumping_ant.agents.imitation.demonstrations import Demonstrations, play
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.agents.kernels import use_portable_kernels
from jumping_ant.base import machine
from jumping_ant.evaluation import evaluation
from jumping_ant.media import plotting, rendering
from jumping_ant.params import article
from jumping_ant.params.blocks import RecordParams
from jumping_ant.policies import policy_file
from jumping_ant.policies.actions import ActionSet
from jumping_ant.policies.blind import UniformPolicy
from jumping_ant.sim import gl, robot, rollout
from jumping_ant.sim.rollout import Episode
from jumping_ant.sim.world import World

Array = NDArray[Any]

NUMBERS = 5000  # that functions are applied to
# (rows, inputs, outputs) of products: batches of networks' layers, and single observations.
SHAPES = ((256, 35, 256), (256, 256, 256), (256, 256, 8), (64, 27, 64), (16, 256, 256), (1, 27, 8))
PHYSICS_STEPS, EPISODE_STEPS = 10_000, 100
EPISODES = 16
FILM = RecordParams(width=160, height=120, fps=25, seconds=0.4)
VIEW = rendering.View(distance=4.0, azimuth=90.0, elevation=-15.0, shadow_size=256)


def layers() -> Iterator[tuple[str, Callable[[], str]]]:
    """Yield each layer's name, and the function that computes its digest."""
    yield "C library: functions", _libm
    yield "MuJoCo: steps", _physics
    yield "MuJoCo: a batch, one thread", partial(_batch, 1)
    yield "MuJoCo: a batch, all threads", partial(_batch, machine.num_cores())
    yield "NumPy: generators", _numpy_generators
    yield "NumPy: functions", _numpy_functions
    yield "NumPy: sums", _numpy_sums
    yield "NumPy: products", _numpy_products
    yield "PyTorch: generators", _torch_generators
    yield "PyTorch: functions", _torch_functions
    yield "PyTorch: sums", _torch_sums
    yield "PyTorch: products", _torch_products
    yield "PyTorch: decompositions", _torch_decompositions
    for algorithm in ALGORITHMS:
        yield f"training: {algorithm}", partial(_training, algorithm)
    yield "chart", _chart
    yield "film", _film


def _digest(parts: Iterable[Any]) -> str:
    total = hashlib.sha256()
    for part in parts:
        total.update(np.ascontiguousarray(part).tobytes())
    return total.hexdigest()


@cache
def _numbers() -> Array:
    """Return fixed numbers of all sizes, made by exact operations alone."""
    state, found = 1, []
    for _ in range(NUMBERS):
        state = (6364136223846793005 * state + 1442695040888963407) % 2**64
        found.append(math.ldexp((state >> 11) - 2**52, -52 + state % 5))
    return np.array(found)


@cache
def _pairs() -> list[tuple[Array, Array]]:
    """Return the factors of products."""
    fixed = _numbers()
    return [
        (np.resize(fixed, (rows, inputs)), np.resize(fixed[::-1], (inputs, outputs)))
        for rows, inputs, outputs in SHAPES
    ]


def _libm() -> str:
    functions = (math.sin, math.cos, math.atan, math.tanh, math.exp)
    found = [function(x) for x in _numbers().tolist() for function in functions]
    positive = [math.log(abs(x)) + abs(x) ** 1.7 + math.acos(x / 32) for x in _numbers().tolist()]
    return _digest([found, positive])


@cache
def _world() -> World:
    return World(robot.build(article.ROBOT), article.ENV)


def _physics() -> str:
    model = _world().model
    data, controls = mujoco.MjData(model), np.resize(_numbers() / 32, (PHYSICS_STEPS, model.nu))
    total = hashlib.sha256()
    for number, control in enumerate(controls):
        if number % EPISODE_STEPS == 0:
            mujoco.mj_resetData(model, data)
        data.ctrl[:] = control
        mujoco.mj_step(model, data)
        total.update(data.qpos.tobytes() + data.qvel.tobytes())
    return total.hexdigest()


def _episodes(num_threads: int) -> list[Episode]:
    world = _world()
    actions = ActionSet.of(ALGORITHMS["random"].example_agent().actions, world.env.commands)
    policy = UniformPolicy(0, actions, world.anatomy.num_motors)
    return rollout.run(world, policy, range(EPISODES), num_threads)


def _batch(num_threads: int) -> str:
    parts = [(own.qpos, own.qvel, own.rewards) for own in _episodes(num_threads)]
    return _digest(part for own in parts for part in own)


def _numpy_generators() -> str:
    generator = np.random.default_rng(0)
    kinds = (generator.standard_normal, generator.random, generator.standard_exponential)
    return _digest([*(kind(NUMBERS) for kind in kinds), generator.permutation(NUMBERS)])


def _numpy_functions() -> str:
    both = [_numbers(), _numbers().astype(np.float32)]
    kinds = (np.exp, np.tanh, np.sin, np.cos, np.arctan, np.expm1)
    found = [kind(numbers) for numbers in both for kind in kinds]
    positive = [abs(numbers) for numbers in both]
    found += [kind(own) for own in positive for kind in (np.log, np.sqrt, np.log1p)]
    return _digest([*found, *(own**1.7 for own in positive), np.arctan2(both[0], positive[0])])


def _numpy_sums() -> str:
    both = [_numbers(), _numbers().astype(np.float32)]
    kinds = (np.sum, np.mean, np.std, np.linalg.norm, np.cumsum, np.sort)
    tables = [own.reshape(50, -1) for own in both]
    return _digest(
        [*(kind(own) for own in both for kind in kinds)]
        + [own.sum(axis) for own in tables for axis in (0, 1)]
        + [np.einsum("ij,ij->i", own, own) for own in tables]
    )


def _numpy_products() -> str:
    use_portable_kernels()
    singles = [(one.astype(np.float32), other.astype(np.float32)) for one, other in _pairs()]
    return _digest(found for one, other in [*_pairs(), *singles] for found in (one @ other,))


def _torch_generators() -> str:
    generator = torch.Generator().manual_seed(0)
    kinds = (torch.randn, torch.rand)
    found = [kind(NUMBERS, generator=generator) for kind in kinds]
    return _digest([*found, torch.randperm(NUMBERS, generator=generator)])


def _both() -> list[torch.Tensor]:
    return [torch.from_numpy(_numbers()), torch.from_numpy(_numbers()).float()]


def _torch_functions() -> str:
    use_portable_kernels()
    softplus, huber = torch.nn.functional.softplus, torch.nn.functional.smooth_l1_loss
    kinds = (torch.exp, torch.tanh, torch.sigmoid, torch.sin, torch.cos, torch.erf, softplus)
    found = [kind(numbers) for numbers in _both() for kind in kinds]
    positive = [own.abs() for own in _both()]
    found += [kind(own) for own in positive for kind in (torch.log, torch.sqrt, torch.log1p)]
    found += [huber(own, own.flip(0), reduction="none") for own in _both()]
    return _digest([*found, *(own**1.7 for own in positive)])


def _torch_sums() -> str:
    kinds = (torch.sum, torch.mean, torch.std, torch.linalg.vector_norm, torch.logsumexp)
    tables = [own.reshape(50, -1) for own in _both()]
    found = [kind(own, dim=axis) for own in tables for kind in kinds for axis in (0, 1)]
    return _digest([*found, *(own.sum() for own in tables), *(own.softmax(1) for own in tables)])


def _torch_products() -> str:
    use_portable_kernels()
    doubles = [(torch.from_numpy(one), torch.from_numpy(other)) for one, other in _pairs()]
    pairs = [*doubles, *((one.float(), other.float()) for one, other in doubles)]
    layers = [torch.nn.functional.linear(one, other.t(), other[0]) for one, other in pairs]
    vectors = [one @ other[:, 0].contiguous() for one, other in pairs]
    return _digest([*(one @ other for one, other in pairs), *layers, *vectors])


def _torch_decompositions() -> str:
    use_portable_kernels()
    square = _both()[1][:4096].reshape(64, 64)
    positive = square @ square.t() + 1000 * torch.eye(64)
    return _digest(
        [
            *torch.linalg.qr(square),
            torch.linalg.cholesky(positive),
            *torch.linalg.eigh(positive),
            torch.linalg.matrix_exp(square / 1000),
        ]
    )


def _training(algorithm: str) -> str:
    agent = ALGORITHMS[algorithm].example_agent()
    demonstrations = _demonstrations() if agent.learns_from_demonstrations else None
    return _digest([np.frombuffer(_policy(algorithm, demonstrations), np.uint8)])


def _policy(algorithm: str, demonstrations: bytes | None = None) -> bytes:
    """Return the policy that a short training ends with."""
    use_portable_kernels()
    agent = ALGORITHMS[algorithm].example_agent()
    *_, finished = trainer_of(agent)(Job(_world(), agent, seed=0, demonstrations=demonstrations))
    assert isinstance(finished, Finished)
    return finished.policy


@cache
def _demonstrations() -> bytes:
    content = _policy("ars")
    expert = policy_file.parse(content)
    return Demonstrations(
        play(_world(), expert, expert, list(range(10)), 60, 0.25), content
    ).to_bytes()


def _chart() -> str:
    figure = Figure()
    figure.subplots().plot(_numbers()[:100], label="numbers")
    figures: Sequence[bytes] = [plotting.render(figure, "svg"), plotting.render(figure, "png")]
    return _digest(np.frombuffer(content, np.uint8) for content in figures)


def renderer() -> str:
    """Return the name and the version of what draws films."""
    with gl.open_renderer(robot.load(_world().xml), FILM.width, FILM.height):
        # It binds to the library of the backend that MuJoCo has chosen, or else to one of a screen.
        from OpenGL import GL

        told = GL.glGetString(GL.GL_VERSION), GL.glGetString(GL.GL_RENDERER)
        return ", ".join(part.decode() for part in told)


def _film() -> str:
    trajectory = evaluation.replay(_world(), _episodes(1)[0], "random", 0, 0)
    return _digest(rendering.frames(_world().xml, trajectory, FILM, view=VIEW))
