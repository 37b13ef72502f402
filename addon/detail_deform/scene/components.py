# SPDX-License-Identifier: GPL-3.0-or-later
"""What pairs of numbers hold together."""

import numpy as np


def least(count, pairs):
    """(count,) intp: for each number the least of those that pairs, (p, 2), join it to."""
    result = np.arange(count)
    while True:
        pairs = pairs[result[pairs[:, 0]] != result[pairs[:, 1]]]
        if not len(pairs):
            return result
        sides = result[pairs]
        np.minimum.at(result, sides.max(axis=1), sides.min(axis=1))
        while (result != result[result]).any():
            result = result[result]
