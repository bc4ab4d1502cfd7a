from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from boltpose.errors import ConfigError
from boltpose.prior.edit import ADDED, CONFIRMED, EditConfig, add_bolt, confirm_bolt, remove_bolt
from boltpose.schema import Prior
from tests.support import reman18


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
