"""Sums that come out the same to the last digit, however many threads the machine has.

numpy hands `a @ b` to BLAS, which splits long sums among threads: the order of addition, and so the
last digit, is then the machine's. Where a tie hangs on that digit, so do the suns. Sums of three
terms, as of colours and coordinates, are never split.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def weighted_sum(weight: Floats, values: Floats) -> Floats:
    """Sum of weight (n,) times values (n, ...) over n, in one order: (...)."""
    return np.einsum("n,n...->...", weight, values)
