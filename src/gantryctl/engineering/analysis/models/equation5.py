"""Eq. (5) of the paper, in symbols and in the numbers of a machine file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from gantryctl.engineering.analysis.models.paper_loop import pairs
from gantryctl.engineering.analysis.models.rigid import RigidLoop

SYMBOLS: Final = (
    "y(s)              Kvf Kvp s^2 + (Kvf Kvp/Tvi + Kvp Kpp) s + Kpp Kvp/Tvi",
    "---- = ----------------------------------------------------------------------------",
    "r(s)   (Js/Kt) s^3 + Kvp s^2 + (Kvp/Tvi + Kvp Kpp) s + Kpp Kvp/Tvi       with Kt = 1",
)


def polynomial(coefficients: Sequence[float]) -> str:
    """A polynomial in s, highest power first: "1.898 s^3 + 77.7 s^2 + 8547 s + 7.77e+04"."""
    order = len(coefficients) - 1
    terms = []
    for power, value in zip(range(order, -1, -1), coefficients, strict=True):
        if value:
            terms.append(f"{value:.6g}" + {0: "", 1: " s"}.get(power, f" s^{power}"))
    return " + ".join(terms).replace("+ -", "- ") or "0"


def numbers(loop: RigidLoop) -> tuple[str, str, str]:
    """The fraction with its numbers, three lines."""
    top, bottom = polynomial(loop.position.num), polynomial(loop.position.den)
    width = max(len(top), len(bottom))
    return (
        f"y(s)   {top:^{width}}".rstrip(),
        f"---- = {'-' * width}",
        f"r(s)   {bottom:^{width}}".rstrip(),
    )


def as_dict(loop: RigidLoop) -> dict[str, Any]:
    """The same for a program: symbols, values, coefficients from the highest power down, poles and zeros in
    rad/s.
    """
    return {
        "symbols": list(SYMBOLS),
        "numbers": list(numbers(loop)),
        "js_kg_m2": loop.js_kg_m2,
        "kvp_nm_s_per_rad": loop.kvp_nm_s_per_rad,
        "tvi_s": loop.tvi_s,
        "kpp_per_s": loop.kpp_per_s,
        "kvf": loop.kvf,
        "numerator": list(loop.position.num),
        "denominator": list(loop.position.den),
        "poles": pairs(loop.position.poles),
        "zeros": pairs(loop.position.zeros),
    }
