"""Samples that are redundant become one: pairwise clustering (section 3 of the paper).

Velho, Gomes, Sobreiro (1997) merge the pair (i, j) of least cost
    E = F_i F_j / (F_i + F_j) angle(c_i, c_j)^2   into   c = (F_i c_i + F_j c_j) / (F_i + F_j)
again and again. What merges here, and in which order, is what comparing all pairs each time gives,
for each frequency F. Each merge looks at all clusters once or twice: N^2 in all, not N^3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .settings import Frequency
from .sphere import angle_between
from .tolerances import NEGLIGIBLE, ROUNDING

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

WIDEST = np.pi / 2 * (1 + 1e-12)
"""Clusters as far apart or farther never merge, as antipodes have no mean; right angles may."""

NOBODY = 1e300
"""The cost of a pair that does not exist."""

FREE = -1.0
"""F of a place whose cluster has merged into another one."""

NEIGHBOURS = 8
"""How many neighbours of each sample a k-d tree finds to begin with."""

Narrowed = Callable[[Floats], Floats]
"""From unit vectors (..., 3) to parts, 0 to 1, (...)."""


@dataclass(frozen=True, eq=False)
class Clusters:
    """What became of n samples.

    label: index of each sample's cluster, (n,); clusters are numbered by their lowest samples.
    centres: unit vectors, (m, 3).
    """

    label: Indices
    centres: Floats


def merge(
    sites: Floats,
    energy: Floats,
    area: Floats,
    frequency: Frequency,
    nearer_than: float,
    down_to: int | None = None,
    narrowed: Narrowed | None = None,
) -> Clusters:
    """Merge all pairs nearer than an angle in radians, then go on until `down_to` are left.

    sites: unit vectors (n, 3). energy: integral of L over each sample's cell, (n,). area: of the
    cell, (n,), which only "mean" uses. Cheapest first, in both stages; of pairs that cost nothing
    the nearest first; of equals those of the least coordinates, so that the order of the samples
    does not matter. More than `down_to` are left where all are more than 90 degrees apart.
    narrowed: what part of `nearer_than` counts at a place; of two places the smaller.
    """
    if not (np.isfinite(energy).all() and np.all(energy >= 0)):
        raise ValueError("energy must be finite and not negative")
    order = np.lexsort((area, energy, *sites.T[::-1]))
    amount = np.ones(len(sites)) if frequency == "one" else energy[order].astype(np.float64)
    size = area[order].astype(np.float64) if frequency == "mean" else np.ones(len(sites))
    work = _Merging(sites[order], amount, size, frequency == "mean")
    work.run(min(nearer_than, WIDEST), 1, narrowed)
    if down_to is not None:
        work.run(WIDEST, down_to)
    owner = np.empty(len(sites), np.intp)
    owner[order] = work.owners()
    _, first, label = np.unique(owner, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    return Clusters(rank[label.reshape(-1)], work.centres(owner[np.sort(first)]))


class _Merging:
    """Clusters in arrays with a place for each; a cluster has the lowest place of its members.

    A pair belongs to its member of smaller F (of equal ones to the lower place): then it costs at
    least half of that F times the squared angle, however large the other F is, and only what is
    near needs to be looked at. `key` is the least cost of the pairs that belong to each place; it
    is exact until the `partner` merges, then a lower limit, until it is the least of all keys.
    """

    def __init__(self, sites: Floats, amount: Floats, size: Floats, size_adds: bool) -> None:
        count = len(sites)
        self.count, self.size, self.size_adds, self.reach = count, size, size_adds, 0.0
        self.narrowed: Narrowed | None = None
        self.at = np.ascontiguousarray(sites.T, dtype=np.float64)
        largest = np.divide(amount, size, out=np.zeros(count), where=size > 0).max(initial=0)
        # A power of two, so that nothing is rounded.
        self.amount = np.ldexp(amount, -np.frexp(largest)[1])
        self.f = np.array([_frequency(a, s) for a, s in zip(self.amount, size, strict=True)])
        self.member = np.arange(count)
        self.parent = np.arange(count)
        self.all_centres = np.array(sites, dtype=np.float64)
        self.version = np.zeros(count, np.intp)
        self.key = np.full(count, NOBODY)
        self.partner = np.full(count, -1)
        self.seen = np.full(count, -1)
        self.cosine = np.zeros(count)
        """A place may be interested in what has at least this cosine to it."""

    def owners(self) -> Indices:
        """The lowest sample of each sample's cluster."""
        owner = self.parent
        while (owner != owner[owner]).any():
            owner = owner[owner]
        return owner

    def centres(self, owner: Indices) -> Floats:
        self.pack()
        return self.all_centres[owner]

    def run(self, reach: float, down_to: int, narrowed: Narrowed | None = None) -> None:
        """Merge pairs nearer than an angle until so many clusters are left, or no such pair."""
        self.narrowed = narrowed
        if reach <= 0 or self.count <= max(down_to, 1):
            return
        self.pack()
        self.reach = reach
        self.begin()
        while self.count > down_to and (pair := self.cheapest()):
            self.join(*pair)
            if 8 * self.count < 7 * len(self.f):
                self.pack()

    def begin(self) -> None:
        """Keys of all places, from their nearest neighbours."""
        from scipy.spatial import cKDTree

        chord = 2 * np.sin(self.reach / 2) * (1 + 1e-9)
        asked = min(NEIGHBOURS + 1, self.count)
        tree = cKDTree(self.at.T)
        distance, other = tree.query(self.at.T, k=asked, distance_upper_bound=chord)
        place, column = np.nonzero(other < self.count)
        mine = self.belongs(other[place, column], place)
        place, column = place[mine], column[mine]
        cost = np.full(other.shape, NOBODY)
        cost[place, column] = self.cost(place, other[place, column])
        least = cost.min(axis=1)
        partner = np.where(cost == least[:, None], other, self.count).min(axis=1)
        # Pairs that were not found are at least as far apart as the last that was.
        all_found = ~np.isfinite(distance[:, -1]) | (asked == self.count)
        last = np.where(all_found, 0, distance[:, -1])
        limit = np.where(all_found, np.inf, _limit(self.f, last**2))
        self.point(np.arange(self.count), np.minimum(least, limit), -1)
        exact = np.flatnonzero((least < limit) & (least < NOBODY))
        self.point(exact, least[exact], partner[exact])

    def belongs(self, j: Indices, i: Indices | int) -> NDArray[np.bool_]:
        """Whether the pair of i and j belongs to i."""
        return (self.f[j] > self.f[i]) | ((self.f[j] == self.f[i]) & (j > i))

    def cost(self, i: Indices | int, j: Indices) -> Floats:
        """Cost of pairs, or minus one by the angle if they cost nothing; NOBODY out of reach."""
        angle = angle_between(self.at[:, i].T, self.at[:, j].T)
        low, high = np.minimum(self.f[i], self.f[j]), np.maximum(self.f[i], self.f[j])
        cost = low / (1 + low / np.maximum(high, NEGLIGIBLE)) * angle**2
        if not cost.all():
            with np.errstate(divide="ignore"):
                cost = np.where(cost > 0, cost, -1 / angle)
        reach = self.reach
        if self.narrowed:
            at = (self.narrowed(self.at[:, i].T), self.narrowed(self.at[:, j].T))
            reach = self.reach * np.minimum(*at)
        return np.where(angle < reach, cost, NOBODY)

    def point(self, i: Indices | int, key: Floats | float, partner: Indices | int) -> None:
        """Set keys; -1 for a partner that is not known."""
        self.key[i], self.partner[i], self.seen[i] = key, partner, self.version[partner]
        self.cosine[i] = 1 - np.minimum(_span(self.f[i], key), _chord2(self.reach)) / 2 - ROUNDING

    def cheapest(self) -> tuple[int, int] | None:
        """The pair of least cost, the lower place first; of equals the one of lowest places."""
        while (least := self.key.min(initial=NOBODY)) < NOBODY:
            equal = np.flatnonzero(self.key == least)
            partner = self.partner[equal]
            stale = equal[(partner < 0) | (self.version[partner] != self.seen[equal])]
            for i in stale:
                self.look_up(int(i))
            if len(stale):
                continue
            low, high = np.minimum(equal, partner), np.maximum(equal, partner)
            lowest = low.min()
            return int(lowest), int(high[low == lowest].min())
        return None

    def cosines(self, i: int) -> tuple[Floats, Floats]:
        """From place i to all others; then only to those of F as large, the rest far below -1."""
        dot = self.at[:, i] @ self.at
        dot[i] = -1
        # Half the time of np.where; subtracting 0 changes nothing.
        return dot, dot - 9.0 * (self.f < self.f[i])

    def look_up(self, i: int) -> None:
        """Make the key of place i exact."""
        _, dot = self.cosines(i)
        # The nearest one sets how far the best one may be.
        limit = self.cost(i, dot.argmax(keepdims=True))[0]
        span = min(float(_span(self.f[i], limit)), _chord2(self.reach))
        j = np.flatnonzero(dot >= 1 - span / 2 - ROUNDING)
        j = j[self.belongs(j, i)]
        cost = self.cost(i, j)
        best = cost.argmin() if len(j) else -1
        if len(j) and cost[best] < NOBODY:
            self.point(i, cost[best], j[best])
        else:
            self.point(i, NOBODY, -1)

    def join(self, i: int, j: int) -> None:
        """Merge place j into i < j, and tell those for whom the new cluster is a better partner."""
        self.at[:, i] = self.middle(i, j)
        self.amount[i] += self.amount[j]
        if self.size_adds:
            self.size[i] += self.size[j]
        self.f[i] = _frequency(self.amount[i], self.size[i])
        self.parent[self.member[j]] = self.member[i]
        self.f[j], self.key[j], self.cosine[j] = FREE, NOBODY, 2
        self.version[[i, j]] += 1
        self.count -= 1
        dot, larger = self.cosines(i)
        # The new cluster's own key can wait: few are the cheapest before they are merged again.
        nearest = 2 - 2 * larger.max()
        own = _limit(self.f[i], nearest) if nearest <= _chord2(self.reach) + ROUNDING else NOBODY
        self.point(i, own, -1)
        told = np.flatnonzero(dot >= self.cosine)
        told = told[self.belongs(i, told)]
        cost, key = self.cost(i, told), self.key[told]
        # Of equals the lowest partner; and below a stale one no place is as good.
        better = (cost < key) | ((cost == key) & (i <= self.partner[told]))
        self.point(told[better], cost[better], i)

    def middle(self, i: int, j: int) -> Floats:
        """Never more than 90 degrees apart, so the mean is at least 0.7 long."""
        a, b, both = self.at[:, i], self.at[:, j], self.f[i] + self.f[j]
        share = self.f[j] / both if both > 0 else 0.5
        if share in (0.0, 1.0):
            return (b if share else a).copy()
        mean = (1 - share) * a + share * b
        return mean / np.linalg.norm(mean)

    def pack(self) -> None:
        """Leave out the places that are free."""
        kept = self.f >= 0
        self.all_centres[self.member[kept]] = self.at[:, kept].T
        stale = (self.partner < 0) | (self.version[self.partner] != self.seen)
        self.seen[stale] = -1
        # A free place's number goes to the one below, for the comparison in `join`.
        place = np.append(np.cumsum(kept) - 1, -1)
        self.partner = place[self.partner]
        self.at = np.ascontiguousarray(self.at[:, kept])
        for name in ("amount", "size", "f", "member", "version", "key", "partner", "seen"):
            setattr(self, name, getattr(self, name)[kept])
        self.cosine = self.cosine[kept]


def _frequency(amount: float, size: float) -> float:
    f = amount / size if size > 0 else 0.0
    return f if f >= NEGLIGIBLE else 0.0


def _chord2(angle: float) -> float:
    return float(4 * np.sin(angle / 2) ** 2)


def _limit(f: Floats | float, chord2: Floats | float) -> Floats:
    """The least that pairs at a place of this F can cost from this squared chord on."""
    least = np.maximum(chord2 - ROUNDING, 0)
    with np.errstate(divide="ignore"):
        return np.where((f > 0) & (least > 0), f / 2 * least, -1 / np.sqrt(least))


def _span(f: Floats | float, key: Floats | float) -> Floats:
    """The largest squared chord of pairs at a place of this F that cost no more than a key."""
    with np.errstate(divide="ignore", over="ignore"):
        return np.where(key < 0, 1 / np.minimum(key, 0) ** 2, 2 * key / np.maximum(f, NEGLIGIBLE))
