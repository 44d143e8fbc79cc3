"""Adam on all parameters of an optimiser at once."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import torch
from torch import Tensor, nn

ALIGNMENT = 16  # [floats] a cache line; every parameter starts at a multiple of it


class FlatAdam:
    """Adam (Kingma and Ba 2015) on a single vector that holds all parameters of an optimiser.

    Parameters, gradients and the optimiser's state become views of vectors, so modules and state
    dictionaries always show the current values. The optimiser has one parameter group and has not
    stepped yet; its learning rate is read at every step.
    """

    def __init__(self, optimizer: torch.optim.Adam) -> None:
        (self._group,) = optimizer.param_groups
        parameters = self._group["params"]
        self.values = flatten(parameters)  # (n,)
        self.gradient = torch.zeros_like(self.values)  # of the loss, which `step` uses
        self._mean, self._mean_square = self.gradient.clone(), self.gradient.clone()
        self._step = torch.zeros(())
        vectors = (self.gradient, self._mean, self._mean_square)
        parts = zip(*(_parts(vector, parameters) for vector in vectors), strict=True)
        for parameter, (gradient, mean, mean_square) in zip(parameters, parts, strict=True):
            parameter.grad = gradient
            optimizer.state[parameter] = {
                "step": self._step,
                "exp_avg": mean,
                "exp_avg_sq": mean_square,
            }

    @property
    def vectors(self) -> dict[str, Tensor]:
        """All tensors that `step` modifies, by name."""
        moments = {"mean": self._mean, "mean_square": self._mean_square}
        return {"values": self.values, **moments, "step": self._step}

    def clip(self, max_norm: float) -> None:
        """Clip the gradient to a maximum norm."""
        norm = torch.linalg.vector_norm(self.gradient).item()
        if norm > max_norm:
            self.gradient.mul_(max_norm / norm)

    def step(self) -> None:
        """Update the parameters."""
        beta1, beta2 = self._group["betas"]
        self._step += 1
        torch._fused_adam_(  # what PyTorch's Adam calls if it is `fused`
            [self.values],
            [self.gradient],
            [self._mean],
            [self._mean_square],
            [],
            [self._step],
            lr=self._group["lr"],
            beta1=beta1,
            beta2=beta2,
            weight_decay=self._group["weight_decay"],
            eps=self._group["eps"],
            amsgrad=False,
            maximize=False,
        )


@contextmanager
def denormals_flushed() -> Iterator[None]:
    """Flush denormal numbers to zero on this thread.

    The gradients of a dead ReLU are zero, so Adam's moments of them shrink until they are denormal,
    and stay denormal: the smallest one times 0.9 is rounded to itself. Processors take up to a
    hundred times as long to compute with them, and Adam then takes longer than a network's pass.
    On a processor that cannot flush them, nothing changes.
    """
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(False)


def flatten(parameters: Sequence[nn.Parameter]) -> Tensor:
    """Move parameters into one vector, and return it; they become views of it."""
    values = torch.zeros(sum(_padded_sizes(parameters)), dtype=parameters[0].dtype)
    for parameter, part in zip(parameters, _parts(values, parameters), strict=True):
        part.copy_(parameter.detach())
        parameter.data = part
    return values


def _parts(vector: Tensor, parameters: Sequence[nn.Parameter]) -> list[Tensor]:
    """Return the part of a vector that belongs to each parameter, in the parameter's shape."""
    parts = vector.split(_padded_sizes(parameters))
    pairs = zip(parts, parameters, strict=True)
    return [part[: parameter.numel()].view(parameter.shape) for part, parameter in pairs]


def _padded_sizes(parameters: Sequence[nn.Parameter]) -> list[int]:
    return [-(-parameter.numel() // ALIGNMENT) * ALIGNMENT for parameter in parameters]
