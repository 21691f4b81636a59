"""What failures leave of the workspace, and the limits and link lengths that keep the most.

See `reachable_sets` for the definition. Planar arms of three joints without physical limits
are measured in closed form, `planar_workspace`; others on a grid. The grid over-estimates, so
the size is that of its voxels times the share of a random sample of points in them for which
inverse kinematics finds every configuration that is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
import numpy.typing as npt
from scipy import ndimage, optimize

from formulations.robots.planar_workspace import Planar3R
from formulations.robots.reachable_sets import SLICE, ReachableSets, check_grid
from formulations.robots.serial_arm import Bits, Ranges, SerialArm
from nlp.arrays import FloatArray
from nlp.errors import InputError

#: A joint's artificial limits are at least this far apart, in radians, when they are chosen: a
#: joint that does not move is no joint.
LEAST_WIDTH = np.deg2rad(10.0)
#: Starts of the search on a grid.
STARTS = 4
#: Generations of the search in closed form.
GENERATIONS = 60
#: Points that inverse kinematics checks.
SAMPLE = 400
# Depths below the surface, in voxels, for which the share that passes is given.
_DEPTHS = 4
# The grid on which limits are compared is coarser, by this, than that of the answer.
_COARSER = 2.0
_DRAWS = 100
# Ends of intervals move by these, as multiples of the coarse slice, and link lengths by these
# shares of their sum.
_MOVES = (4, 2, 1)
# How the two ends of an interval move: apart, one of them, together, both the same way.
_ENDS = ((-1, 1), (-1, 0), (0, 1), (1, 0), (0, -1), (1, -1), (-1, -1), (1, 1))
_SHIFTS = (0.1, 0.05, 0.025)
Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Workspace:
    """The failure-tolerant workspace of an arm.

    Attributes
    ----------
    arm
        The arm.
    limits
        Artificial limits of the joints, in radians or metres.
    dimension
        2 for an area, 3 for a volume.
    size, error
        Area or volume in m² or m³, and how far it may be from the truth: of the quadrature, or
        two standard errors of the sample.
    raw
        The same of all voxels, an over-estimate.
    before
        Size of what is reached within the artificial limits, if no joint fails, raw.
    physical
        The same within the physical limits.
    fatal
        Joints whose own failures, somewhere within their artificial limits, leave nothing.
    passed
        Share of the sampled points that pass inverse kinematics, before the failure and after
        every one, by their depth below the surface: 0, 1, 2 voxels, or more. Empty in closed
        form.
    sets
        The reachable sets.
    """

    arm: SerialArm
    limits: Ranges
    dimension: int
    size: float
    error: float
    raw: float
    before: float
    physical: float
    fatal: tuple[str, ...]
    passed: tuple[float, ...]
    sets: ReachableSets

    @property
    def voxels(self) -> Bits:
        """Which voxels are in the workspace, before layers are removed."""
        return self.sets.before(self.limits) & self.sets.after(self.limits)

    def to_dict(self) -> dict[str, object]:
        """Return the result as plain values."""
        names = [one.name for one in self.arm.steps]
        return {
            "quantity": "area" if self.dimension == 2 else "volume",
            "size": self.size,
            "error": self.error,
            "method": "closed form" if closed_form(self.arm, self.limits) else "grid",
            "without_failure": self.before,
            "without_failure_and_artificial_limits": self.physical,
            "share_kept": self.size / self.physical if self.physical else 0.0,
            "fatal": list(self.fatal),
            "limits": {k: list(v) for k, v in zip(names, self.limits, strict=True)},
            "links": dict(zip(names, self.arm.links.tolist(), strict=True)),
            "voxel": self.sets.voxel,
            "slice": self.sets.step,
            "raw": self.raw,
            "passed_by_depth": [None if one != one else one for one in self.passed],
        }


def workspace(
    arm: SerialArm,
    limits: Ranges,
    voxel: float,
    step: float = SLICE,
    progress: Progress = lambda _: None,
) -> Workspace:
    """Measure the failure-tolerant workspace of an arm.

    Parameters
    ----------
    arm, limits
        The arm, and the artificial limits of its joints.
    voxel, step
        See `ReachableSets`.
    progress
        Is called with what is being done.

    Raises
    ------
    InputError
        If a limit is outside the physical ones, or the grid cannot be made.
    """
    check_limits(arm, limits)
    sets = ReachableSets(arm, voxel, step, progress)
    return measured(sets, limits, progress)


def measured(
    sets: ReachableSets, limits: Ranges, progress: Progress = lambda _: None
) -> Workspace:
    """Measure the workspace for one choice of limits, from sets that are there already."""
    arm, unit = sets.arm, sets.unit
    before = sets.before(limits)
    raw = before & sets.after(limits)
    planar = closed_form(arm, limits)
    found = Workspace(
        arm=arm,
        limits=limits,
        dimension=2 if arm.is_planar else 3,
        size=0.0,
        error=0.0,
        raw=unit * float(raw.sum()),
        before=unit * float(before.sum()),
        physical=unit * float(sets.before(arm.physical).sum()),
        fatal=sets.against(limits),
        passed=(),
        sets=sets,
    )
    if planar is not None:
        size, error = planar.area_with_error()
        return replace(found, size=size, error=error)
    if not raw.any():
        return found
    progress("inverse kinematics")
    passed, depths = verified(sets, limits, raw)
    share, count = float(passed.mean()), len(passed)
    # The estimate of a binomial variance that does not vanish if all pass.
    guarded = (share * count + 1) / (count + 2)
    error = 2 * found.raw * float(np.sqrt(guarded * (1 - guarded) / count))
    groups = [passed[depths == k] for k in range(_DEPTHS - 1)] + [passed[depths >= _DEPTHS - 1]]
    by_depth = tuple(float(np.mean(one)) if len(one) else float("nan") for one in groups)
    return replace(found, size=found.raw * share, error=error, passed=by_depth)


def verified(
    sets: ReachableSets, limits: Ranges, voxels: Bits, sample: int = SAMPLE
) -> tuple[Bits, npt.NDArray[np.intp]]:
    """Check a random sample of points in voxels by inverse kinematics.

    A point passes if it is reached within the artificial limits, and with each joint at each
    of its slices, which include the next ones outside the limits, within the physical limits.

    Returns
    -------
    numpy.ndarray
        Which points pass, shape (sample,).
    numpy.ndarray
        How many voxels they are below the surface.
    """
    arm, rng = sets.arm, np.random.default_rng(0)
    inner = (slice(1, -1),) * voxels.ndim
    layers = ndimage.distance_transform_cdt(np.pad(voxels, 1), metric="taxicab")[inner]
    below = layers[voxels] - 1
    centres = sets.centres(voxels)
    drawn = rng.integers(len(centres), size=sample)
    points = np.zeros((sample, 3))
    inside = rng.uniform(-0.5, 0.5, (sample, centres.shape[1])) * sets.voxel
    points[:, : centres.shape[1]] = centres[drawn] + inside
    if arm.is_planar:
        points[:, 2] = arm.frames(np.zeros((1, len(arm.steps))))[2][0, 2]
    lower, upper = (np.array(one) for one in zip(*limits, strict=True))
    passed = arm.reaches(points, *_repeated(lower, upper, sample))
    lower, upper = (np.array(one) for one in zip(*arm.physical, strict=True))
    for joint in sets.slices:
        places = sets.places(joint, limits)
        left = np.flatnonzero(passed)
        targets = np.repeat(points[left], len(places), axis=0)
        low, high = _repeated(lower, upper, len(targets))
        low[:, joint] = high[:, joint] = np.tile(places, len(left))
        found = arm.reaches(targets, low, high).reshape(len(left), len(places))
        passed[left] = found.all(axis=1)
    return passed, below[drawn]


def _repeated(
    lower: FloatArray, upper: FloatArray, count: int
) -> tuple[FloatArray, FloatArray]:
    return np.tile(lower, (count, 1)), np.tile(upper, (count, 1))


def closed_form(arm: SerialArm, limits: Ranges) -> Planar3R | None:
    """Return the arm and limits in the form of `planar_workspace`; None if they have none.

    They have one if the arm is planar, has three joints and no physical limits.
    """
    free = all(one.endless for one in arm.steps)
    if not (arm.is_planar and len(arm.steps) == 3 and free):
        return None
    axes, origins, tip = arm.frames(np.zeros((1, 3)))
    ends = np.array([*origins[:, 0], tip[0]])[:, :2]
    links = np.diff(ends, axis=0)
    bearings = np.arctan2(links[:, 1], links[:, 0])
    bent = np.diff(bearings, prepend=0.0)
    turned = np.sign(axes[:, 0, 2])
    ranges = [
        tuple(sorted((s * low + b, s * high + b)))
        for s, b, (low, high) in zip(turned, bent, limits, strict=True)
    ]
    lengths = np.hypot(links[:, 0], links[:, 1])
    if min(lengths) < 1e-6:
        return None
    return Planar3R(tuple(lengths.tolist()), tuple(ranges))  # type: ignore[arg-type]


def check_limits(arm: SerialArm, limits: Ranges) -> None:
    """Raise InputError unless artificial limits are in order and within the physical ones."""
    for step, (low, high) in zip(arm.steps, limits, strict=True):
        if step.endless and -4 * np.pi <= low <= high <= min(low + 2 * np.pi, 4 * np.pi):
            continue
        if not step.lower - 1e-6 <= low <= high <= step.upper + 1e-6:
            allowed = f"two numbers in order within [{step.lower:.7g}, {step.upper:.7g}]"
            raise InputError(f"artificial limits of {step.name}", f"{low:g}:{high:g}", allowed)


# The best limits and lengths ------------------------------------------------------------------


def best_limits(
    arm: SerialArm,
    voxel: float,
    *,
    lengths: bool = False,
    least_width: float = LEAST_WIDTH,
    starts: int = STARTS,
    generations: int = GENERATIONS,
    seed: int = 0,
    progress: Progress = lambda _: None,
) -> tuple[SerialArm, Ranges]:
    """Search for the artificial limits that leave the largest workspace.

    Planar arms that have the closed form: differential evolution, then Nelder–Mead. Others:
    a pattern search on a grid twice as coarse, from the best of random intervals. Where the
    workspace is empty, the merit is what is missing of it. The best found is not proved to be
    the best.

    Parameters
    ----------
    arm, voxel
        The arm, and the voxel that it will be measured with.
    lengths
        Whether the link lengths are chosen too, with the same sum.
    least_width
        Least width of the limits of a revolute joint, in radians.
    starts
        Of the pattern search.
    generations
        Of the differential evolution; Nelder–Mead makes ten times as many steps.
    seed
        Of what is random.
    progress
        Is called with what is being done.

    Returns
    -------
    SerialArm
        The arm, with its new links.
    tuple
        The limits.
    """
    if not 0 < least_width <= np.pi:
        raise InputError("least width", least_width, "above 0 and at most half a turn")
    check_grid(arm, voxel, SLICE)
    if closed_form(arm, arm.physical) is not None:
        return _best_planar(arm, lengths, least_width, generations, seed, progress)
    rng = np.random.default_rng(seed)
    search = _Pattern(arm, _COARSER * voxel, least_width, progress)
    found = [search.run(rng, k) for k in range(starts)]
    limits = max(found, key=search.merit)
    if not lengths:
        return arm, limits
    best = search.merit(limits)
    for share in _SHIFTS:
        better = True
        while better:
            better = False
            for shifted in _shifted_links(search.sets.arm, share):
                other = _Pattern(shifted, search.sets.voxel, least_width, progress)
                if other.merit(limits) > best:
                    search, better = other, True
                    limits = search.climbed(limits, _MOVES[1:])
                    best = search.merit(limits)
                    progress(f"links {np.round(shifted.links, 3)}: {best:.4g}")
                    break
    return search.sets.arm, limits


def _shifted_links(arm: SerialArm, share: float) -> list[SerialArm]:
    """Return arms with a share of the links' sum moved from one link to another."""
    links = arm.links
    by = share * float(np.sum(links))
    pairs = permutations(np.flatnonzero(links > 1e-6), 2)
    found = []
    for one, other in pairs:
        if links[one] > 1.5 * by:
            moved = links.copy()
            moved[one] -= by
            moved[other] += by
            found.append(arm.with_links(moved))
    return found


