# SPDX-License-Identifier: BSD-3-Clause
"""Compiled loops for medians of square windows; `medians.py` has other ways for NumPy.

Windows are inside of `padded` (rows, width) float32 without NaN; missing values are infinity. The
rank of the median among the sorted values of each window is known. Arrays are flat.
"""

from typing import Any

import numpy as np

from grid_map_core_py._loops import loop

LANES = 256
"""Windows that the network sorts at once, so that all their values fit the fastest cache."""

_WORD = 64  # bits
_ONE, _MASK = np.uint64(1), np.uint64(0xFFFFFFFF)

# Constants of a well-known way to count bits, which compilers replace by one instruction.
_PAIRS, _FOURS = np.uint64(0x5555555555555555), np.uint64(0x3333333333333333)
_BYTES, _ONES = np.uint64(0x0F0F0F0F0F0F0F0F), np.uint64(0x0101010101010101)
_BY_1, _BY_2, _BY_4, _BY_56 = (np.uint64(bits) for bits in (1, 2, 4, 56))


def _gather(padded: Any, start: int, width: int, side: int, used: int, lanes: Any) -> None:
    for y in range(side):
        for x in range(side):
            lane, place = (y * side + x) * LANES, start + y * width + x
            for i in range(used):
                lanes[lane + i] = padded[place + i]


@loop("float32*", "int64", "int64", "int64", "int32*", "int32*", "int64", "float32*", "float32*")
def sort_by_network(
    padded: Any,
    width: int,
    rows: int,
    side: int,
    ranks: Any,
    comparators: Any,
    count: int,
    lanes: Any,
    medians: Any,
) -> None:
    """Write medians (rows, width - side + 1) by a sorting network.

    Takes pairs of places to compare, and memory for `LANES` windows.
    """
    columns = width - side + 1
    for row in range(rows):
        for first in range(0, columns, LANES):
            used = min(LANES, columns - first)
            _gather(padded, row * width + first, width, side, used, lanes)
            for pair in range(count):
                low, high = comparators[2 * pair] * LANES, comparators[2 * pair + 1] * LANES
                for i in range(used):
                    one, other = lanes[low + i], lanes[high + i]
                    lanes[low + i] = one if one < other else other
                    lanes[high + i] = other if one < other else one
            place = row * columns + first
            for i in range(used):
                medians[place + i] = lanes[ranks[place + i] * LANES + i]


def _bits(word: Any) -> Any:
    """Return how many bits of a word are set."""
    word = word - ((word >> _BY_1) & _PAIRS)
    word = (word & _FOURS) + ((word >> _BY_2) & _FOURS)
    return np.int64((((word + (word >> _BY_4)) & _BYTES) * _ONES) >> _BY_56)


def _flip(words: Any, place: Any, current: Any) -> Any:
    """Add a value to a set, or remove it; return whether it is in a word before the current one."""
    word = np.int64(place) // _WORD
    words[word] ^= _ONE << np.uint64(place % _WORD)
    return word < current


def _place_of(words: Any, rank: Any, current: Any, before: Any) -> Any:
    """Return the place of the value of a rank, its word, and the number of values before that."""
    while before > rank:
        current -= 1
        before -= _bits(words[current])
    inside = _bits(words[current])
    while before + inside <= rank:
        before += inside
        current += 1
        inside = _bits(words[current])
    word = words[current]
    for _ in range(rank - before):
        word &= word - _ONE
    return current * _WORD + _bits(~word & (word - _ONE)), current, before


@loop("uint64*", "int64", "int64", "int64", "int32*", "int32*", "float32*", "uint64*", "float32*")
def slide_sets(
    keys: Any,
    width: int,
    rows: int,
    side: int,
    ranks: Any,
    places: Any,
    values: Any,
    words: Any,
    medians: Any,
) -> None:
    """Write medians (rows, width - side + 1) by sets of the values in a window.

    A set has one bit for each value of the array, in sorted order. From a window to the next one,
    only a column leaves and another one enters, and the median is a few bits further
    (J. Suomela, "Median Filtering is Equivalent to Sorting", 2014).

    Takes sorted keys: bits of values above their places in the array; and memory for places and
    values in sorted order, and for a set.
    """
    columns, size = width - side + 1, (rows + side - 1) * width
    for i in range(size):
        places[np.int64(keys[i] & _MASK)] = i
    for row in range(rows):
        for i in range((size + _WORD - 1) // _WORD):
            words[i] = np.uint64(0)
        # The number of values in words before the current one.
        current, before = 0, 0
        for column in range(columns):
            for y in range(side):
                start = (row + y) * width + column
                if column:
                    before -= _flip(words, places[start - 1], current)
                for x in range(side - 1 if column else 0, side):
                    before += _flip(words, places[start + x], current)
            cell = row * columns + column
            place, current, before = _place_of(words, np.int64(ranks[cell]), current, before)
            medians[cell] = values[place]
