# SPDX-License-Identifier: GPL-3.0-or-later
"""Connected components of a graph that is given by its edges."""

import numpy as np


def labels(count, pairs):
    """(count,) intp: for each node the smallest node of its connected component. pairs: (p, 2), the edges."""
    result = np.arange(count)
    while True:
        pairs = pairs[result[pairs[:, 0]] != result[pairs[:, 1]]]
        if not len(pairs):
            return result
        one, other = result[pairs[:, 0]], result[pairs[:, 1]]
        # Any smaller label will do: the smallest one of a component is never replaced. np.minimum.at takes twice as
        # long at a million vertices.
        result[np.maximum(one, other)] = np.minimum(one, other)
        while (result != result[result]).any():
            result = result[result]
