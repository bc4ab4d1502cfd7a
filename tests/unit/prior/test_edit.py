from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boltpose.errors import ConfigError
from boltpose.prior.edit import (
    ADDED,
    CONFIRMED,
    FLIPPED,
    EditConfig,
    add_bolt,
    confirm_bolt,
    flip_bolt,
    remove_bolt,
)
from boltpose.schema import Prior, Side
from tests.support import records, reman18


@pytest.fixture(scope="module")
def prior() -> Prior:
    return reman18.true_prior("motor_011")


def test_a_removed_bolt_comes_back_from_a_click_beside_its_axis(prior: Prior) -> None:
    lost = prior.bolt("B1")
    click = lost.prior_from_bolt.apply([1.5, 1.0, 0.0])

    again = add_bolt(remove_bolt(prior, "B1"), click)

    found = again.bolt("B1")
    offset = lost.prior_from_bolt.inverse().apply(found.prior_from_bolt.translation_mm)
    assert np.hypot(offset[0], offset[1]) < 0.15
    assert abs(offset[2]) < 0.3
    assert found.side is lost.side
    assert ADDED in found.remarks
    assert [bolt.id for bolt in again.bolts] == [bolt.id for bolt in prior.bolts]


def test_removing_leaves_the_other_ids_alone(prior: Prior) -> None:
    ids = [bolt.id for bolt in prior.bolts]
    assert [bolt.id for bolt in remove_bolt(prior, ids[0]).bolts] == ids[1:]
    with pytest.raises(ConfigError, match=r"no bolt 'X9' in prior 'motor_011', there are \['T1'"):
        remove_bolt(prior, "X9")


def test_the_same_bolt_is_never_added_twice(prior: Prior) -> None:
    with pytest.raises(ConfigError, match="bolt T1 is already at"):
        add_bolt(prior, prior.bolt("T1").prior_from_bolt.translation_mm)


def test_a_click_off_the_motor_is_refused(prior: Prior) -> None:
    with pytest.raises(ConfigError, match="no surface at 9999,0,0: the nearest scan point is"):
        add_bolt(prior, (9999.0, 0.0, 0.0))


def test_where_no_head_is_the_click_itself_is_taken_and_said_so(prior: Prior) -> None:
    motor_from_prior = prior.alignment.prior_from_motor.inverse()
    local = motor_from_prior.apply(prior.points)
    # half way up the housing's bare wall, away from every bolt
    heads = np.array([b.prior_from_bolt.translation_mm for b in prior.bolts])
    gaps = np.linalg.norm(prior.points[:, None] - heads[None], axis=2).min(axis=1)
    wall = (prior.labels == 1) & (gaps > 25) & (np.abs(local[:, 0]) > 20)
    click = prior.points[np.flatnonzero(wall)[0]]

    bolt = add_bolt(prior, click).bolts
    added = next(b for b in bolt if any(ADDED in remark for remark in b.remarks))

    np.testing.assert_allclose(added.prior_from_bolt.translation_mm, click)
    assert added.sigma_lateral_mm == EditConfig().unfitted_sigma_mm
    assert "no head could be fitted" in added.remarks[0]


def test_confirming_makes_sure_and_keeps_the_numbers(prior: Prior) -> None:
    doubted = replace(
        prior,
        bolts=tuple(replace(b, is_sure=False, remarks=("little flank",)) for b in prior.bolts),
    )
    bolt = confirm_bolt(doubted, "T1").bolt("T1")
    assert bolt.is_sure
    assert bolt.remarks == ("little flank", CONFIRMED)
    assert bolt.sigma_lateral_mm == prior.bolt("T1").sigma_lateral_mm
    assert confirm_bolt(confirm_bolt(doubted, "T1"), "T1").bolt("T1").remarks == bolt.remarks


@pytest.mark.parametrize("beside", [(0.0, 0.0, 0.0), (4.5, 0.0, -0.5), (-2.0, 4.0, -2.5)])
def test_a_click_anywhere_on_a_head_means_that_head(
    prior: Prior, beside: tuple[float, float, float]
) -> None:
    for bolt_id in ("T1", "B1"):
        lost = prior.bolt(bolt_id)
        again = add_bolt(remove_bolt(prior, bolt_id), lost.prior_from_bolt.apply(beside))
        found = again.bolt(bolt_id)
        x, y, z = lost.prior_from_bolt.inverse().apply(found.prior_from_bolt.translation_mm)
        assert np.hypot(x, y) < 0.02
        assert abs(z) < 0.02
        assert found.is_sure
        assert found.confidence == 1.0


