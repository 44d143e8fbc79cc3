"""How numbers are put in words, everywhere alike."""

from typing import SupportsFloat


def number(value: SupportsFloat) -> str:
    """Return a number as people read it: 12,345, 123, 1.23, 0.00123."""
    exact = float(value)
    return f"{exact:,.0f}" if abs(exact) >= 100 else f"{exact:.3g}"
