"""The layers that results rest on, from the C library to a short training of every algorithm.

Each layer is a digest of what it computes from fixed numbers, whatever params.yaml says. A layer
rests on those before it, so that the first one that differs between two machines is the cause.
"""

import hashlib
import math
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from itertools import chain
from typing import Any

import mujoco
import numpy as np
import torch
from matplotlib.figure import Figure
from numpy.typing import NDArray
from torch.nn import functional

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
Layer = tuple[str, Iterable[Any]]  # its name and its parts, which are computed as they are drawn

NUMBERS = 5000  # that functions are applied to
# (rows, inputs, outputs) of products: batches of networks' layers, and single observations.
SHAPES = ((256, 35, 256), (256, 256, 256), (256, 256, 8), (64, 27, 64), (16, 256, 256), (1, 27, 8))
PHYSICS_STEPS, EPISODE_STEPS = 10_000, 100
EPISODES = 16
FILM = RecordParams(width=160, height=120, fps=25, seconds=0.4)
VIEW = rendering.View(distance=4.0, azimuth=90.0, elevation=-15.0, shadow_size=256)


def layers() -> Iterator[Layer]:
    """Yield all layers, from the lowest."""
    use_portable_kernels()
    yield "C library: functions", _libm()
    yield "MuJoCo: steps", _physics()
    yield "MuJoCo: a batch, one thread", _batch(1)
    yield "MuJoCo: a batch, all threads", _batch(machine.num_cores())
    yield from _numpy_layers()
    yield from _torch_layers()
    for algorithm in ALGORITHMS:
        yield f"training: {algorithm}", map(_policy, [algorithm])
    yield "chart", _chart()
    yield "film", _film()


def digest(parts: Iterable[Any]) -> str:
    """Return the digest of a layer's parts: numbers, arrays, tensors or bytes."""
    total = hashlib.sha256()
    for part in parts:
        total.update(part if isinstance(part, bytes) else np.ascontiguousarray(part).tobytes())
    return total.hexdigest()


def renderer() -> str:
    """Return the name and the version of what draws films."""
    with gl.open_renderer(robot.load(_world().xml), FILM.width, FILM.height):
        # It binds to the library of the backend that MuJoCo has chosen, or else to one of a screen.
        from OpenGL import GL

        names = GL.glGetString(GL.GL_VERSION), GL.glGetString(GL.GL_RENDERER)
        return ", ".join(part.decode() for part in names)


@cache
def _numbers() -> Array:
    """Return fixed numbers of all sizes, made by exact operations alone."""
    state, numbers = 1, []
    for _ in range(NUMBERS):
        state = (6364136223846793005 * state + 1442695040888963407) % 2**64
        numbers.append(math.ldexp((state >> 11) - 2**52, -52 + state % 5))
    return np.array(numbers)


def _arrays() -> list[Array]:
    """Return the numbers in both precisions."""
    return [_numbers(), _numbers().astype(np.float32)]


def _factors() -> list[tuple[Array, Array]]:
    """Return the factors of products, all in one precision and then all in the other."""
    return [
        (np.resize(numbers, (rows, inputs)), np.resize(numbers[::-1], (inputs, outputs)))
        for numbers in _arrays()
        for rows, inputs, outputs in SHAPES
    ]


def _layer(name: str, *parts: Iterable[Any]) -> Layer:
    return name, chain(*parts)


def _applied(functions: Iterable[Callable[..., Any]], numbers: Iterable[Any]) -> Iterator[Any]:
    return (function(each) for each in numbers for function in functions)


def _libm() -> Iterator[Any]:
    numbers = _numbers().tolist()
    yield list(_applied((math.sin, math.cos, math.atan, math.tanh, math.exp), numbers))
    yield [math.log(abs(x)) + abs(x) ** 1.7 + math.acos(x / 32) for x in numbers]


@cache
def _world() -> World:
    return World(robot.build(article.ROBOT), article.ENV)


def _physics() -> Iterator[Any]:
    model = _world().model
    data, controls = mujoco.MjData(model), np.resize(_numbers() / 32, (PHYSICS_STEPS, model.nu))
    for number, control in enumerate(controls):
        if number % EPISODE_STEPS == 0:
            mujoco.mj_resetData(model, data)
        data.ctrl[:] = control
        mujoco.mj_step(model, data)
        yield from (data.qpos, data.qvel)


def _episodes(num_threads: int) -> list[Episode]:
    actions = ActionSet.of(ALGORITHMS["random"].example_agent().actions, _world().env.commands)
    policy = UniformPolicy(0, actions, _world().anatomy.num_motors)
    return rollout.run(_world(), policy, range(EPISODES), num_threads)


