"""Order statistics of a stream: exact, by a few passes, in memory that does not grow with it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Keys = NDArray[np.uint64]

# Values that are kept and sorted: a megabyte.
_KEPT: Final = 2**17
_KEY_BITS: Final = 64
# Bits that a pass tells apart. The first sees sign, exponent and four bits of the mantissa of a float.
_PASS_BITS: Final = (16, 12, 12, 12, 12)


def order_statistics(passes: Callable[[], Iterable[Floats]], count: int, ranks: Sequence[int]) -> Floats:
    """Values that have these ranks among all, from 0 on; shape (ranks,).

    Args:
        passes: begins the stream anew; each time it gives the same values, none of them NaN.
        count: number of values.
        ranks: below `count`.

    The values are taken as keys of 64 bits in the same order. Each pass counts how many share their leading bits with
    a wanted one, and by the next bits (selection by radix); when few are left they are kept and sorted. Every
    distribution takes at most five passes, an ordinary one of 10^8 values three.
    """
    if not ranks:
        return np.empty(0)
    wanted = np.asarray(sorted(set(ranks)), dtype=np.int64)
    # Of each wanted value: its known leading bits, and its rank among the values that share them.
    leading = np.zeros(len(wanted), dtype=np.uint64)
    inside = wanted.copy()
    known, open_values = 0, count
    for bits in _PASS_BITS:
        if open_values <= _KEPT:
            break
        buckets = np.unique(leading)
        counts = np.zeros((len(buckets), 2**bits), dtype=np.int64)
        for values in passes():
            place, keys = _of_buckets(_keys(values), buckets, known)
            digit = _bits(keys, known, bits)
            flat = np.bincount(place * 2**bits + digit.astype(np.int64), minlength=counts.size)
            counts += flat.reshape(counts.shape)
        below = np.cumsum(counts, axis=1)
        row = np.searchsorted(buckets, leading)
        for k in range(len(wanted)):
            digit_k = int(np.searchsorted(below[row[k]], inside[k], side="right"))
            inside[k] -= below[row[k], digit_k - 1] if digit_k else 0
            leading[k] = (int(leading[k]) << bits) | digit_k
        known += bits
        chosen = {(int(r), int(lead) & (2**bits - 1)) for r, lead in zip(row, leading, strict=True)}
        open_values = sum(int(counts[place]) for place in chosen)
    if known < _KEY_BITS:
        leading = _sorted_out(passes, leading, inside, known)
    found = dict(zip(wanted.tolist(), _values(leading).tolist(), strict=True))
    return np.array([found[rank] for rank in ranks])


def _sorted_out(
    passes: Callable[[], Iterable[Floats]], leading: Keys, inside: NDArray[np.int64], known: int
) -> Keys:
    """Whole keys, from all values that share the leading bits of a wanted one."""
    buckets = np.unique(leading)
    kept = np.sort(np.concatenate([_of_buckets(_keys(values), buckets, known)[1] for values in passes()]))
    first = (
        np.searchsorted(_bits(kept, 0, known), leading) if known else np.zeros(len(leading), dtype=np.int64)
    )
    return np.asarray(kept[first + inside])


def _of_buckets(keys: Keys, buckets: Keys, known: int) -> tuple[NDArray[np.int64], Keys]:
    """Those of the keys whose leading bits are among the buckets, and the place of their bucket."""
    if not known:
        return np.zeros(len(keys), dtype=np.int64), keys
    lead = _bits(keys, 0, known)
    place = np.minimum(np.searchsorted(buckets, lead), len(buckets) - 1)
    mine = buckets[place] == lead
    return place[mine], keys[mine]


def _bits(keys: Keys, known: int, bits: int) -> Keys:
    """Bits after the first `known` ones."""
    shifted = keys >> np.uint64(_KEY_BITS - known - bits)
    return np.asarray(shifted & np.uint64(2**bits - 1)) if known else np.asarray(shifted)


_SIGN: Final = np.uint64(2**63)


def _keys(values: Floats) -> Keys:
    """Integers in the order of the values: a float of IEEE 754 with its sign bit turned, all bits of a negative one."""
    raw = np.ascontiguousarray(values, dtype=np.float64).view(np.uint64)
    return np.where(raw & _SIGN, ~raw, raw | _SIGN)


def _values(keys: Keys) -> Floats:
    return np.where(keys & _SIGN, keys & ~_SIGN, ~keys).view(np.float64)
