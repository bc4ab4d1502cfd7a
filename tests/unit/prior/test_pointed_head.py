from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from boltpose.errors import ConfigError
from boltpose.prior.edit import add_bolt, remove_bolt
from boltpose.prior.pointed_head import FLANK_ONLY, PointedHeadConfig
from boltpose.prior.review_edits import made_bolt
from boltpose.schema import Part, Prior, PriorBolt
from tests.support import reman18

MOTOR = "motor_011"


@pytest.fixture(scope="module")
def prior() -> Prior:
    return reman18.true_prior(MOTOR)


def put_back(prior: Prior, bolt: PriorBolt) -> PriorBolt:
    rest = remove_bolt(prior, bolt.id)
    made = made_bolt(rest, add_bolt(rest, bolt.prior_from_bolt.apply([1.0, 0.5, 0.0])))
    assert made is not None
    return made


def true_height_mm(bolt: PriorBolt) -> float:
    bolts = json.loads((reman18.ROOT / MOTOR / "prior_gt.json").read_text())["bolts"]
    top = bolt.prior_from_bolt.translation_mm
    nearest = min(bolts, key=lambda b: float(np.linalg.norm(np.array(b["C"]["head_top"]) - top)))
    return nearest["head_height"]


def test_a_head_without_labels_ends_where_its_flank_ends(prior: Prior) -> None:
    unlabelled = replace(
        prior, labels=np.where(prior.labels == Part.BOLT, np.uint8(Part.CONNECTOR), prior.labels)
    )
    for bolt in prior.bolts:
        made = put_back(unlabelled, bolt)
        assert abs(made.head_height_mm - true_height_mm(bolt)) < 0.3
        assert FLANK_ONLY in made.remarks
        assert made.is_sure
        offset = bolt.prior_from_bolt.inverse().apply(made.prior_from_bolt.translation_mm)
        assert np.abs(offset).max() < 0.1


def test_nothing_is_said_of_the_height_where_the_labels_give_it(prior: Prior) -> None:
    assert FLANK_ONLY not in put_back(prior, prior.bolt("B1")).remarks


@pytest.mark.parametrize("count", [0, 13])
def test_sectors_are_of_twelve(count: int) -> None:
    with pytest.raises(ConfigError, match="min_flank_sectors must be 1 to 12"):
        PointedHeadConfig(min_flank_sectors=count)
