"""A complete scan of a motor, as a hand-held laser scanner and its fusion deliver it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from boltpose.arrays import BoolArray, Float32Array, FloatArray, IntArray, UInt8Array, freeze
from boltpose.errors import EmptyScanError
from boltpose.factory.model import SolidPart
from boltpose.sensor.fields import surface_field
from boltpose.sensor.hand_held_config import HandHeldConfig
from boltpose.sensor.raycast import RayCaster
from boltpose.sensor.reflectance import paint_surface, returned_light

_RAYS_AT_ONCE = 1 << 16
_GOLDEN = math.pi * (3 - math.sqrt(5))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class HandHeldScan:
    """The fused cloud, in the frame of the solids."""

    points: FloatArray
    """Shape (N, 3), mm."""
    labels: UInt8Array
    """Shape (N,), `Part` numbers: of the surface that was hit, for a stray point as well."""
    solid_index: npt.NDArray[np.int32]
    """Shape (N,), row of the solids."""
    is_stray: BoolArray
    """Shape (N,), True for points thrown off the surface."""

    def __post_init__(self) -> None:
        for name in ("points", "labels", "solid_index", "is_stray"):
            object.__setattr__(self, name, freeze(getattr(self, name)))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Sweep:
    """Scanning from one side: all arrays have a row per point that laser and detector reach."""

    beam: FloatArray
    """Shape (3,), unit, from the laser to the motor."""
    points: FloatArray
    across_mm: FloatArray
    """Place along the laser line, from the middle of the solids."""
    solid_index: IntArray
    cos_laser: Float32Array
    cos_detector: Float32Array
    cos_half: Float32Array


def scan_motor(
    solids: Sequence[SolidPart] | RayCaster, config: HandHeldConfig, rng: np.random.Generator
) -> HandHeldScan:
    """Scan solids that float free, from all around.

    The support never shows: real scans of the bottom are made after turning the motor over.

    Args:
        solids: The motor's solids, in one frame.
        config: The scanner and its errors.
        rng: The source of randomness; an ideal scan uses it too, for where the lines fall.

    Returns:
        The cloud, one point per cell of `config.cell_mm`.

    Raises:
        ShapeError: There are no solids.
        EmptyScanError: Nothing was measured.
    """
    caster = solids if isinstance(solids, RayCaster) else RayCaster(solids)
    aim_rng, paint_rng, loss_rng, noise_rng, stray_rng, fuse_rng = rng.spawn(6)
    points: list[FloatArray] = []
    indices: list[IntArray] = []
    beams: list[FloatArray] = []
    # one paint for all sweeps: stains stay where they are
    paint_seed = int(paint_rng.integers(2**63))
    for frame in _sweep_frames(config.directions, aim_rng):
        sweep = _sweep(caster, frame, config, aim_rng)
        measured = sweep.points
        keep: IntArray | slice = slice(None)
        if not config.is_ideal:
            keep = np.flatnonzero(_survives(sweep, caster.solids, config, paint_seed, loss_rng))
            measured = _disturbed(sweep, keep, config, noise_rng)
        points.append(measured)
        indices.append(sweep.solid_index[keep])
        beams.append(np.broadcast_to(sweep.beam, measured.shape))
    cloud = np.concatenate(points)
    index = np.concatenate(indices)
    is_stray = np.zeros(len(cloud), dtype=np.bool_)
    if not config.is_ideal and len(cloud):
        kept = _not_forgotten(cloud, config, loss_rng)
        cloud, index, is_stray = cloud[kept], index[kept], is_stray[kept]
        is_stray = stray_rng.random(len(cloud)) < config.stray_share
        count = int(is_stray.sum())
        # mostly in front of the surface, now and then behind it
        off = stray_rng.exponential(config.stray_mm, count) * np.where(
            stray_rng.random(count) < 0.8, -1, 1
        )
        cloud[is_stray] += off[:, None] * np.concatenate(beams)[kept][is_stray]
    if not len(cloud):
        raise EmptyScanError("the scanner saw nothing: 0 points on the solids")
    chosen = _fuse(cloud, config.cell_mm, fuse_rng)
    index = index[chosen]
    return HandHeldScan(
        points=cloud[chosen],
        labels=caster.labels[index],
        solid_index=index.astype(np.int32),
        is_stray=is_stray[chosen],
    )


def _sweep_frames(count: int, rng: np.random.Generator) -> list[FloatArray]:
    """Rotations, shape (3, 3): columns are line, sweep and beam direction, evenly all around."""
    step = np.arange(count) + 0.5
    height = 1 - 2 * step / count
    radius = np.sqrt(1 - height * height)
    beams = np.stack(
        [radius * np.cos(_GOLDEN * step), radius * np.sin(_GOLDEN * step), height], axis=1
    )
    turn = Rotation.from_quat(rng.standard_normal(4)).as_matrix()
    spread = 0.5 * math.sqrt(4 * math.pi / count)
    frames: list[FloatArray] = []
    for beam in beams:
        aimed = turn @ beam + 0.35 * spread * rng.standard_normal(3)
        aimed /= np.linalg.norm(aimed)
        # any two directions across the beam, then a random roll of the scanner
        helper = np.eye(3)[np.argmin(np.abs(aimed))]
        first = np.cross(aimed, helper)
        first /= np.linalg.norm(first)
        second = np.cross(aimed, first)
        roll = rng.uniform(0, 2 * math.pi)
        line = math.cos(roll) * first + math.sin(roll) * second
        sweep = math.cos(roll) * second - math.sin(roll) * first
        frames.append(np.stack([line, sweep, aimed], axis=1))
    return frames


def _sweep(
    caster: RayCaster, frame: FloatArray, config: HandHeldConfig, rng: np.random.Generator
) -> _Sweep:
    """Cast a jittered grid of parallel beams over the solids and ask what the detector sees."""
    line, sweep, beam = frame.T
    middle, radius = caster.centre_mm, caster.radius_mm + 1
    shadow = [_along(caster.vertices, axis) - middle @ axis for axis in (line, sweep)]
    low = [float(values.min()) for values in shadow]
    high = [float(values.max()) for values in shadow]
    columns, rows = (
        max(1, math.ceil((top - bottom) / config.pitch_mm))
        for bottom, top in zip(low, high, strict=True)
    )
    grid = np.mgrid[0:rows, 0:columns].reshape(2, -1)
    # a hand does not move evenly: beams fall anywhere in their cell
    across = low[0] + (grid[1] + rng.random(grid.shape[1])) * config.pitch_mm
    along = low[1] + (grid[0] + rng.random(grid.shape[1])) * config.pitch_mm
    angle = math.radians(config.triangulation_deg)
    to_detector = -math.cos(angle) * beam + math.sin(angle) * sweep
    half = to_detector - beam
    half /= np.linalg.norm(half)
    least = 0.0 if config.is_ideal else math.cos(math.radians(config.max_incidence_deg))
    pieces: list[_Sweep] = []
    for start in range(0, len(across), _RAYS_AT_ONCE):
        part = slice(start, start + _RAYS_AT_ONCE)
        origins = middle - radius * beam + across[part, None] * line + along[part, None] * sweep
        hits = caster.first_hits(origins, np.broadcast_to(beam, origins.shape))
        cos_laser = -_along(hits.normals, beam)
        cos_detector = _along(hits.normals, to_detector)
        seen = np.flatnonzero((cos_laser > least) & (cos_detector > least))
        points = hits.points[seen]
        free = ~caster.is_blocked(points + 2 * radius * to_detector, points)
        seen, points = seen[free], points[free]
        pieces.append(
            _Sweep(
                beam=beam,
                points=points,
                across_mm=across[part][seen],
                solid_index=hits.solid_index[seen],
                cos_laser=cos_laser[seen].astype(np.float32),
                cos_detector=cos_detector[seen].astype(np.float32),
                cos_half=_along(hits.normals[seen], half).astype(np.float32),
            )
        )
    return _Sweep(
        beam=beam,
        points=np.concatenate([piece.points for piece in pieces]),
        across_mm=np.concatenate([piece.across_mm for piece in pieces]),
        solid_index=np.concatenate([piece.solid_index for piece in pieces]),
        cos_laser=np.concatenate([piece.cos_laser for piece in pieces]),
        cos_detector=np.concatenate([piece.cos_detector for piece in pieces]),
        cos_half=np.concatenate([piece.cos_half for piece in pieces]),
    )


def _along(vectors: FloatArray, axis: FloatArray) -> FloatArray:
    """Scalar products with one axis, term by term so that threads of BLAS change no bits."""
    return vectors[:, 0] * axis[0] + vectors[:, 1] * axis[1] + vectors[:, 2] * axis[2]


def _survives(
    sweep: _Sweep,
    solids: Sequence[SolidPart],
    config: HandHeldConfig,
    paint_seed: int,
    rng: np.random.Generator,
) -> BoolArray:
    """Which points return enough light to the detector, and not too much."""
    paint_rng = np.random.default_rng(paint_seed)
    surface = paint_surface(solids, sweep.points, sweep.solid_index, config.finish, paint_rng)
    matt, highlight = returned_light(
        surface,
        sweep.cos_laser,
        sweep.cos_detector,
        sweep.cos_half,
        np.ones(len(sweep.points), dtype=np.float32),
    )
    level = np.log(np.maximum(matt + highlight, np.float32(1e-6)))
    doubt = surface_field(sweep.points, config.dropout_patch_mm, rng)
    doubt += np.float32(0.5) * rng.standard_normal(len(doubt), dtype=np.float32)
    level += np.float32(config.dropout_spread) * doubt
    alive = (level > np.log(config.min_signal)) & (level < np.log(config.saturation_signal))
    return np.asarray(alive)


def _disturbed(
    sweep: _Sweep, keep: IntArray, config: HandHeldConfig, rng: np.random.Generator
) -> FloatArray:
    """Noise along the beam, and each strip's error of registration."""
    points = sweep.points[keep]
    cos2 = sweep.cos_laser[keep].astype(np.float64) ** 2
    sigma = config.noise_mm * (1 + config.noise_incidence * (1 / cos2 - 1))
    points += (sigma * rng.standard_normal(len(points)))[:, None] * sweep.beam
    # several strips side by side where one laser line is too short
    strip = np.floor(sweep.across_mm[keep] / config.strip_mm + rng.random()).astype(np.int64)
    if len(strip):
        strip -= strip.min()
        count = int(strip.max()) + 1
        shift = config.strip_shift_mm * rng.standard_normal((count, 3))
        turn = np.radians(config.strip_turn_deg) * rng.standard_normal((count, 3))
        arms = points - points.mean(axis=0)
        points += shift[strip] + np.cross(turn[strip], arms)
    return points


