from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from boltpose.arrays import FloatArray
from boltpose.errors import ConfigError, ShapeError
from boltpose.prior.clustering import ClusterConfig, cluster_points
from boltpose.prior.find_bolts import FindBoltsConfig, find_bolts
from boltpose.prior.head_hough import HoughConfig
from boltpose.prior.heads import HeadConfig
from boltpose.schema import Part, PriorBolt, Side
from tests.support.toy_heads import PLATE_MM, ToyHead, ToyPlate, toy_plate, true_alignment

FOUR = (
    ToyHead(x=0.0, y=20.0),
    ToyHead(x=-18.0, y=2.0, corners=0, radius=4.0, height=3.0),
    ToyHead(x=15.0, y=-12.0, radius=6.5, height=6.0, corners=0, seen_deg=220.0),
    ToyHead(x=5.0, y=-3.0, side=Side.BOTTOM, radius=4.0, height=3.5),
)


def found(plate: ToyPlate, probabilities: FloatArray | None = None) -> tuple[PriorBolt, ...]:
    shares = plate.probabilities() if probabilities is None else probabilities
    return find_bolts(plate.points, plate.normals, shares, true_alignment())


def found_without_proposals(plate: ToyPlate, shares: FloatArray) -> tuple[PriorBolt, ...]:
    config = FindBoltsConfig(hough=HoughConfig(max_candidates=0))
    return find_bolts(plate.points, plate.normals, shares, true_alignment(), config)


def head_top(head: ToyHead) -> FloatArray:
    z = PLATE_MM / 2 - head.sunk + head.height
    return np.array([head.x, head.y, z if head.side is Side.TOP else -z])


def assert_is(bolt: PriorBolt, head: ToyHead, lateral_mm: float = 0.1) -> None:
    offset = bolt.prior_from_bolt.translation_mm - head_top(head)
    assert float(np.linalg.norm(offset[:2])) < lateral_mm
    assert abs(offset[2]) < 0.12
    assert bolt.side is head.side
    assert bolt.head_diameter_mm == pytest.approx(2 * head.radius, abs=0.4)
    axis = [0, 0, 1] if head.side is Side.TOP else [0, 0, -1]
    np.testing.assert_allclose(bolt.prior_from_bolt.z_axis, axis, atol=1e-12)


def soft(plate: ToyPlate, bolt_probability: FloatArray) -> FloatArray:
    """Probabilities with that of class bolt given, the rest to the connector."""
    shares = np.zeros((len(plate.points), 6))
    shares[:, Part.BOLT - 1] = bolt_probability
    shares[:, Part.CONNECTOR - 1] = 1 - bolt_probability
    return shares


def test_every_bolt_is_found_once_with_side_top_and_size() -> None:
    bolts = found(toy_plate(FOUR))
    assert [bolt.id for bolt in bolts] == ["T1", "T2", "T3", "B1"]
    for bolt, head in zip(bolts, FOUR, strict=True):
        assert_is(bolt, head)
        assert bolt.is_sure, bolt.remarks
        assert np.linalg.det(bolt.prior_from_bolt.rotation) == pytest.approx(1.0, abs=1e-12)


def test_numbers_go_round_z_from_y_and_outward() -> None:
    places = [(0.3, 25.0), (-0.3, 10.0), (-20.0, 0.0), (0.0, -20.0), (20.0, 0.0)]
    heads = [ToyHead(x=x, y=y, radius=4.0) for x, y in places]
    bolts = found(toy_plate(heads))
    assert [bolt.id for bolt in bolts] == ["T1", "T2", "T3", "T4", "T5"]
    order = [bolt.prior_from_bolt.translation_mm[:2] for bolt in bolts]
    # both on the y axis but for noise: the bolt at the smaller angle is the first
    np.testing.assert_allclose(order, [places[k] for k in (0, 1, 2, 3, 4)], atol=0.2)


def test_the_cluster_centre_is_the_mean_of_the_bolts_points() -> None:
    plate = toy_plate(FOUR[:1])
    (bolt,) = found(plate)
    own = plate.points[plate.labels == Part.BOLT]
    np.testing.assert_allclose(bolt.cluster_centre, own.mean(axis=0), atol=1e-9)
    assert bolt.point_count == len(own)
    assert bolt.class_probability == pytest.approx(1.0, abs=0.02)


