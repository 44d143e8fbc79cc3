"""PyTorch's kernels on the CPU, so that training computes the same on every processor.

PyTorch leaves matrix products and many functions to Intel's MKL, which computes by the processor's
maker. Its mode COMPATIBLE does not, but takes twice the time for products, and even there a square
root starts from an instruction that approximates, in each maker's own way. NumPy computes both from
the same memory: products on OpenBLAS with the kernels that `jumping_ant.base.portable` selects, in
no more time than MKL takes at its best, and square roots that are rounded correctly.
"""

import os
import warnings
from functools import cache

import numpy as np
import torch
from threadpoolctl import threadpool_limits
from torch import Tensor

from jumping_ant.base import machine


def use_portable_kernels() -> None:
    """Have PyTorch compute the same as anywhere, in this process, with one thread for products."""
    _replace()
    torch.set_num_threads(machine.BLAS_THREADS)
    threadpool_limits(machine.BLAS_THREADS, user_api="blas")


@cache  # once in a process
def _replace() -> torch.library.Library:
    """Register the kernels, whatever calls them; PyTorch drops them with what is returned."""
    os.environ["MKL_CBWR"] = "COMPATIBLE"  # for all else; MKL reads it when it first computes
    library = torch.library.Library("aten", "IMPL")
    kernels = {
        **dict.fromkeys(("mm", "bmm"), _product),
        **dict.fromkeys(("mm.out", "bmm.out"), _product_into),
        "addmm": _sum,
        "addmm.out": _sum_into,
        "sqrt": _root,
        "sqrt.out": _root_into,
        "sqrt_": lambda tensor: _root_into(tensor, out=tensor),
    }
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Warning only once for all operators")
        for name, kernel in kernels.items():
            library.impl(name, kernel, "CPU", allow_override=True)
    return library


def _product(first: Tensor, second: Tensor) -> Tensor:
    return torch.from_numpy(np.matmul(first.detach().numpy(), second.detach().numpy()))


def _product_into(first: Tensor, second: Tensor, *, out: Tensor) -> Tensor:
    out.resize_(*first.shape[:-1], second.shape[-1])
    np.matmul(first.detach().numpy(), second.detach().numpy(), out=out.detach().numpy())
    return out


def _sum(
    added: Tensor, first: Tensor, second: Tensor, *, beta: float = 1, alpha: float = 1
) -> Tensor:
    out = first.new_empty(len(first), second.shape[1])
    return _sum_into(added, first, second, beta=beta, alpha=alpha, out=out)


def _sum_into(
    added: Tensor, first: Tensor, second: Tensor, *, beta: float = 1, alpha: float = 1, out: Tensor
) -> Tensor:
    """Write beta * added + alpha * first @ second; `added` is broadcast, and may be `out`."""
    terms = added.detach().numpy()
    terms = terms if beta == 1 else beta * terms
    product = out.resize_(len(first), second.shape[1]).detach().numpy()
    if added.data_ptr() == out.data_ptr():
        terms = terms.copy()
    np.matmul(first.detach().numpy(), second.detach().numpy(), out=product)
    if alpha != 1:
        product *= alpha
    product += terms
    return out


def _root(tensor: Tensor) -> Tensor:
    return _root_into(tensor, out=torch.empty_like(tensor))


def _root_into(tensor: Tensor, *, out: Tensor) -> Tensor:
    np.sqrt(tensor.detach().numpy(), out=out.resize_(tensor.shape).detach().numpy())
    return out