class _Pattern:
    """A pattern search over the ends of the artificial limits, on one grid."""

    def __init__(
        self, arm: SerialArm, voxel: float, least_width: float, progress: Progress
    ) -> None:
        self.sets = ReachableSets(arm, voxel, 2 * SLICE)
        self._least, self._progress = least_width, progress
        self._known: dict[Ranges, float] = {}

    def merit(self, limits: Ranges) -> float:
        """Size of the workspace; where it is empty, minus the failures against a voxel."""
        if limits not in self._known:
            kept = self.sets.after(limits)
            if kept.any():
                kept &= self.sets.before(limits)
            size = self.sets.unit * float(kept.sum())
            self._known[limits] = size or -float(self.sets.missing(limits)) - 1
        return self._known[limits]

    def run(self, rng: np.random.Generator, start: int) -> Ranges:
        """Climb from the best of random intervals."""
        drawn = [self._drawn(rng) for _ in range(_DRAWS)]
        limits = self.climbed(max(drawn, key=self.merit), _MOVES)
        self._progress(f"start {start}: {self.merit(limits):.4g}")
        return limits

    def climbed(self, limits: Ranges, moves: Sequence[int]) -> Ranges:
        """Move ends of the limits, or both, for as long as the workspace grows."""
        for move in moves:
            better = True
            while better:
                better = False
                for joint in self.sets.slices:
                    for low, high in _ENDS:
                        by = move * self._unit(joint)
                        other = self._moved(limits, joint, low * by, high * by)
                        if other and self.merit(other) > self.merit(limits):
                            limits, better = other, True
        return limits

    def _moved(self, limits: Ranges, joint: int, low: float, high: float) -> Ranges | None:
        one = self.sets.arm.steps[joint]
        first, last = limits[joint][0] + low, limits[joint][1] + high
        if one.endless:
            last = min(last, first + 2 * np.pi)
        else:
            first, last = max(first, one.lower), min(last, one.upper)
        width = self._unit(joint) if one.prismatic else self._least
        if last - first < min(width, one.upper - one.lower) - 1e-9:
            return None
        return (*limits[:joint], (first, last), *limits[joint + 1 :])

    def _drawn(self, rng: np.random.Generator) -> Ranges:
        """Draw intervals; joints that do not move the tip keep their physical limits."""
        limits = self.sets.arm.physical
        for joint in self.sets.slices:
            low, high = limits[joint]
            half = max(rng.uniform(0, (high - low) / 2), self._least / 2)
            middle = rng.uniform(low, high)
            ends = (max(middle - half, low), min(middle + half, high))
            limits = (*limits[:joint], ends, *limits[joint + 1 :])
        return limits

    def _unit(self, joint: int) -> float:
        prismatic = self.sets.arm.steps[joint].prismatic
        return 2 * self.sets.voxel if prismatic else self.sets.step