def test_two_heads_in_one_cluster_are_two_bolts() -> None:
    heads = [ToyHead(x=-5.8, y=0.0), ToyHead(x=5.8, y=0.0)]
    plate = toy_plate(heads)
    # labels bleed over the gap: one connected patch
    bleeding = (np.abs(plate.points[:, 0]) < 6) & (np.abs(plate.points[:, 1]) < 4)
    shares = soft(
        plate, ((plate.labels == Part.BOLT) | (bleeding & (plate.points[:, 2] > 0))) * 1.0
    )
    seeds = plate.points[shares[:, Part.BOLT - 1] > 0.5]
    assert len(cluster_points(seeds, ClusterConfig())) == 1
    bolts = found(plate, shares)
    assert len(bolts) == 2
    for head in heads:
        near = [
            b for b in bolts if np.hypot(*(b.prior_from_bolt.translation_mm[:2] - (head.x, 0))) < 1
        ]
        assert len(near) == 1
        assert_is(near[0], head)


def test_one_head_in_two_clusters_is_one_bolt() -> None:
    plate = toy_plate(FOUR[2:3])
    x = plate.points[:, 0] - 15.0
    shares = soft(plate, ((plate.labels == Part.BOLT) & (np.abs(x) > 1.8)) * 1.0)
    seeds = plate.points[shares[:, Part.BOLT - 1] > 0.5]
    assert len(cluster_points(seeds, ClusterConfig())) == 2
    (bolt,) = found(plate, shares)
    assert_is(bolt, FOUR[2], lateral_mm=0.15)


def test_debris_and_flat_patches_are_dropped() -> None:
    plate = toy_plate(FOUR[:1])
    x, y, z = plate.points.T
    patch = (np.hypot(x - 15, y + 15) < 5) & (z > 0)
    speck = (np.hypot(x + 20, y + 20) < 1.5) & (z > 0)
    probability = (plate.labels == Part.BOLT) * 1.0
    probability[patch] = 0.7
    probability[speck] = 1.0
    (bolt,) = found(plate, soft(plate, probability))
    assert_is(bolt, FOUR[0])


def test_a_nut_on_a_terminal_is_no_bolt() -> None:
    heads = [FOUR[0], ToyHead(x=15.0, y=-12.0, part=Part.ELECTRICAL_CONNECTOR)]
    plate = toy_plate(heads)
    shares = plate.probabilities()
    nut = plate.labels == Part.ELECTRICAL_CONNECTOR
    shares[nut, Part.BOLT - 1] = 0.4
    shares[nut, Part.ELECTRICAL_CONNECTOR - 1] = 0.6
    (bolt,) = found(plate, shares)
    assert_is(bolt, heads[0])


def test_a_head_the_network_doubts_is_kept_but_not_sure() -> None:
    plate = toy_plate(FOUR[:1])
    (bolt,) = found(plate, soft(plate, (plate.labels == Part.BOLT) * 0.4))
    assert_is(bolt, FOUR[0])
    assert not bolt.is_sure
    assert "network doubts" in bolt.remarks[0]


def test_a_head_without_flank_is_kept_with_a_wide_sigma_and_not_sure() -> None:
    plate = toy_plate([ToyHead(x=0.0, y=0.0, corners=0, seen_deg=0.0)])
    (bolt,) = found(plate)
    np.testing.assert_allclose(bolt.prior_from_bolt.translation_mm[:2], 0.0, atol=0.6)
    assert bolt.prior_from_bolt.translation_mm[2] == pytest.approx(14.0, abs=0.12)
    assert bolt.head_fit_support == 0.0
    assert bolt.sigma_lateral_mm >= 0.5
    assert not bolt.is_sure
    assert "no flank" in bolt.remarks[0]


def test_labels_on_the_flank_mostly_still_give_the_top_of_the_head() -> None:
    plate = toy_plate(FOUR[2:3])
    on_top = plate.points[:, 2] > head_top(FOUR[2])[2] - 3.0
    shares = soft(plate, (plate.labels == Part.BOLT) * np.where(on_top, 0.45, 1.0))
    bolts = found(plate, shares)
    assert len(bolts) == 1
    assert_is(bolts[0], FOUR[2])


def test_a_head_the_labels_missed_is_found_by_its_shape() -> None:
    plate = toy_plate(FOUR[:2])
    # below the probability that makes a cluster
    shares = soft(plate, (plate.labels == Part.BOLT) * 0.22)
    assert found_without_proposals(plate, shares) == ()
    bolts = found(plate, shares)
    assert len(bolts) == 2
    for bolt, head in zip(bolts, FOUR[:2], strict=True):
        assert_is(bolt, head)
        assert not bolt.is_sure
        assert bolt.confidence < 0.5


