"""Fully connected networks and their gradients, without a graph of operations.

PyTorch's autograd records every operation and allocates whatever it computes; for networks this
small that takes a third of the time. Here the same products are written out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import torch
from torch import Tensor, nn

_relu_backward = torch.ops.aten.threshold_backward.grad_input


@dataclass
class Pass:
    """What a forward pass leaves for the backward passes that belong to it.

    Whoever computes holds one for each use of a network, and hands it to both. Its memory serves
    the next forward pass of as many rows again, which overwrites what it holds.

    Attributes:
        activations: Inputs, and the outputs of each layer, shape (n, units) each.
    """

    activations: list[Tensor] = field(default_factory=list)

    def begin(self, inputs: Tensor, widths: Sequence[int]) -> list[Tensor]:
        """Return memory for the outputs of layers of such widths, shape (n, width) each."""
        buffers = self.activations[1:]
        if not buffers or len(buffers[0]) != len(inputs):
            buffers = [inputs.new_empty(len(inputs), width) for width in widths]
        self.activations = [inputs, *buffers]
        return buffers


class MLP:
    """Linear layers with ReLU between them: what `nn.Sequential` computes, and its gradients.

    It works on the layers' own parameters where they lie; they must not move in memory afterwards.

    Args:
        layers: The linear layers, first to last.
        relu_output: Whether the last layer's outputs pass through ReLU as well.
    """

    def __init__(self, layers: Sequence[nn.Linear], relu_output: bool = False) -> None:
        self._weights = [layer.weight.detach() for layer in layers]
        self._transposed = [weight.t() for weight in self._weights]
        self._biases = [layer.bias.detach() for layer in layers]
        self._gradients = [(layer.weight.grad, layer.bias.grad) for layer in layers]
        self._has_relu = [True] * (len(layers) - 1) + [relu_output]
        self._widths = [len(bias) for bias in self._biases]

    def forward(self, inputs: Tensor, kept: Pass) -> Tensor:
        """Return the outputs.

        Args:
            inputs: Shape (n, inputs).
            kept: Takes what the backward passes need.

        Returns:
            Shape (n, outputs), in the memory of `kept`.
        """
        for index, buffer in enumerate(kept.begin(inputs, self._widths)):
            torch.addmm(self._biases[index], inputs, self._transposed[index], out=buffer)
            inputs = buffer.relu_() if self._has_relu[index] else buffer
        return inputs

    def backward(self, gradient: Tensor, kept: Pass, to_inputs: bool = False) -> Tensor:
        """Write the loss's gradient by every parameter into its `grad`.

        Args:
            gradient: By the outputs of a forward pass, shape (n, outputs); may be overwritten.
            kept: What that pass left.
            to_inputs: Whether the gradient by the inputs is wanted too.

        Returns:
            The gradient by the inputs, shape (n, inputs), if wanted, else by the first layer.
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
        """Return the loss's gradient by the inputs alone, as if the parameters were constant.

        Args:
            gradient: By the outputs of a forward pass, shape (n, outputs). Rows of zeros cost
                nothing.
            kept: What that pass left.
            first: The gradient is returned by the inputs from this one on.

        Returns:
            Shape (n, inputs - first).
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
