"""Shapes that look cast or pressed: outlines with rounded corners, plates with rounded edges.

Outlines are `CrossSection`s in the xy-plane, mm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from manifold3d import CrossSection, FillRule, JoinType, Manifold, Mesh64, triangulate

from boltpose.arrays import FloatArray, IntArray
from boltpose.factory.solids import polar, segments, turned

_SIMPLIFY_MM = 0.01
_MAX_MITER = 1.6
"""Corners sharper than this are cut rather than stretched when an edge is rounded."""


def disc(radius_mm: float, centre_mm: tuple[float, float] = (0, 0)) -> CrossSection:
    """A round outline."""
    return CrossSection.circle(radius_mm, segments(radius_mm)).translate(centre_mm)


def bar(
    first_mm: tuple[float, float],
    first_radius_mm: float,
    second_mm: tuple[float, float],
    second_radius_mm: float,
) -> CrossSection:
    """The convex outline around two discs: an arm from one to the other."""
    return CrossSection.batch_hull(
        [disc(first_radius_mm, first_mm), disc(second_radius_mm, second_mm)]
    )


def wedge(radius_mm: float, angle_deg: float, width_deg: float) -> CrossSection:
    """A sector about the origin."""
    count = max(2, math.ceil(width_deg / 4))
    angles = [angle_deg + width_deg * (step / count - 0.5) for step in range(count + 1)]
    return CrossSection([np.array([(0.0, 0.0), *(polar(radius_mm, angle) for angle in angles)])])


def joined(
    outlines: Sequence[CrossSection], *, fillet_mm: float = 0, round_mm: float = 0
) -> CrossSection:
    """Union of outlines; inner corners get fillets, outer ones are rounded.

    Args:
        outlines: At least one.
        fillet_mm: Radius of the inner corners.
        round_mm: Radius of the outer corners.
    """
    section = CrossSection(
        [polygon for outline in outlines for polygon in outline.to_polygons()], FillRule.Positive
    )
    if fillet_mm > 0:
        section = _offset(_offset(section, fillet_mm), -fillet_mm)
    if round_mm > 0:
        section = _offset(_offset(section, -round_mm), round_mm)
    return section.simplify(_SIMPLIFY_MM)


def _offset(section: CrossSection, delta_mm: float) -> CrossSection:
    return section.offset(delta_mm, JoinType.Round, 2.0, segments(abs(delta_mm) + 2))


def plate(
    section: CrossSection,
    z_low_mm: float,
    z_high_mm: float,
    *,
    round_low_mm: float = 0,
    round_high_mm: float = 0,
    draft_deg: float = 0,
) -> Manifold:
    """Extrude an outline along z with rounded edges and the draft of a casting mould.

    Args:
        section: Outline at the lower end; corners are eased where an edge's rounding needs it.
        z_low_mm: Lower end.
        z_high_mm: Upper end.
        round_low_mm: Radius of the lower edge, approximated by three facets.
        round_high_mm: Radius of the upper edge.
        draft_deg: How much the walls lean inwards towards the upper end.
    """
    height = z_high_mm - z_low_mm
    limit = 0.45 * height
    low, high = min(round_low_mm, limit), min(round_high_mm, limit)
    levels = [(z_low_mm + z, inset) for z, inset in _quarter(low)]
    slope = math.tan(math.radians(draft_deg))
    levels += [
        (z_high_mm - z, inset + slope * (height - low - high))
        for z, inset in reversed(_quarter(high))
    ]
    inset_max = max(inset for _, inset in levels)
    if inset_max < 1e-6:
        return section.extrude(height).translate((0, 0, z_low_mm))
    # no curve may be tighter than the inset, or the rings below would cross
    eased = 1.25 * inset_max + 0.05
    section = joined([_offset(_offset(section, -eased), eased)], fillet_mm=eased)
    return _loft(section, levels)


def _quarter(radius_mm: float) -> list[tuple[float, float]]:
    """Heights above the face and insets of a rounded edge, from the face to the wall."""
    if radius_mm <= 0:
        return [(0.0, 0.0)]
    angles = np.radians((0.0, 30.0, 60.0, 90.0))
    return [
        (radius_mm * (1 - math.cos(angle)), radius_mm * (1 - math.sin(angle))) for angle in angles
    ]


def _loft(section: CrossSection, levels: Sequence[tuple[float, float]]) -> Manifold:
    """Stack inset copies of an outline, each vertex moving along its own mitre."""
    rings = [np.asarray(polygon, dtype=np.float64) for polygon in section.to_polygons()]
    mitres = [_mitres(ring) for ring in rings]
    flat = np.concatenate(rings)
    inward = np.concatenate(mitres)
    count = len(flat)
    layers = [
        np.column_stack([flat + inset * inward, np.full(count, height)]) for height, inset in levels
    ]
    faces: list[IntArray] = []
    cap = np.asarray(triangulate([ring.astype(np.float64) for ring in rings]), dtype=np.int64)
    faces.append(cap[:, ::-1])
    faces.append(cap + count * (len(levels) - 1))
    start = 0
    for ring in rings:
        here = np.arange(start, start + len(ring))
        after = np.roll(here, -1)
        for level in range(len(levels) - 1):
            low, high = count * level, count * (level + 1)
            faces.append(np.column_stack([here + low, after + low, after + high]))
            faces.append(np.column_stack([here + low, after + high, here + high]))
        start += len(ring)
    mesh = Mesh64(
        vert_properties=np.concatenate(layers), tri_verts=np.concatenate(faces).astype(np.uint64)
    )
    return Manifold(mesh)


def _mitres(ring: FloatArray) -> FloatArray:
    """Per vertex the move, shape (K, 2), that shifts both its edges inwards by 1."""
    edges = np.roll(ring, -1, axis=0) - ring
    edges /= np.linalg.norm(edges, axis=1, keepdims=True)
    left = np.column_stack([-edges[:, 1], edges[:, 0]])  # inside, the ring runs counter-clockwise
    both = left + np.roll(left, 1, axis=0)
    scale = 2 / np.maximum(np.sum(both * both, axis=1), 4 / _MAX_MITER**2)
    return both * scale[:, None]


def eased(profile_mm: Sequence[tuple[float, float, float]]) -> list[tuple[float, float]]:
    """Round the corners of a (radius, z, corner radius) profile for `turned`."""
    points: list[tuple[float, float]] = []
    corners = np.asarray(profile_mm, dtype=np.float64)
    for index, (radius, z, rounding) in enumerate(corners):
        before = corners[index - 1, :2] - (radius, z)
        after = corners[(index + 1) % len(corners), :2] - (radius, z)
        reach_before, reach_after = float(np.linalg.norm(before)), float(np.linalg.norm(after))
        if rounding <= 0 or min(reach_before, reach_after) < 1e-6:
            points.append((radius, z))
            continue
        before, after = before / reach_before, after / reach_after
        half = 0.5 * math.acos(float(np.clip(before @ after, -1, 1)))
        if not math.radians(3) < half < math.radians(88):
            points.append((radius, z))
            continue
        back = min(rounding / math.tan(half), 0.48 * reach_before, 0.48 * reach_after)
        start, end = np.array((radius, z)) + back * before, np.array((radius, z)) + back * after
        for t in np.linspace(0, 1, 5):
            # a quadratic curve is as good as an arc at these sizes
            x, y = (1 - t) ** 2 * start + 2 * t * (1 - t) * np.array((radius, z)) + t * t * end
            points.append((float(x), float(y)))
    return points


def turned_eased(profile_mm: Sequence[tuple[float, float, float]]) -> Manifold:
    """Revolve a counter-clockwise (radius, z, corner radius) profile about the z axis."""
    return turned(eased(profile_mm))


def largest_piece(body: Manifold) -> Manifold:
    """Drop what a cut left hanging in the air."""
    pieces = body.decompose()
    return body if len(pieces) < 2 else max(pieces, key=lambda piece: piece.volume())