def test_the_same_click_gives_the_same_bits(prior: Prior) -> None:
    rest, click = remove_bolt(prior, "T1"), prior.bolt("T1").prior_from_bolt.apply([2.0, 1.0, 0.0])
    first, second = add_bolt(rest, click).bolt("T1"), add_bolt(rest, click).bolt("T1")
    assert first.prior_from_bolt.matrix.tobytes() == second.prior_from_bolt.matrix.tobytes()


def test_what_rests_on_the_click_alone_is_unsure_until_it_is_confirmed() -> None:
    cloud = records.prior()
    added = add_bolt(cloud, cloud.points[7])
    (bolt,) = (b for b in added.bolts if b.id not in {"T1", "B1"})
    assert not bolt.is_sure
    assert bolt.confidence < 0.2
    assert confirm_bolt(added, bolt.id).bolt(bolt.id).is_sure


@given(seed=st.integers(0, 2**32 - 1), height_mm=st.floats(0.5, 20.0), is_top=st.booleans())
def test_a_flipped_head_stays_where_it_is_and_looks_the_other_way(
    seed: int, height_mm: float, is_top: bool
) -> None:
    bolt_id = "T1" if is_top else "B1"
    bolt = replace(
        records.prior_bolt(bolt_id, seed=seed),
        head_height_mm=height_mm,
        name="n",
        tool="t",
        order=3,
    )
    before = replace(records.prior(bolt), points=np.zeros((0, 3)), normals=np.zeros((0, 3)))
    before = replace(before, labels=np.zeros(0, dtype=np.uint8))

    (turned,) = flip_bolt(before, bolt_id).bolts

    assert turned.id == ("B1" if is_top else "T1")
    assert turned.side is (Side.BOTTOM if is_top else Side.TOP)
    assert (turned.name, turned.tool, turned.order) == ("n", "t", 3)
    assert not turned.is_sure
    assert turned.sigma_axial_mm >= EditConfig().unfitted_sigma_mm
    old, new = bolt.prior_from_bolt, turned.prior_from_bolt
    np.testing.assert_allclose(new.z_axis, -old.z_axis, atol=1e-12)
    np.testing.assert_allclose(
        new.translation_mm, old.translation_mm - height_mm * old.z_axis, atol=1e-9
    )
    assert np.linalg.det(new.rotation) == pytest.approx(1.0)
    # every point of the head is in the head still
    middle = [0.0, 0.0, -height_mm / 2]
    np.testing.assert_allclose(new.apply(middle), old.apply(middle), atol=1e-9)
    (back,) = flip_bolt(flip_bolt(before, bolt_id), turned.id).bolts
    np.testing.assert_allclose(back.prior_from_bolt.matrix, old.matrix, atol=1e-9)


def test_a_bolt_on_the_wrong_side_is_measured_where_its_head_is(prior: Prior) -> None:
    right = prior.bolt("B1")
    wrong = flip_bolt(replace(prior, bolts=(right,)), "B1")
    assert not wrong.bolts[0].is_sure

    (again,) = flip_bolt(wrong, wrong.bolts[0].id).bolts

    assert again.is_sure
    assert FLIPPED in again.remarks
    gap = again.prior_from_bolt.translation_mm - right.prior_from_bolt.translation_mm
    assert np.linalg.norm(gap) < 0.02


def test_a_bolt_is_not_flipped_onto_another(prior: Prior) -> None:
    right = prior.bolt("B1")
    wrong = flip_bolt(replace(prior, bolts=(right,)), "B1").bolts[0]
    with pytest.raises(ConfigError, match="bolt B1 is already at the other side of T1"):
        flip_bolt(replace(prior, bolts=(right, replace(wrong, id="T1"))), "T1")


def test_a_head_that_the_scan_shows_looking_the_other_way_is_never_confirmed(prior: Prior) -> None:
    for bolt in (prior.bolt("T1"), prior.bolt("B1")):
        assert confirm_bolt(prior, bolt.id).bolt(bolt.id).is_sure
        wrong = flip_bolt(replace(prior, bolts=(bolt,)), bolt.id)
        with pytest.raises(ConfigError, match="the tool would come through the motor; flip it"):
            confirm_bolt(wrong, wrong.bolts[0].id)
        # back again it is right
        right = flip_bolt(wrong, wrong.bolts[0].id)
        assert confirm_bolt(right, right.bolts[0].id).bolts[0].is_sure


def test_where_the_scan_shows_no_head_a_person_is_believed(prior: Prior) -> None:
    bolt = prior.bolts[0]
    bare = replace(
        prior, bolts=(bolt,), points=np.zeros((0, 3)), normals=np.zeros((0, 3)),
        labels=np.zeros(0, dtype=np.uint8),
    )  # fmt: skip
    wrong = flip_bolt(bare, bolt.id)
    assert confirm_bolt(wrong, wrong.bolts[0].id).bolts[0].is_sure