def test_a_round_thing_the_network_rules_out_is_no_bolt() -> None:
    plate = toy_plate(FOUR)
    assert found(plate, soft(plate, np.zeros(len(plate.points)))) == ()


def test_proposals_add_nothing_to_what_the_labels_show() -> None:
    plate = toy_plate(FOUR)
    shares = plate.probabilities()
    with_proposals, without = found(plate, shares), found_without_proposals(plate, shares)
    assert [bolt.id for bolt in with_proposals] == [bolt.id for bolt in without]
    for first, second in zip(with_proposals, without, strict=True):
        np.testing.assert_array_equal(first.prior_from_bolt.matrix, second.prior_from_bolt.matrix)


def test_confidence_follows_the_class_probability_and_decides_with_the_rest_on_sure() -> None:
    plate = toy_plate(FOUR[:1])
    confidences = []
    for probability in (0.35, 0.6, 0.75, 1.0):
        (bolt,) = found(plate, soft(plate, (plate.labels == Part.BOLT) * probability))
        confidences.append(bolt.confidence)
        assert bolt.is_sure == (bolt.confidence >= 0.8)
    assert confidences == sorted(confidences)
    assert confidences[0] < 0.5
    assert confidences[-1] > 0.98


def test_a_small_round_thing_with_little_flank_is_never_sure_whatever_the_network_says() -> None:
    thing = ToyHead(x=0.0, y=0.0, radius=2.6, height=1.2, corners=0, seen_deg=120.0)
    for bolt in found(toy_plate([thing])):
        assert not bolt.is_sure
        assert bolt.confidence < 0.6


def test_sigma_grows_where_less_is_seen() -> None:
    full, half = (
        found(toy_plate([ToyHead(x=0.0, y=0.0, corners=0, seen_deg=seen)]))[0]
        for seen in (360.0, 150.0)
    )
    assert half.sigma_lateral_mm > full.sigma_lateral_mm
    assert half.head_fit_support < full.head_fit_support


def test_no_bolt_points_no_bolts() -> None:
    plate = toy_plate([])
    assert found(plate) == ()


@pytest.mark.parametrize("broken", ["shape", "nan"])
def test_probabilities_that_do_not_fit_are_refused(broken: str) -> None:
    plate = toy_plate([])
    shares = plate.probabilities()
    if broken == "shape":
        shares = shares[:, :5]
    else:
        shares[0, 0] = np.nan
    with pytest.raises(ShapeError, match="probabilities"):
        found(plate, shares)


@pytest.mark.parametrize(
    ("config", "settings"),
    [
        (FindBoltsConfig, {"sure_support": 0.0}),
        (FindBoltsConfig, {"min_face_coverage": 1.5}),
        (FindBoltsConfig, {"sure_sigma_mm": float("nan")}),
        (HeadConfig, {"seed_probability": 0.0}),
        (HeadConfig, {"face_percentile": 101.0}),
        (HeadConfig, {"normal_neighbours": 2}),
        (HeadConfig, {"max_step_mm": 0.0}),
        (HoughConfig, {"radii_mm": ()}),
        (HoughConfig, {"cell_mm": 0.0}),
        (HoughConfig, {"min_sectors": 13}),
        (HoughConfig, {"max_candidates": -1}),
        (ClusterConfig, {"eps_mm": 0.0}),
        (ClusterConfig, {"min_points": 0}),
    ],
)
def test_settings_out_of_range_are_refused(config: type, settings: dict) -> None:
    with pytest.raises(ConfigError):
        config(**settings)


def test_clusters_do_not_depend_on_the_order_of_points() -> None:
    rng = np.random.default_rng(0)
    clumps: Sequence[FloatArray] = [
        rng.normal(scale=1.5, size=(80, 3)) + centre for centre in ((0, 0, 0), (12, 0, 0))
    ]
    points = np.concatenate(clumps)
    shuffled = rng.permutation(len(points))
    first = {frozenset(group.tolist()) for group in cluster_points(points, ClusterConfig())}
    second = {
        frozenset(shuffled[group].tolist())
        for group in cluster_points(points[shuffled], ClusterConfig())
    }
    assert first == second
    assert len(first) == 2
