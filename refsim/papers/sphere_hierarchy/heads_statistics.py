"""What heads do to the nodes that rays visit (BSH-E4). In: visits a ray with and without; out: `HeadStatistics`.

A head does not help every ray: beginning in the middle of a list bypasses the node whose escape would have skipped
more, so the mean falls while some rays visit more elements than before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class HeadStatistics(NamedTuple):
    """rays     how many
    without, with_heads  mean nodes a ray
    more, fewer          how many rays visit more nodes with heads, or fewer
    most_more            by how many at most, 0 if none does
    change               ascending differences that occur, i64[k], and how many rays have each, i64[k]
    """

    rays: int
    without: float
    with_heads: float
    more: int
    fewer: int
    most_more: int
    change: tuple[NDArray[np.int64], NDArray[np.int64]]

    @property
    def share_more(self) -> float:
        """The part of the rays that visit more nodes."""
        return self.more / self.rays if self.rays else 0.0


def head_statistics(without: NDArray[np.int32], with_heads: NDArray[np.int32]) -> HeadStatistics:
    """From nodes a ray, i32[n], without heads and with them (`Found.nodes`), of the rays that count."""
    change = with_heads.astype(np.int64) - without
    values, counts = np.unique(change, return_counts=True)
    before, after = (float(x.mean()) if len(x) else 0.0 for x in (without, with_heads))
    more, fewer, most = int((change > 0).sum()), int((change < 0).sum()), int(change.max(initial=0))
    return HeadStatistics(len(change), before, after, more, fewer, most, (values, counts.astype(np.int64)))
