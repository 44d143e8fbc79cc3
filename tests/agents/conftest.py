"""Trainings in this process compute as those of workers do: with one thread."""

import torch

from jumping_ant.base import machine

torch.set_num_threads(machine.BLAS_THREADS)
