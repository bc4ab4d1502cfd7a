"""What a structured-light camera does to its depth image: edges mix, then its filters run.

Images have shape (H, W), hold mm along the optical axis and 0 for no measurement, and are changed
in place.
"""

from __future__ import annotations

import numpy as np

from boltpose.arrays import BoolArray, FloatArray, IntArray

_PAIRS = (((0, 1), 0.125), ((1, 0), 0.125), ((1, 1), 0.0625), ((1, -1), 0.0625))
"""Half of a 3 x 3 binomial kernel: a neighbour, and its weight and that of its opposite."""
_CENTRE = 0.25


def binomial_noise_gain(strength: float) -> float:
    """Factor by which `smooth_depth` shrinks independent noise inside a surface."""
    sides = sum(2 * (strength * weight) ** 2 for _, weight in _PAIRS)
    return float(np.sqrt((1 - strength * (1 - _CENTRE)) ** 2 + sides))


def mix_edges(image: FloatArray, edge_mm: float, share: float, rng: np.random.Generator) -> None:
    """Give some pixels at steps in depth a value between the two sides.

    Args:
        image: Changed in place.
        edge_mm: Smallest step that counts.
        share: Share of the steps that mix, 0 to 1.
        rng: Draws which, on which side, and where between.
    """
    if share <= 0:
        return
    width = image.shape[1]
    flat = image.reshape(-1)
    targets: list[IntArray] = []
    values: list[FloatArray] = []
    for step, near, far in (
        (1, image[:, :-1], image[:, 1:]),
        (width, image[:-1], image[1:]),
    ):
        # holes are at zero, so steps into them are long: they drop out just below
        rows, columns = np.nonzero(np.abs(near - far) > edge_mm)
        first = rows * width + columns
        first = first[_is_edge(flat, first, step, edge_mm)]
        first = first[rng.random(len(first)) < share]
        second = first + step
        part = rng.random(len(first))
        # the pixel that holds the edge is the one whose own surface fills most of it
        owner = np.where(rng.random(len(first)) < 0.5, first, second)
        targets.append(owner)
        values.append(flat[first] * (1 - part) + flat[second] * part)
    flat[np.concatenate(targets)] = np.concatenate(values)


def _is_edge(flat: FloatArray, first: IntArray, step: int, edge_mm: float) -> BoolArray:
    """Tell jumps from slopes: on a steep surface the pixels beside a step go on like it.

    Args:
        flat: The image as one row.
        first: Pixels whose partner is `step` further on.
        step: 1 for a partner to the right, the width for one below.
        edge_mm: A jump differs more than this from what goes before and from what follows.
    """
    near, far = flat[first], flat[first + step]
    jump = far - near
    before = flat[np.maximum(first - step, 0)]
    after = flat[np.minimum(first + 2 * step, len(flat) - 1)]
    goes_on = (before > 0) & (np.abs(near - before - jump) < edge_mm)
    goes_on |= (after > 0) & (np.abs(after - far - jump) < edge_mm)
    return np.asarray((near > 0) & (far > 0) & ~goes_on)


def smooth_depth(image: FloatArray, strength: float, edge_mm: float) -> None:
    """Average 3 x 3 pixels of one surface.

    A neighbour takes part together with the one opposite, if both are measured and the three are
    within `edge_mm` of a line; a plane, however tilted, stays where it is, and rims are kept.

    Args:
        image: Changed in place.
        strength: 0 leaves all as it is, 1 is the full binomial mean.
        edge_mm: Larger bends are edges.
    """
    if strength <= 0:
        return
    rows, columns = image.shape
    centre = image[1:-1, 1:-1]
    # single precision is enough for a correction, and half the memory traffic
    shift = np.zeros(centre.shape, dtype=np.float32)
    limit = np.float32(edge_mm)
    for (down, right), weight in _PAIRS:
        after = image[1 + down : rows - 1 + down, 1 + right : columns - 1 + right]
        before = image[1 - down : rows - 1 - down, 1 - right : columns - 1 - right]
        bend = (0.5 * (after + before) - centre).astype(np.float32)
        keep = (np.abs(bend) < limit) & (after > 0) & (before > 0)
        shift += np.where(keep, np.float32(2 * weight * strength) * bend, np.float32(0))
    shift[centre == 0] = 0
    centre += shift


def remove_lone_pixels(image: FloatArray, lone_mm: float, min_neighbours: int) -> None:
    """Remove pixels that too few of their eight neighbours support.

    Args:
        image: Changed in place.
        lone_mm: Neighbours within this difference of depth support a pixel.
        min_neighbours: How many must.
    """
    if min_neighbours <= 0:
        return
    rows, columns = image.shape
    depth = image.astype(np.float32)
    support = np.zeros(image.shape, dtype=np.int8)
    limit = np.float32(lone_mm)
    for (down, right), _ in _PAIRS:
        one = (slice(0, rows - down), slice(max(0, -right), columns - max(0, right)))
        other = (slice(down, rows), slice(max(0, right), columns - max(0, -right)))
        close: BoolArray = np.abs(depth[one] - depth[other]) < limit
        support[one] += close
        support[other] += close
    # holes may support holes: they are removed as well and stay what they are
    image[support < min_neighbours] = 0
