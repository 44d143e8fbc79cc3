"""Formats of numbers and sentences, the same in all output."""

from typing import SupportsFloat


def number(value: SupportsFloat) -> str:
    """Return a number in readable form: 12,345, 123, 1.23, 0.00123."""
    exact = float(value)
    return f"{exact:,.0f}" if abs(exact) >= 100 else f"{exact:.3g}"


def interval(low: SupportsFloat, high: SupportsFloat, num_seeds: int) -> str:
    """Return an interval over seeds in readable form, [0.5, 1,230]; empty for one seed."""
    return f"[{number(low)}, {number(high)}]" if num_seeds > 1 else ""


def capitalized(text: str) -> str:
    """Return a text whose first letter is a capital one, as a sentence begins."""
    return f"{text[:1].upper()}{text[1:]}"


def percent(share: SupportsFloat) -> str:
    """Return a share in per cent, without the sign: 83."""
    return f"{100 * float(share):.0f}"


def percents(low: SupportsFloat, high: SupportsFloat) -> str:
    """Return an interval of a share in per cent, without the sign: 59-100."""
    return f"{percent(low)}\u2013{percent(high)}"


def p_value(value: SupportsFloat) -> str:
    """Return a p-value in readable form: 0.0023."""
    return f"{float(value):.2g}"


def estimate(value: SupportsFloat, low: SupportsFloat, high: SupportsFloat, num_seeds: int) -> str:
    """Return a number with its interval over seeds: 12.3 [4.56, 78.9]."""
    return f"{number(value)} {interval(low, high, num_seeds)}".rstrip()
