# SPDX-License-Identifier: Apache-2.0
"""Absolute and relative trajectory error (Sturm et al., IROS 2012), Umeyama's alignment (1991)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from slambed.data.association import MAX_DIFFERENCE_S, match_nearest, nearest_distance_s
from slambed.data.trajectory import Trajectory
from slambed.errors import SlambedError
from slambed.metrics.association import Method, associate

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]

MINIMUM_PAIRS = 3  # a rigid alignment in space needs three points
FARTHEST_ESTIMATE_M = 1e100
"""Of a pose of an estimate; what is farther has a square that may be no number."""
RANDOM_PAIRS = 10_000
"""Number of random pairs for a long path in TUM's evaluate_rpe.py (its `max_pairs`)."""


@dataclass(frozen=True)
class Alignment:
    """x_truth = scale * rotation @ x_estimate + translation."""

    rotation: Floats
    translation_m: Floats
    scale: float = 1.0

    def apply(self, positions_m: Floats) -> Floats:
        """Transforms positions [N,3] into the frame of the ground truth."""
        moved: Floats = self.scale * positions_m @ self.rotation.T + self.translation_m
        return moved

    def apply_to(self, trajectory: Trajectory) -> Trajectory:
        """Transforms a whole trajectory, including orientations."""
        from scipy.spatial.transform import Rotation  # slow to import

        turned = Rotation.from_matrix(self.rotation) * trajectory.rotations()
        return Trajectory(trajectory.stamps_s, self.apply(trajectory.positions_m), turned.as_quat())


@dataclass(frozen=True)
class ErrorStatistics:
    """Statistics of errors in one unit; `alignment` is Sim3 if the scale was estimated."""

    rmse: float
    mean: float
    median: float
    std: float
    minimum: float
    maximum: float
    pairs: int
    alignment: str = "SE3"
    scale: float = 1.0
    """Scale applied to the estimate; 1 unless it was estimated."""


@dataclass(frozen=True)
class RelativeError:
    """RPE: drift per `delta`; translation in meters, rotation in degrees."""

    translation_m: ErrorStatistics
    rotation_deg: ErrorStatistics
    delta: str


def align_umeyama(source_m: Floats, target_m: Floats, with_scale: bool = False) -> Alignment:
    """Returns the least-squares alignment of source to target [N,3]; the scale is 1 unless
    `with_scale`.

    Raises SlambedError with fewer than three pairs.
    """
    if len(source_m) != len(target_m) or len(source_m) < MINIMUM_PAIRS:
        raise SlambedError(f"{len(source_m)} pose pairs, need at least {MINIMUM_PAIRS} to align")
    _must_be_near(source_m, target_m)
    source_mean, target_mean = source_m.mean(axis=0), target_m.mean(axis=0)
    source, target = source_m - source_mean, target_m - target_mean
    covariance = target.T @ source / len(source_m)
    u, singular, vt = np.linalg.svd(covariance)
    signs = np.ones(3)
    if np.linalg.det(u) * np.linalg.det(vt) < 0:
        signs[2] = -1.0  # a rotation, not a reflection
    rotation = u @ np.diag(signs) @ vt
    scale = 1.0
    if with_scale:
        variance = float((source**2).sum() / len(source_m))
        scale = float(singular @ signs) / variance if variance > 0 else 1.0
    return Alignment(rotation, target_mean - scale * rotation @ source_mean, scale)


def _must_be_near(*positions_m: Floats) -> None:
    """LAPACK never ends on what overflows, and no error of it is a number."""
    for positions in positions_m:
        farthest_m = float(np.abs(positions).max(initial=0.0))
        if not farthest_m < FARTHEST_ESTIMATE_M:
            raise SlambedError(f"a pose is {farthest_m:g} m away, so no error is a number")


def statistics_of(errors: Floats, alignment: str = "SE3", scale: float = 1.0) -> ErrorStatistics:
    """Returns statistics of non-negative errors (population standard deviation)."""
    return ErrorStatistics(
        rmse=float(np.sqrt(np.mean(errors**2))),
        mean=float(errors.mean()),
        median=float(np.median(errors)),
        std=float(errors.std()),
        minimum=float(errors.min()),
        maximum=float(errors.max()),
        pairs=len(errors),
        alignment=alignment,
        scale=scale,
    )


