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
    """Return the positions of the runs of true values that have at least a minimum length.

    Args:
        mask: Shape (T,).
        min_length: Minimum length of a run [elements].

    Returns:
        The first index of each run and the first one after it, shape (num_phases, 2).
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    runs = edges.reshape(-1, 2)
    return runs[runs[:, 1] - runs[:, 0] >= min_length - 1e-9]


def apex(heights: Array, jumps: NDArray[np.int64]) -> float:
    """Return the mean over jumps of the greatest height within each [m].

    Args:
        heights: Height at each control step [m], shape (T,).
        jumps: First step of each jump and the first one after it, shape (num_jumps, 2).

    Returns:
        The mean; without a jump the greatest height of all.
    """
    if len(jumps) == 0:
        return float(heights.max())
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
    starts = range(0, len(velocities) - length + 1, length)
    windows = [velocities[start : start + length] for start in starts]
    scores = [_score(window, dt) for window in windows if np.abs(window).mean() >= MIN_SPEED]
    return float(np.mean(scores)) if scores else float("nan")


def spectral_arc_length(signal: Array, dt: float) -> float:
    """Return the spectral arc length (SPARC) of a signal that is not zero throughout.

    It is -sum(hypot(df / F, dA)) over frequencies f, where A is the spectrum's amplitude over its
    peak (Balasubramanian et al. 2015). The sum runs from the first to the last frequency up to
    `MAX_FREQUENCY` where A is at least `MIN_AMPLITUDE`; F is their distance.

    Args:
        signal: Shape (T,).
        dt: Duration of a step [s].

    Returns:
        A negative number without a unit.
    """
    num_points = 2 ** (int(np.ceil(np.log2(len(signal)))) + PADDING)
    frequencies = np.fft.rfftfreq(num_points, dt)
    band = frequencies <= MAX_FREQUENCY
    amplitudes = np.abs(np.fft.rfft(signal, num_points))[band]
    amplitudes /= amplitudes.max()
    strong = np.flatnonzero(amplitudes >= MIN_AMPLITUDE)
    part = slice(strong[0], strong[-1] + 1)
    frequencies, amplitudes = frequencies[band][part], amplitudes[part]
    across = np.diff(frequencies) / (frequencies[-1] - frequencies[0])
    return -float(np.hypot(across, np.diff(amplitudes)).sum())


def _score(velocities: Array, dt: float) -> float:
    """Return the joints' mean arc length, each weighted by its mean square velocity.

    The velocities in one window, (T, num_joints), are not zero throughout.
    """
    velocities = velocities / np.abs(velocities).max()
    weights = np.square(velocities).mean(axis=0)
    taper = np.hanning(len(velocities) + 2)[1:-1]
    moving = np.flatnonzero(weights)
    lengths = [spectral_arc_length(taper * velocities[:, joint], dt) for joint in moving]
    return float(np.average(lengths, weights=weights[moving]))
