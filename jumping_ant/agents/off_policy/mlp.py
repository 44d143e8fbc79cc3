"""Fully connected networks and their gradients, without a graph of operations.

PyTorch's autograd records every operation and allocates whatever it computes; for networks this
small that takes a third of the time. Here the same products are written out.
"""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

_relu_backward = torch.ops.aten.threshold_backward.grad_input


class MLP:
    """Linear layers with ReLU between them: what `nn.Sequential` computes, and its gradients.

    It works on the layers' own parameters where they lie; they must not move in memory afterwards.
    `forward` keeps what the backward passes need until the next `forward`, and returns a buffer
    that the next one overwrites.

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
        self._buffers: list[Tensor] = []
        self._activations: list[Tensor] = []

    def forward(self, inputs: Tensor) -> Tensor:
        """Return the outputs, shape (n, outputs), for inputs of shape (n, inputs)."""
        if not self._buffers or len(self._buffers[0]) != len(inputs):
            self._buffers = [inputs.new_empty(len(inputs), len(bias)) for bias in self._biases]
        self._activations = [inputs]
        for index, buffer in enumerate(self._buffers):
            torch.addmm(self._biases[index], inputs, self._transposed[index], out=buffer)
            inputs = buffer.relu_() if self._has_relu[index] else buffer
            self._activations.append(inputs)
        return inputs

    def backward(self, gradient: Tensor, to_inputs: bool = False) -> Tensor:
        """Write the loss's gradient by every parameter into its `grad`.

        Args:
            gradient: By the outputs of the last `forward`, shape (n, outputs); may be overwritten.
            to_inputs: Whether the gradient by the inputs is wanted too.

        Returns:
            The gradient by the inputs, shape (n, inputs), if wanted, else by the first layer.
        """
        for index in reversed(range(len(self._weights))):
            if self._has_relu[index]:
                _relu_backward(gradient, self._activations[index + 1], 0, grad_input=gradient)
            by_weight, by_bias = self._gradients[index]
            torch.mm(gradient.t(), self._activations[index], out=by_weight)
            torch.sum(gradient, 0, out=by_bias)
            if index or to_inputs:
                gradient = gradient @ self._weights[index]
        return gradient

    def input_gradient(self, gradient: Tensor, first: int = 0) -> Tensor:
        """Return the loss's gradient by the inputs alone, as if the parameters were constant.

        Args:
            gradient: By the outputs of the last `forward`, shape (n, outputs). Rows of zeros cost
                nothing.
            first: The gradient is returned by the inputs from this one on.

        Returns:
            Shape (n, inputs - first).
        """
        rows = gradient.any(1).nonzero().squeeze(1)
        result = gradient.new_zeros(len(gradient), self._weights[0].shape[1] - first)
        gradient = gradient[rows]
        for index in reversed(range(len(self._weights))):
            if self._has_relu[index]:
                activation = self._activations[index + 1][rows]
                _relu_backward(gradient, activation, 0, grad_input=gradient)
            weight = self._weights[index]
            gradient = gradient @ (weight if index else weight[:, first:])
        return result.index_copy_(0, rows, gradient)
