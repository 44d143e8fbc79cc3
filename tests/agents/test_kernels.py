"""PyTorch's kernels, replaced so that they compute the same on every processor."""

from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from jumping_ant.base import portable

FIRST, SECOND, ADDED = torch.randn(3, 40, 40, generator=torch.Generator().manual_seed(0))


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (FIRST, SECOND),
        (FIRST.t(), SECOND),
        (FIRST[:, 3:7], SECOND.t()[3:7]),
        (FIRST[:1], SECOND),
        (FIRST[:0], SECOND),
        (FIRST.double(), SECOND.double()),
    ],
)
def test_products_are_numpys_of_the_same_memory(first: Tensor, second: Tensor) -> None:
    expected = np.matmul(first.numpy(), second.numpy())
    np.testing.assert_array_equal(first @ second, expected)
    into = torch.full(expected.shape, torch.nan, dtype=first.dtype)
    assert torch.mm(first, second, out=into) is into
    np.testing.assert_array_equal(into, expected)
    np.testing.assert_array_equal(torch.bmm(first[None], second[None])[0], expected)


@pytest.mark.parametrize("scales", [{}, {"alpha": 0.5}, {"beta": 2.0}, {"alpha": -1, "beta": 3}])
@pytest.mark.parametrize("added", [ADDED, ADDED[0], ADDED[:1]])
def test_sums_are_pytorchs_up_to_rounding(scales: dict[str, Any], added: Tensor) -> None:
    expected = scales.get("beta", 1) * added + scales.get("alpha", 1) * (FIRST @ SECOND)
    torch.testing.assert_close(torch.addmm(added, FIRST, SECOND, **scales), expected)
    into = torch.full_like(FIRST, torch.nan)
    torch.testing.assert_close(torch.addmm(added, FIRST, SECOND, **scales, out=into), expected)
    if added is ADDED:  # the sum's own memory
        into = added.clone()
        torch.testing.assert_close(torch.addmm(into, FIRST, SECOND, **scales, out=into), expected)


def test_square_roots_are_rounded_correctly() -> None:
    squares = FIRST.abs()
    expected = np.sqrt(squares.numpy().astype(np.float64)).astype(np.float32)
    in_place, lists = squares.clone(), [squares.clone()]
    torch._foreach_sqrt_(lists)
    for roots in (squares.sqrt(), torch.sqrt(squares.t()).t(), in_place.sqrt_(), lists[0]):
        np.testing.assert_array_equal(roots, expected)


def test_gradients_flow_through_them() -> None:
    layer, inputs = nn.Linear(40, 3), FIRST.clone().requires_grad_()
    (layer(inputs) ** 2 + 1).sqrt().sum().backward()
    assert torch.autograd.gradcheck(
        lambda x, w, b: (torch.addmm(b, x, w) ** 2 + 1).sqrt(),
        [
            part.detach().double().requires_grad_()
            for part in (FIRST[:2], SECOND[:, :3], ADDED[0, :3])
        ],
    )
    assert layer.weight.grad is not None and inputs.grad is not None


@pytest.mark.skipif(not portable.is_supported(), reason="a processor with bytes of its own")
def test_libraries_use_the_kernels_that_every_processor_has() -> None:
    threadpoolctl = pytest.importorskip("threadpoolctl")
    blas = [pool for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"]
    assert {pool["architecture"] for pool in blas} == {"Haswell"}
    own = [pool for pool in blas if "numpy.libs" in pool["filepath"]]
    assert [pool["num_threads"] for pool in own] == [1]
    assert torch.backends.cpu.get_cpu_capability() == "AVX2"
    assert not np._core._multiarray_umath.__cpu_features__["X86_V4"]  # type: ignore[attr-defined]