def absolute_error(
    estimate: Trajectory,
    truth: Trajectory,
    max_difference_s: float = MAX_DIFFERENCE_S,
    method: Method = "nearest",
    with_scale: bool = False,
) -> ErrorStatistics:
    """Returns the ATE of the positions after one alignment: SE3, or Sim3 with `with_scale`."""
    return absolute_error_and_alignment(estimate, truth, max_difference_s, method, with_scale)[0]


def absolute_error_and_alignment(
    estimate: Trajectory,
    truth: Trajectory,
    max_difference_s: float = MAX_DIFFERENCE_S,
    method: Method = "nearest",
    with_scale: bool = False,
) -> tuple[ErrorStatistics, Alignment]:
    """Returns the ATE and the alignment of the estimate to the ground truth."""
    matched, reference = associate(estimate, truth, max_difference_s, method)
    if len(matched) < MINIMUM_PAIRS:
        raise _too_few_pairs(len(matched), estimate, truth, max_difference_s)
    alignment = align_umeyama(matched.positions_m, reference.positions_m, with_scale)
    errors = np.linalg.norm(alignment.apply(matched.positions_m) - reference.positions_m, axis=1)
    name = "Sim3" if with_scale else "SE3"
    return statistics_of(errors, name, alignment.scale), alignment


def _too_few_pairs(
    pairs: int, estimate: Trajectory, truth: Trajectory, max_difference_s: float
) -> SlambedError:
    """Explains why trajectories do not match: different clocks, or timestamps too far apart."""
    found = (
        f"{pairs} pose pairs within {1e3 * max_difference_s:g} ms, need at least {MINIMUM_PAIRS} "
        "to align"
    )
    if not len(estimate) or not len(truth):
        empty = "estimate" if not len(estimate) else "ground truth"
        return SlambedError(f"{found}: no pose in the {empty}")
    for name, path in (("estimate", estimate), ("ground truth", truth)):
        if len(path) < MINIMUM_PAIRS:
            return SlambedError(f"{found}: the {name} has too few poses ({len(path)})")
    own_s, true_s = np.sort(estimate.stamps_s), np.sort(truth.stamps_s)
    ranges = (
        f"the estimate is from {own_s[0]:.3f} to {own_s[-1]:.3f} s, the ground truth from "
        f"{true_s[0]:.3f} to {true_s[-1]:.3f} s"
    )
    if own_s[-1] < true_s[0] or own_s[0] > true_s[-1]:
        return SlambedError(f"{found}: {ranges}, they do not overlap; use one clock and seconds")
    nearest_ms = 1e3 * nearest_distance_s(own_s, true_s)
    return SlambedError(
        f"{found}: {ranges}, and the nearest two poses are {nearest_ms:.3g} ms apart; raise the "
        "limit (--max-difference-s of 'slambed evaluate') or interpolate the ground truth"
    )


def pairs_by_frames(count: int, delta: int, all_pairs: bool = True) -> NDArray[np.intp]:
    """Returns index pairs `delta` frames apart: from every start, or only consecutive pairs."""
    starts = np.arange(0, count - delta, 1 if all_pairs else delta)
    return np.column_stack([starts, starts + delta]).astype(np.intp)


def pairs_by_time(
    stamps_s: Floats, delta_s: float, tolerance_s: float = MAX_DIFFERENCE_S
) -> NDArray[np.intp]:
    """Pairs each pose with the pose nearest to `delta_s` later, if one exists within the
    tolerance."""
    starts, ends = match_nearest(stamps_s + delta_s, stamps_s, tolerance_s)
    keep = ends > starts
    return np.column_stack([starts[keep], ends[keep]]).astype(np.intp)


def _half_a_frame(stamps_s: Floats) -> float:
    """Returns a tolerance that finds a partner even if the interval is no multiple of the frame
    period."""
    usual_s = float(np.median(np.diff(stamps_s))) if len(stamps_s) > 1 else 0.0
    return max(MAX_DIFFERENCE_S, usual_s / 2)