def _batch(num_threads: int) -> Iterator[Any]:
    for episode in _episodes(num_threads):
        yield from (episode.qpos, episode.qvel, episode.rewards)


def _numpy_layers() -> Iterator[Layer]:
    draw = np.random.default_rng(0)
    draws = (draw.standard_normal, draw.random, draw.standard_exponential, draw.permutation)
    yield "NumPy: generators", _applied(draws, [NUMBERS])
    arrays = _arrays()
    positive, tables = list(map(abs, arrays)), [each.reshape(50, -1) for each in arrays]
    yield _layer(
        "NumPy: functions",
        _applied((np.exp, np.tanh, np.sin, np.cos, np.arctan, np.expm1), arrays),
        _applied((np.log, np.sqrt, np.log1p), positive),
        (each**1.7 for each in positive),
        (np.arctan2(one, other) for one, other in [(arrays[0], positive[0])]),
    )
    yield _layer(
        "NumPy: sums",
        _applied((np.sum, np.mean, np.std, np.linalg.norm, np.cumsum, np.sort), arrays),
        (table.sum(axis) for table in tables for axis in (0, 1)),
        (np.einsum("ij,ij->i", table, table) for table in tables),
    )
    yield "NumPy: products", (one @ other for one, other in _factors())


def _torch_layers() -> Iterator[Layer]:
    draw = torch.Generator().manual_seed(0)
    draws = (torch.randn, torch.rand, torch.randperm)
    yield "PyTorch: generators", (kind(NUMBERS, generator=draw) for kind in draws)
    tensors = list(map(torch.from_numpy, _arrays()))
    positive, tables = list(map(abs, tensors)), [each.reshape(50, -1) for each in tensors]
    kinds = (torch.exp, torch.tanh, torch.sigmoid, torch.sin, torch.cos, torch.erf)
    yield _layer(
        "PyTorch: functions",
        _applied((*kinds, functional.softplus), tensors),
        _applied((torch.log, torch.sqrt, torch.log1p), positive),
        (functional.smooth_l1_loss(x, x.flip(0), reduction="none") for x in tensors),
        (each**1.7 for each in positive),
    )
    sums = (torch.sum, torch.mean, torch.std, torch.linalg.vector_norm, torch.logsumexp)
    yield _layer(
        "PyTorch: sums",
        (kind(table, dim=axis) for table in tables for kind in sums for axis in (0, 1)),
        (table.sum() for table in tables),
        (table.softmax(1) for table in tables),
    )
    pairs = [(torch.from_numpy(one), torch.from_numpy(other)) for one, other in _factors()]
    yield _layer(
        "PyTorch: products",
        (one @ other for one, other in pairs),
        (functional.linear(one, other.t(), other[0]) for one, other in pairs),
        (one @ other[:, 0].contiguous() for one, other in pairs),
    )
    yield "PyTorch: decompositions", _decompositions(tensors[1][:4096].reshape(64, 64))


def _decompositions(square: torch.Tensor) -> Iterator[Any]:
    positive = square @ square.t() + 1000 * torch.eye(64)
    yield from torch.linalg.qr(square)
    yield torch.linalg.cholesky(positive)
    yield from torch.linalg.eigh(positive)
    yield torch.linalg.matrix_exp(square / 1000)


def _policy(algorithm: str) -> bytes:
    """Return the policy that a short training ends with."""
    agent = ALGORITHMS[algorithm].example_agent()
    shown = demonstrations() if agent.learns_from_demonstrations else None
    *_, finished = trainer_of(agent)(Job(_world(), agent, seed=0, demonstrations=shown))
    assert isinstance(finished, Finished)
    return finished.policy


@cache
def demonstrations() -> bytes:
    """Return demonstrations of a policy that has hardly been trained."""
    content = _policy("ars")
    expert = policy_file.parse(content)
    played = play(_world(), expert, expert, list(range(10)), 60, 0.25)
    return Demonstrations(played, content).to_bytes()


def _chart() -> Iterator[bytes]:
    figure = Figure()
    figure.subplots().plot(_numbers()[:100], label="numbers")
    yield plotting.render(figure, "svg")
    yield plotting.render(figure, "png")


def _film() -> Iterator[Any]:
    trajectory = evaluation.replay(_world(), _episodes(1)[0], "random", 0, 0)
    yield from rendering.frames(_world().xml, trajectory, FILM, view=VIEW)
