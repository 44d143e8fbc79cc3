"""Fully connected networks and their gradients, without a graph of operations.

PyTorch's autograd records every operation and allocates every result; for networks this small that
takes a third of the time. This module computes the same products explicitly, by NumPy in the memory
of PyTorch's tensors: `jumping_ant.agents.kernels` does the same to PyTorch's own products, but each
takes PyTorch longer to dispatch than NumPy to compute, if it is small.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

_relu_backward = torch.ops.aten.threshold_backward.grad_input


@dataclass
class Pass:
    """Intermediate results of a forward pass, which its backward passes need.

    The caller keeps one for each use of a network, and passes it to both. The next forward pass
    with the same number of rows reuses and overwrites its memory.
    """

    # Inputs, and the outputs of each layer, (n, units) each.
    activations: list[Tensor] = field(default_factory=list)
    arrays: list[NDArray[Any]] = field(default_factory=list)  # the same memory, as NumPy sees it

    def begin(self, inputs: Tensor, widths: Sequence[int]) -> None:
        """Take inputs, and provide memory for the outputs of layers of these widths."""
        if not self.activations or len(self.arrays[0]) != len(inputs):
            self.activations = [inputs, *(inputs.new_empty(len(inputs), each) for each in widths)]
            self.arrays = [each.numpy() for each in self.activations]
        self.activations[0], self.arrays[0] = inputs, inputs.numpy()


class MLP:
    """Linear layers with ReLU between them: what `nn.Sequential` computes, and its gradients.

    It uses the layers' own parameters in place; they must not move in memory afterwards.
    """

    def __init__(self, layers: Sequence[nn.Linear], relu_output: bool = False) -> None:
        self._weights = [layer.weight.detach().numpy() for layer in layers]
        self._biases = [layer.bias.detach() for layer in layers]
        self._gradients = [
            (layer.weight.grad.numpy(), layer.bias.grad)
            for layer in layers
            if layer.weight.grad is not None
        ]
        self._has_relu = [True] * (len(layers) - 1) + [relu_output]
        self._widths = [len(bias) for bias in self._biases]

    def forward(self, inputs: Tensor, kept: Pass) -> Tensor:
        """Return the outputs, (n, outputs), which lie in the memory of `kept`."""
        kept.begin(inputs, self._widths)
        arrays, outputs = kept.arrays, inputs
        for index, weight in enumerate(self._weights):
            np.matmul(arrays[index], weight.T, out=arrays[index + 1])
            outputs = kept.activations[index + 1].add_(self._biases[index])
            if self._has_relu[index]:
                outputs.relu_()
        return outputs

    def backward(self, gradient: Tensor, kept: Pass, to_inputs: bool = False) -> Tensor:
        """Write the loss's gradient with respect to every parameter into its `grad`.

        `gradient` is with respect to the outputs, (n, outputs), and may be overwritten. The
        gradient that is returned is with respect to the inputs, (n, inputs), if `to_inputs`, else
        with respect to the first layer's outputs.
        """
        for index in reversed(range(len(self._weights))):
            if self._has_relu[index]:
                _relu_backward(gradient, kept.activations[index + 1], 0, grad_input=gradient)
            by_weight, by_bias = self._gradients[index]
            np.matmul(gradient.numpy().T, kept.arrays[index], out=by_weight)
            torch.sum(gradient, 0, out=by_bias)
            if index or to_inputs:
                gradient = _product(gradient, self._weights[index])
        return gradient

    def input_gradient(self, gradient: Tensor, kept: Pass, first: int = 0) -> Tensor:
        """Return the gradient with respect to the inputs from `first` on, (n, inputs - first).

        `gradient` is with respect to the outputs, (n, outputs); its rows of zeros cost nothing.
        """
        rows = gradient.any(1).nonzero().squeeze(1)
        result = gradient.new_zeros(len(gradient), self._weights[0].shape[1] - first)
        gradient = gradient[rows]
        for index in reversed(range(len(self._weights))):
            if self._has_relu[index]:
                activation = kept.activations[index + 1][rows]
                _relu_backward(gradient, activation, 0, grad_input=gradient)
            weight = self._weights[index]
            gradient = _product(gradient, weight if index else weight[:, first:])
        return result.index_copy_(0, rows, gradient)


def _product(gradient: Tensor, weight: NDArray[Any]) -> Tensor:
    return torch.from_numpy(np.matmul(gradient.numpy(), weight))