def _not_forgotten(
    cloud: FloatArray, config: HandHeldConfig, rng: np.random.Generator
) -> BoolArray:
    """All points but those in the spots that the operator missed."""
    keep = np.ones(len(cloud), dtype=np.bool_)
    for centre in cloud[rng.integers(0, len(cloud), rng.poisson(config.missed_patches))]:
        radius = config.missed_radius_mm * math.exp(0.3 * rng.standard_normal())
        offset = cloud - centre
        keep &= np.einsum("ij,ij->i", offset, offset) > radius * radius
    return keep


def _fuse(cloud: FloatArray, cell_mm: float, rng: np.random.Generator) -> IntArray:
    """One random point per occupied cell, in the order of the cells.

    The cells' numbers sit in the high bits of one sorted key and a shuffled rank in the low ones.
    """
    cells = np.floor((cloud - cloud.min(axis=0)) / cell_mm).astype(np.int64)
    spans = cells.max(axis=0) + 1
    number = (cells[:, 0] * spans[1] + cells[:, 1]) * spans[2] + cells[:, 2]
    bits = len(cloud).bit_length()
    rank = rng.permutation(len(cloud))
    keys = np.sort((number << bits) | rank)
    first = np.concatenate([[True], (keys[1:] >> bits) != (keys[:-1] >> bits)])
    place = np.zeros(len(cloud), dtype=np.int64)
    place[rank] = np.arange(len(cloud))
    return place[keys[first] & ((1 << bits) - 1)]