def relative_error(
    estimate: Trajectory,
    truth: Trajectory,
    delta_s: float | None = 1.0,
    delta_frames: int = 1,
    max_difference_s: float = MAX_DIFFERENCE_S,
    method: Method = "nearest",
    all_pairs: bool = True,
) -> RelativeError:
    """Returns the RPE over `delta_s` seconds of the estimate, or over `delta_frames` poses if that
    is None.

    No alignment is needed: both motions are relative to their own start pose.
    """
    matched, reference = associate(estimate, truth, max_difference_s, method)
    if delta_s is not None:
        pairs = pairs_by_time(matched.stamps_s, delta_s, _half_a_frame(matched.stamps_s))
        label = f"{delta_s:g} s"
    else:
        pairs = pairs_by_frames(len(matched), delta_frames, all_pairs)
        label = f"{delta_frames} frames"
    if len(pairs) == 0:
        lasts_s = float(np.ptp(matched.stamps_s)) if len(matched) else 0.0
        raise SlambedError(
            f"no pose pairs {label} apart among {len(matched)} matched poses, which last "
            f"{lasts_s:.3g} s; take a shorter interval (--delta-s of 'slambed evaluate')"
        )
    return _error_of_pairs(matched, reference, pairs, label)


def relative_error_over_all(
    estimate: Trajectory,
    truth: Trajectory,
    max_difference_s: float = MAX_DIFFERENCE_S,
    method: Method = "nearest",
) -> RelativeError:
    """Returns the RPE over pairs of any distance, like TUM's evaluate_rpe.py without
    `--fixed_delta`.

    Uses all ordered pairs of fewer than 100 poses, otherwise 10,000 random pairs; the seed is
    fixed, so that the same path has the same error.
    """
    matched, reference = associate(estimate, truth, max_difference_s, method)
    if len(matched) < 2:
        raise SlambedError(f"{len(matched)} matched poses, need two for a relative error")
    return _error_of_pairs(matched, reference, pairs_of_any_distance(len(matched)), "all pairs")


def pairs_of_any_distance(count: int) -> NDArray[np.intp]:
    """Returns index pairs like TUM's script."""
    if count < RANDOM_PAIRS**0.5:
        return np.indices((count, count)).reshape(2, -1).T.astype(np.intp)
    return np.random.default_rng(0).integers(0, count, (RANDOM_PAIRS, 2)).astype(np.intp)


def _error_of_pairs(
    matched: Trajectory, reference: Trajectory, pairs: NDArray[np.intp], label: str
) -> RelativeError:
    _must_be_near(matched.positions_m, reference.positions_m)
    start, end = pairs[:, 0], pairs[:, 1]
    true_turn, true_step = _relative_motion(reference, start, end)
    own_turn, own_step = _relative_motion(matched, start, end)
    # Error motion: (true motion)^-1 * (estimated motion).
    step_error = true_turn.inv().apply(own_step - true_step)
    turn_error = product(true_turn.inv(), own_turn).magnitude()
    return RelativeError(
        statistics_of(np.linalg.norm(step_error, axis=1), "none"),
        statistics_of(np.degrees(turn_error), "none"),
        label,
    )


def _relative_motion(
    trajectory: Trajectory, start: NDArray[np.intp], end: NDArray[np.intp]
) -> tuple[Rotation, Floats]:
    """Returns rotation and translation of each end pose relative to its start pose."""
    rotations = trajectory.rotations()
    back = rotations[start].inv()
    step = back.apply(trajectory.positions_m[end] - trajectory.positions_m[start])
    return product(back, rotations[end]), np.asarray(step)


def product(first: Rotation, second: Rotation) -> Rotation:
    """Returns `first * second` for arrays of rotations, eight times as fast as scipy."""
    from scipy.spatial.transform import Rotation

    x1, y1, z1, w1 = first.as_quat().T
    x2, y2, z2, w2 = second.as_quat().T
    x = w1 * x2 + w2 * x1 + (y1 * z2 - z1 * y2)
    y = w1 * y2 + w2 * y1 + (z1 * x2 - x1 * z2)
    z = w1 * z2 + w2 * z1 + (x1 * y2 - y1 * x2)
    w = w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2
    return Rotation.from_quat(np.column_stack([x, y, z, w]))
