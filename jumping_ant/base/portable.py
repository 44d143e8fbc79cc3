"""The kernels of numerical libraries: everywhere those for AVX2, so that bytes are equal.

NumPy, OpenBLAS, PyTorch, oneDNN and llvmpipe choose their kernels by the processor, and wider ones
round differently, as do large products with more threads. Whatever imports this package uses one
thread for products, and the kernels of every x86-64 processor with AVX2 and FMA;
docs/how-it-works.md has what each switch is for. Libraries read these variables when they are first
used, so this module imports none.
"""

import os
import platform
from contextlib import suppress
from pathlib import Path

SWITCHES = {
    "ATEN_CPU_CAPABILITY": "avx2",
    "LP_NATIVE_VECTOR_WIDTH": "256",
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
    "ONEDNN_MAX_CPU_ISA": "AVX2",
    "OPENBLAS_CORETYPE": "Haswell",
    "OPENBLAS_NUM_THREADS": "1",
}
NEEDED = {"avx2", "fma"}  # flags in /proc/cpuinfo
UNSUPPORTED = (
    "this processor lacks AVX2 or FMA: equal parameters give other bytes here than elsewhere"
)
CPUINFO = Path("/proc/cpuinfo")


def is_supported() -> bool:
    """Return whether this processor computes what others do, to the byte."""
    flags: set[str] = set()
    with suppress(OSError):
        lines = CPUINFO.read_text(encoding="utf-8").splitlines()
        flags = next((set(line.split()) for line in lines if line.startswith("flags")), set())
    return platform.machine() == "x86_64" and flags >= NEEDED


def switch() -> None:
    """Select the kernels, in this process and its children, if the processor has them."""
    if is_supported():
        os.environ.update(SWITCHES)
