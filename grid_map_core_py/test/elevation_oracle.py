# SPDX-License-Identifier: BSD-3-Clause
"""Elevation mapping as its model describes it: slow, one point and one cell after the other.

Cells have integer places (i, j) in the world: i along x, j along y. Numbers are those of Python.
"""

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np


@dataclass
class Cell:
    height: float
    variance: float
    time: float
    support: int
    # Height, number of sightings and first time of what may become the surface.
    candidate: tuple[float, int, float] | None = None


@dataclass
class Cluster:
    """Points of a cell that agree, from the highest down."""

    points: list
    mean: float
    variance: float
    spread: float = 0.0


@dataclass
class Oracle:
    """A map of `size` cells; `origin` is the world cell with the smallest i and j on the map."""

    size: tuple[int, int]
    resolution: float
    origin: list[int]
    sensor: object
    threshold: float = 2.5
    min_variance: float = 9e-6
    max_variance: float = 0.01
    noise_of_conflicts: float = 9e-7
    conflicts: int = 0
    risen: int = 0
    time_variance: float = 0.0
    scanning_duration: float = 1.0
    conflict_points: int = 2
    min_support: float = 0.2
    max_ray_length: float = 10.0
    min_angle: float = 0.1
    enable_drift_compensation: bool = False
    drift_compensation_alpha: float = 0.1
    max_drift: float = 0.1
    inlier: float = 0.0025
    min_drift_cells: int = 100
    cells: dict[tuple[int, int], Cell] = field(default_factory=dict)
    exact: dict[tuple[int, int], tuple[float, float]] = field(default_factory=dict)
    pose: tuple | None = None
    noise: float = math.inf
    last: float | None = None

    def move(self, i: int, j: int) -> None:
        self.origin = [self.origin[0] + i, self.origin[1] + j]
        self.cells = {place: cell for place, cell in self.cells.items() if self.holds(place)}

    def holds(self, place: tuple[int, int]) -> bool:
        return all(0 <= place[k] - self.origin[k] < self.size[k] for k in (0, 1))

    def place(self, x: float, y: float) -> tuple[int, int]:
        # The upper borders of a cell belong to it.
        return math.ceil(x / self.resolution) - 1, math.ceil(y / self.resolution) - 1

    def update(self, points, transform, now, covariance=None):
        """Return the offset of the scan, and how many cells the visibility has cleared."""
        self.age(now, transform, covariance)
        sensor = np.array(transform[:3, 3], float)
        beams = self.located(points, transform, covariance)
        by_cell = {
            place: [(self.at_center(place, q, slopes), r) for q, r, _ in found]
            for place, found in self.by_cell(beams).items()
            for slopes in [self.slopes(place)]
        }
        clusters = {
            place: self.clusters(found, self.common(place, transform, covariance))
            for place, found in by_cell.items()
        }
        drift = self.drift(clusters)
        rest = (1 - self.drift_compensation_alpha) * drift
        for cell in self.cells.values():
            cell.height += self.drift_compensation_alpha * drift
        sensor[2] -= rest
        beams = [((x, y, z - rest), r, high - rest) for (x, y, z), r, high in beams]
        for found in clusters.values():
            for each in found:
                each.mean -= rest
                each.points = [((x, y, z - rest, c - rest), r) for (x, y, z, c), r in each.points]
        stale = self.stale(now)
        before = {place: cell.height for place, cell in self.cells.items()}
        outcomes = {
            place: self.fuse(place, found, sensor, place in stale, now, before)
            for place, found in clusters.items()
        }
        confirmed = [place for place, (_, _, is_confirmed) in outcomes.items() if is_confirmed]
        self.limit_variances(outcomes)
        tops = {p: max(q[3] for q, _ in found) - rest for p, found in by_cell.items()}
        gone = self.freed(beams, sensor, tops, self.stale(now), confirmed)
        for place in gone:
            del self.cells[place]
        if covariance is not None:
            self.noise = min(self.noise, covariance[2, 2])
        self.finish()
        return drift, len(gone)

    def located(self, points, transform, covariance):
        """Points in the map frame, with variance by the sensor, and height plus 3 deviations."""
        found = []
        for p in points:
            if not np.isfinite(p).all() or not np.any(p):
                continue
            r = self.variance_of(p, transform)
            if not math.isnan(r):
                r = max(r, 1e-12)
                q = [
                    sum(transform[k, m] * p[m] for m in range(3)) + transform[k, 3]
                    for k in range(3)
                ]
                way = np.array(q) - transform[:3, 3]
                found.append((tuple(q), r, q[2] + 3 * math.sqrt(r + self.shared(way, covariance))))
        return found

    def shared(self, way, covariance):
        """Variance of the height at a place relative to the sensor, by the pose of the scan."""
        if covariance is None:
            return 0.0
        x, y, z = way
        skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        row = -skew[2]
        height = min(self.noise, covariance[2, 2], self.share())
        return float(row @ covariance[3:, 3:] @ row) + height

    def share(self):
        return 0.25 * self.max_variance if self.max_variance > 0 else math.inf

    def common(self, place, transform, covariance):
        x, y = ((k + 0.5) * self.resolution for k in place)
        return self.shared(np.array([x, y, 0.0]) - transform[:3, 3], covariance)

    def by_cell(self, beams):
        found = {}
        for q, r, high in beams:
            place = self.place(q[0], q[1])
            if self.holds(place):
                found.setdefault(place, []).append((q, r, high))
        return found

    def stale(self, now):
        return {p for p, cell in self.cells.items() if now - cell.time >= self.scanning_duration}

    def freed(self, beams, sensor, tops, stale, confirmed):
        crossed, proofs = set(), {}
        guards = {}
        for place in confirmed:
            for near in around(place):
                guards[near] = min(self.foot(place), guards.get(near, math.inf))
        for q, _, top in beams:
            q = (*q[:2], top)
            for place, high, exit_height in self.crossed(sensor, q):
                is_reflected = exit_height < guards.get(place, -math.inf)
                if place in stale and high < self.foot(place):
                    crossed.add(place)
                    if self.proves(place, high, sensor, q, tops):
                        proofs[place] = min(high, proofs.get(place, math.inf))
                if is_reflected:
                    break
        standing = set(self.cells) - crossed
        return {place for place in proofs if not self.stands(place, proofs[place], standing)}

    def stands(self, place, high, standing):
        ground = min(self.cells[near].height for near in around(place) if near in self.cells)
        least = max(high, ground + 2 * self.resolution) - self.resolution
        return any(near in standing and self.foot(near) > least for near in around(place, 2))

    def foot(self, place):
        deviation = math.sqrt(self.cells[place].variance)
        return self.cells[place].height - max(3 * deviation, 0.4 * self.resolution)

    def slopes(self, place):
        """Rise per meter along x and y: the smaller difference from both neighbors, or 0."""
        return [
            self.slope(place, [place[0] - i, place[1] - j], [place[0] + i, place[1] + j])
            for i, j in ((1, 0), (0, 1))
        ]

    def slope(self, place, before, after):
        cells = [self.cells.get(tuple(p)) for p in (before, place, after)]
        if None in cells:
            return 0.0
        rises = [b.height - a.height for a, b in pairwise(cells)]
        for rise, (a, b) in zip(rises, pairwise(cells), strict=True):
            if abs(rise) <= self.threshold * math.sqrt(a.variance + b.variance):
                return 0.0
        if rises[0] * rises[1] <= 0:
            return 0.0
        return min(rises, key=abs) / self.resolution

    def at_center(self, place, q, slopes):
        """The point, and its height moved along the slope to the center of the cell."""
        away = [q[k] - (place[k] + 0.5) * self.resolution for k in (0, 1)]
        return (*q, q[2] - slopes[0] * away[0] - slopes[1] * away[1])

    def limit_variances(self, outcomes):
        """Raise variances to what the slope and the points of neighbors leave uncertain."""
        least = {p: self.least(p, chosen) for p, (chosen, _, seen) in outcomes.items() if seen}
        for place, (_, is_conflict, _) in outcomes.items():
            cell = self.cells[place]
            cell.variance = max(cell.variance, least.get(place, 0.0), self.min_variance)
            cell.variance += self.noise_of_conflicts * is_conflict

    def least(self, place, chosen):
        cell = self.cells[place]
        beside = [self.cells[p] for p in around(place) if p in self.cells]
        heights = [np.float32(each.height) for each in beside]
        rise = max(float(abs(height - np.float32(cell.height))) for height in heights)
        rise = min(rise, self.resolution)
        is_tail = cell.support < 0.1 * max(each.support for each in beside)
        least = max(rise**2 / (12 * cell.support), 4 * chosen.points[0][1] * is_tail)
        return min(least, self.share())

    def age(self, now, transform, covariance):
        if self.last is not None:
            for cell in self.cells.values():
                cell.variance += self.time_variance * (now - self.last)
        self.last = now
        if covariance is not None and self.pose is not None:
            added = self.motion(transform, covariance)
            for (i, j), cell in self.cells.items():
                x = (i + 0.5) * self.resolution - transform[0, 3]
                y = (j + 0.5) * self.resolution - transform[1, 3]
                row = np.array([1.0, y, -x])
                cell.variance += float(row @ added @ row)
        self.pose = None if covariance is None else (transform[:3, 3].copy(), covariance)

    def motion(self, transform, covariance):
        """Covariance of z, roll, pitch that the motion has added, its negative part left out."""
        position, old = self.pose
        way = transform[:3, 3] - position
        # Position and rotation of a pose that moves on: the rotation turns the way.
        skew = np.array([[0, -way[2], way[1]], [way[2], 0, -way[0]], [-way[1], way[0], 0]])
        carry = np.eye(6)
        carry[:3, 3:] = -skew
        # Only height and tilt count.
        pick = np.zeros((3, 6))
        pick[0, 2] = pick[1, 3] = pick[2, 4] = 1
        mask = pick.T @ pick
        added = pick @ (covariance - carry @ (mask @ old @ mask) @ carry.T) @ pick.T
        values, vectors = np.linalg.eigh(added)
        return sum(max(v, 0.0) * np.outer(u, u) for v, u in zip(values, vectors.T, strict=True))

    def variance_of(self, p, transform):
        third = transform[2, :3]
        spread = self.sensor(np.asarray(p, float))
        if spread is None:
            return math.nan
        return spread if isinstance(spread, float) else float(third @ spread @ third)

    def agrees(self, height, variance, z, r):
        gate = self.threshold * math.sqrt(variance + r)
        return abs(z - height) <= max(gate, 0.4 * self.resolution)

    def clusters(self, found, common):
        """Clusters from the highest down; `common` is the variance that their points share."""
        result = []
        for q, r in sorted(found, key=lambda each: (-each[0][3], each[1])):
            if not result or not self.agrees(result[-1].mean, result[-1].variance, q[3], r):
                result.append(Cluster([], 0.0, 0.0))
            members = result[-1].points
            members.append((q, r))
            weight = math.fsum(1 / r for _, r in members)
            result[-1].mean = math.fsum(q[3] / r for q, r in members) / weight
            result[-1].variance = 1 / weight
        for cluster in result:
            excess = self.excess(cluster)
            cluster.spread = excess * len(cluster.points)
            cluster.variance += min(excess, self.share()) + common
        return result

    def excess(self, cluster):
        """Variance of the mean by which its points spread more than their noise."""
        others = len(cluster.points) - 1
        if not others:
            return 0.0
        ratio = math.fsum((q[3] - cluster.mean) ** 2 / r for q, r in cluster.points) / others
        is_chance = ratio <= 1 + self.threshold * math.sqrt(2 / others)
        return 0.0 if is_chance else (ratio - 1) * cluster.variance

    def fuse(self, place, clusters, sensor, is_stale, now, before):
        """Fuse the clusters of a cell; return the one that counts, and what became of the cell."""
        densest = max(len(each.points) for each in clusters)
        least = max(self.conflict_points, self.min_support * densest)
        supported = [each for each in clusters if len(each.points) >= least]
        surface = supported[0] if supported else None
        cell = self.cells.get(place)
        chosen, is_conflict, is_confirmed = surface or clusters[0], False, True
        if cell is None:
            support = len(chosen.points)
            cell = self.cells[place] = Cell(chosen.mean, chosen.variance, now, support)
        else:
            chosen, is_conflict, is_confirmed = self.update_cell(
                cell, chosen, clusters, surface, place, sensor, is_stale, now, before
            )
        raised = self.raised(cell, clusters[: clusters.index(chosen)], now)
        if raised is not None:
            cell.height, cell.variance, cell.time = raised.mean, raised.variance, now
            cell.support = 3 * len(raised.points)
            chosen, is_confirmed, is_conflict = raised, True, True
            self.risen += 1
        self.conflicts += is_conflict
        return chosen, is_conflict, is_confirmed

    def update_cell(self, cell, chosen, clusters, surface, place, sensor, is_stale, now, before):
        """Return the cluster that counts, whether it is a conflict, and whether it confirms."""
        fits = [each for each in clusters if self.agrees_with(cell, each)]
        if surface is not None and surface not in fits:
            top = clusters[: clusters.index(surface)]
            fits = [e for e in fits if e in top and len(e.points) >= self.conflict_points]
        if fits:
            best = chosen if chosen in fits else fits[0]
            rise, total = best.mean - cell.height, cell.variance + best.variance
            doubt = max(1.0, rise**2 / (self.threshold**2 * total))
            cell.height += rise * cell.variance / total
            cell.variance *= doubt * best.variance / total
            cell.time, cell.support = now, cell.support + len(best.points)
            return best, False, True
        if self.replaces(chosen, surface, cell, place, sensor, is_stale, before):
            cell.height, cell.variance = chosen.mean, chosen.variance
            cell.time, cell.support = now, len(chosen.points)
            return chosen, True, True
        return chosen, True, False

    def agrees_with(self, cell, cluster):
        total = cluster.variance + cluster.spread
        return self.agrees(cell.height, cell.variance, cluster.mean, total)

    def replaces(self, chosen, surface, cell, place, sensor, is_stale, before):
        if chosen.mean > cell.height:
            return surface is not None
        beside = [before[near] for near in around(place) if near != place and near in before]
        stands_alone = all(height <= chosen.mean + self.resolution for height in beside)
        if stands_alone and cell.support <= self.conflict_points:
            return True
        through = [q for q, _ in chosen.points if self.entry(place, q, sensor) >= cell.height]
        return surface is not None and is_stale and len(through) >= self.conflict_points

    def raised(self, cell, above, now):
        """Return the candidate above the surface that was seen three times in half a second."""
        above = [
            each
            for each in above
            if len(each.points) >= self.conflict_points
            and each.mean > cell.height
            and not self.agrees_with(cell, each)
        ]
        if cell.candidate is not None and round(now - cell.candidate[2], 3) <= 0.5:
            height, count, first = cell.candidate
            for each in above:
                if self.agrees(height, 0.0, each.mean, 1.5 * (each.variance + each.spread)):
                    cell.candidate = (each.mean, count + 1, first) if count < 2 else None
                    return each if count == 2 else None
            if count > 1:
                return None
        if above:
            cell.candidate = above[0].mean, 1, now
        return None

    def entry(self, place, q, sensor):
        """Height of a beam where it enters the cell of its point."""
        low = max((t for t in self.borders(sensor, q) if t <= 1.0), default=0.0)
        # The last border before the point, or the sensor if it is in the same cell.
        same = self.place(sensor[0], sensor[1]) == place
        t = 0.0 if same else low
        return sensor[2] + t * (q[2] - sensor[2])

    def borders(self, sensor, q):
        """Shares of a beam at which it crosses borders of cells."""
        shares = []
        for k in (0, 1):
            way = q[k] - sensor[k]
            if way == 0:
                continue
            low, high = sorted((sensor[k] / self.resolution, q[k] / self.resolution))
            for number in range(math.ceil(low), math.floor(high) + 1):
                shares.append((number * self.resolution - sensor[k]) / way)
        return [t for t in shares if 0 < t < 1]

    def crossed(self, sensor, q):
        """Cells on the way of a beam but the last, with its highest height there."""
        way = np.asarray(q) - sensor
        length = float(np.linalg.norm(way))
        end = min(1.0, self.max_ray_length / length)
        shares = sorted([0.0, *self.borders(sensor, q), 1.0])
        for first, last in pairwise(shares[:-1]):
            if last <= first or first >= end:
                continue
            middle = sensor + 0.5 * (first + last) * way
            heights = [float(sensor[2] + t * way[2]) for t in (first, min(last, end))]
            yield self.place(middle[0], middle[1]), max(heights), heights[1]

    def proves(self, place, high, sensor, q, tops):
        cell = self.cells[place]
        if any(near in tops and high <= tops[near] + self.resolution for near in around(place)):
            return False
        slopes = []
        for di, dj in ((1, 0), (0, 1)):
            after, before = ((place[0] + s * di, place[1] + s * dj) for s in (1, -1))
            ends = [c for c in (before, after) if c in self.cells]
            h = [self.cells[c].height if c in self.cells else cell.height for c in (before, after)]
            slopes.append((h[1] - h[0]) / (max(len(ends), 1) * self.resolution))
        normal = np.array([-slopes[0], -slopes[1], 1.0])
        way = np.asarray(q) - sensor
        sine = abs(normal @ way) / np.linalg.norm(normal) / np.linalg.norm(way)
        return math.asin(min(sine, 1.0)) >= self.min_angle

    def drift(self, clusters):
        if not self.enable_drift_compensation:
            return 0.0
        seen = []
        for place, found in clusters.items():
            cell = self.cells.get(place)
            if cell is None or cell.variance > self.inlier or not self.is_level(place):
                continue
            for each in found:
                offset, variance = each.mean - cell.height, cell.variance + each.variance
                if abs(offset) <= self.max_drift + self.threshold * math.sqrt(variance):
                    seen.append((offset, variance))
        if len(seen) < self.min_drift_cells:
            return 0.0
        middle = float(np.median([offset for offset, _ in seen]))
        agree = [(o, v) for o, v in seen if abs(o - middle) <= self.threshold * math.sqrt(v)]
        if len(agree) < max(self.min_drift_cells, 0.5 * len(seen)):
            return 0.0
        mean = math.fsum(o / v for o, v in agree) / math.fsum(1 / v for _, v in agree)
        return mean if abs(mean) <= self.max_drift else 0.0

    def is_level(self, place):
        return all(
            near in self.cells and abs(self.cells[near].height - self.cells[place].height) <= 0.03
            for near in around(place)
        )

    def finish(self):
        """Round as layers of float32 do, and drop what is too uncertain."""
        self.exact = {place: (cell.height, cell.variance) for place, cell in self.cells.items()}
        for place in [*self.cells]:
            cell = self.cells[place]
            if not cell.variance <= (self.max_variance if self.max_variance > 0 else math.inf):
                del self.cells[place]
                continue
            cell.height, cell.time = float(np.float32(cell.height)), float(np.float32(cell.time))
            least = max(np.float32(cell.variance), np.float32(self.min_variance))
            cell.variance = float(least)

    def layers(self):
        """Heights, variances and times in map order."""
        return self.shaped({p: (c.height, c.variance, c.time) for p, c in self.cells.items()}, 3)

    def shaped(self, numbers, count):
        """Numbers of cells in map order."""
        result = np.full((count, *self.size), np.nan)
        for (i, j), values in numbers.items():
            place = (
                self.size[0] - 1 - (i - self.origin[0]),
                self.size[1] - 1 - (j - self.origin[1]),
            )
            result[(slice(None), *place)] = values
        return result


def around(place, reach=1):
    """A cell and its neighbors up to `reach` cells away."""
    steps = range(-reach, reach + 1)
    return [(place[0] + i, place[1] + j) for i in steps for j in steps]