def _best_planar(
    arm: SerialArm,
    lengths: bool,
    least_width: float,
    generations: int,
    seed: int,
    progress: Progress,
) -> tuple[SerialArm, Ranges]:
    """Choose the limits, and the lengths if asked for, of a planar 3R arm."""
    total, reference = float(np.sum(arm.links)), closed_form(arm, arm.physical)
    assert reference is not None
    least = least_width / 2

    def stated(x: FloatArray) -> Planar3R:
        half, second, wide2, third, wide3 = (float(one) for one in x[:5])
        links = reference.lengths
        if lengths:  # of two cuts of the sum, in any order
            low, high = sorted(float(one) for one in x[5:7])
            links = (low * total, (high - low) * total, (1 - high) * total)
            links = tuple(max(one, 1e-3 * total) for one in links)  # type: ignore[assignment]
        ranges = (
            (-half, half),
            (second - wide2, second + wide2),
            (third - wide3, third + wide3),
        )
        return Planar3R(links, ranges)

    def merit(x: FloatArray) -> float:
        one = stated(x)
        area = one.area()
        return -area if area > 0 else max(one.shortfall, 0.0) * total**2

    half_turn = (least, np.pi)
    # An arm and its mirror image keep the same: the middle of joint 2 is not below 0.
    bounds = [half_turn, (0.0, np.pi), half_turn, (-np.pi, np.pi), half_turn]
    bounds += [(0.0, 1.0)] * (2 if lengths else 0)
    progress("differential evolution")
    # A fair choice for most arms: narrow limits of joint 1, half a turn of the others.
    first = np.array([np.pi / 9, 0.0, np.pi / 2, 0.0, np.pi / 2, 1 / 3, 2 / 3][: len(bounds)])
    fair = np.clip(first, *np.transpose(bounds))
    # Two populations, with it and without: it attracts the first to its own optimum.
    found = min(
        (
            optimize.differential_evolution(
                merit,
                bounds,
                x0=x0,
                rng=seed + k,
                maxiter=generations,
                popsize=12,
                tol=1e-6,
                polish=False,
            )
            for k, x0 in enumerate((fair, None))
        ),
        key=lambda one: one.fun,
    )
    progress("Nelder–Mead")
    options = {"xatol": 1e-5, "fatol": 1e-8 * total**2, "maxiter": 10 * generations}
    found = optimize.minimize(
        merit, found.x, method="Nelder-Mead", bounds=bounds, options=options
    )
    best = stated(found.x)
    chosen = arm.with_links(best.lengths) if lengths else arm
    return chosen, _in_joints(chosen, best)


def _in_joints(arm: SerialArm, best: Planar3R) -> Ranges:
    """Return limits of the closed form as those of the arm's own joints."""
    zero = closed_form(arm, ((0.0, 0.0),) * 3)
    unit = closed_form(arm, ((0.0, 1e-3),) * 3)
    assert zero is not None
    assert unit is not None
    found = []
    for joint, (low, high) in enumerate(best.limits):
        offset = zero.limits[joint][0]
        sign = 1 if unit.limits[joint][1] > offset else -1
        middle, half = sign * ((low + high) / 2 - offset), (high - low) / 2
        least, most = arm.physical[joint]
        middle = middle if joint else 0.0
        middle = (middle + np.pi) % (2 * np.pi) - np.pi
        # Limits of a joint without physical ones may pass ±π.
        found.append((middle - half, middle + half) if half < np.pi else (least, most))
    return tuple(found)
