"""Measures of a robot's motion: its jumps, and the fluidity of its joints' movements.

Fluidity is the spectral arc length (SPARC) of Balasubramanian, Melendez-Calderon, Roby-Brami and
Burdet 2015, "On the analysis of movement smoothness", J. NeuroEng. Rehab. 12:112: the negative
length of the movement's magnitude spectrum, drawn over frequency. The peak of the spectrum is
scaled to 1, so that strength has no effect. A rhythm has one short peak. Sudden or irregular
changes add peaks, which make the line longer. Closer to 0 is more fluid.

The paper measures the speed of single movements that start and end at rest. Three things differ
here, because a jumping robot moves back and forth without a pause:

- The spectrum is that of each joint's *signed* velocity. Speed, which is never negative, has its
  peak at 0 Hz whatever the joints do: by speed, random torques scored -2.0, better than torques
  along a sine of 2 Hz with -2.9. By signed velocities they score -4.4 and -3.6.
- Velocities are cut into windows of equal duration, as the arc length depends on it, and a Hann
  taper brings each window to rest at its ends. A rectangular window would add side lobes to the
  line.
- Windows without movement do not count. A robot that stands still has no fluidity (NaN).

Velocities are means over a control step: angle difference divided by duration. They are exact, and
have less aliasing than the velocities at the ends of the steps.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WINDOW_SECONDS = 2.0
MIN_SPEED = 1.0  # of a window that counts, mean over joints and time [joint ranges/s]
MAX_FREQUENCY = 10.0  # [Hz], as in the paper's reference implementation, which also has padding 4
MIN_AMPLITUDE = 0.05  # relative to the peak; the spectrum is cut where it stays below
PADDING = 4  # powers of two by which zero-padding refines the spectrum


def phases(mask: NDArray[np.bool_], min_length: float) -> NDArray[np.int64]:
    """Return where runs of true values of at least a minimum length begin and end, (num_runs, 2).

    Args:
        mask: Shape (T,).
        min_length: Minimum length of a run [elements].
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    runs = edges.reshape(-1, 2)
    return runs[runs[:, 1] - runs[:, 0] >= min_length - 1e-9]


def apex(heights: Array, jumps: NDArray[np.int64]) -> float:
    """Return the mean over jumps of the greatest height within each; 0 without any [m].

    Args:
        heights: Height at each control step [m], shape (T,).
        jumps: First step of each jump and the first one after it, shape (num_jumps, 2).
    """
    if len(jumps) == 0:
        return 0.0
    return float(np.mean([heights[start:end].max() for start, end in jumps]))


def fluidity(angles: Array, dt: float) -> float:
    """Return the mean spectral arc length of the windows in which the joints move.

    Args:
        angles: Joint angles over the joints' ranges, shape (T + 1, num_joints).
        dt: Duration of a step [s].

    Returns:
        A negative number, closer to 0 for fluid movement; NaN if there is no whole window with
        movement. Scaling the angles only changes which windows count as moving.
    """
    velocities = np.diff(angles, axis=0) / dt
    length = round(WINDOW_SECONDS / dt)
    count = len(velocities) // length
    windows = velocities[: count * length].reshape(count, length, angles.shape[1])
    moving = windows[np.abs(windows).mean(axis=(1, 2)) >= MIN_SPEED]
    return float(np.mean(_scores(moving, dt))) if len(moving) else float("nan")


def spectral_arc_length(signals: Array, dt: float) -> Array:
    """Return the spectral arc lengths (SPARC) of signals, none of which is zero throughout.

    It is -sum(hypot(df / F, dA)) over frequencies f, where A is the spectrum's amplitude over its
    peak (Balasubramanian et al. 2015). The sum runs from the first to the last frequency up to
    `MAX_FREQUENCY` where A is at least `MIN_AMPLITUDE`; F is their distance.

    Args:
        signals: Shape (..., T).
        dt: Duration of a step [s].

    Returns:
        Negative numbers without a unit, shape (...).
    """
    num_points = 2 ** (int(np.ceil(np.log2(signals.shape[-1]))) + PADDING)
    band = np.fft.rfftfreq(num_points, dt) <= MAX_FREQUENCY
    amplitudes = np.abs(np.fft.rfft(signals, num_points)[..., band])
    amplitudes /= amplitudes.max(axis=-1, keepdims=True)
    strong = amplitudes >= MIN_AMPLITUDE
    first = strong.argmax(axis=-1, keepdims=True)
    last = band.sum() - 1 - strong[..., ::-1].argmax(axis=-1, keepdims=True)
    steps = np.diff(amplitudes)
    number = np.arange(steps.shape[-1])
    across = 1 / np.maximum(last - first, 1)  # df / F
    return -np.hypot(across, steps).sum(axis=-1, where=(first <= number) & (number < last))


def _scores(velocities: Array, dt: float) -> Array:
    """Return the joints' mean arc length in each window, weighted by their mean square velocities.

    The velocities, (n, T, num_joints), are not zero throughout a window.
    """
    velocities = velocities / np.abs(velocities).max(axis=(1, 2), keepdims=True)
    weights = np.square(velocities).mean(axis=1)
    taper = np.hanning(velocities.shape[1] + 2)[1:-1]
    lengths = np.zeros_like(weights)
    moves = weights > 0
    lengths[moves] = spectral_arc_length(taper * velocities.transpose(0, 2, 1)[moves], dt)
    return np.asarray(np.average(lengths, axis=1, weights=weights))
