"""Fully connected networks and their gradients, without a graph of operations.

PyTorch's autograd records every operation and allocates every result; for networks this small that
takes a third of the time. This module computes the same products explicitly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import torch
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

    def begin(self, inputs: Tensor, widths: Sequence[int]) -> list[Tensor]:
        """Return buffers for the outputs of layers of these widths, shape (n, width) each."""
        buffers = self.activations[1:]
        if not buffers or len(buffers[0]) != len(inputs):
            buffers = [inputs.new_empty(len(inputs), width) for width in widths]
        self.activations = [inputs, *buffers]
        return buffers


class MLP:
    """Linear layers with ReLU between them: what `nn.Sequential` computes, and its gradients.

    It uses the layers' own parameters in place; they must not move in memory afterwards.
    """

    def __init__(self, layers: Sequence[nn.Linear], relu_output: bool = False) -> None:
        self._weights = [layer.weight.detach() for layer in layers]
        self._transposed = [weight.t() for weight in self._weights]
        self._biases = [layer.bias.detach() for layer in layers]
        self._gradients = [(layer.weight.grad, layer.bias.grad) for layer in layers]
        self._has_relu = [True] * (len(layers) - 1) + [relu_output]
        self._widths = [len(bias) for bias in self._biases]

    def forward(self, inputs: Tensor, kept: Pass) -> Tensor:
        """Return the outputs, (n, outputs), which lie in the memory of `kept`."""
        for index, buffer in enumerate(kept.begin(inputs, self._widths)):
            torch.addmm(self._biases[index], inputs, self._transposed[index], out=buffer)
            inputs = buffer.relu_() if self._has_relu[index] else buffer
        return inputs

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
            torch.mm(gradient.t(), kept.activations[index], out=by_weight)
            torch.sum(gradient, 0, out=by_bias)
            if index or to_inputs:
                gradient = gradient @ self._weights[index]
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
            gradient = gradient @ (weight if index else weight[:, first:])
        return result.index_copy_(0, rows, gradient)
