"""What a person changed in a review is what `locate` says of the motor (simulated)."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from boltpose.geometry.transforms import Transform, angle_between_rad
from boltpose.locate import locate
from boltpose.prior.file import read_prior, write_prior
from boltpose.prior.review import ReviewSession
from boltpose.prior.review_edits import (
    AddBolt,
    FlipBolt,
    NameBolt,
    RemoveBolt,
    SetOrders,
    SetTool,
)
from boltpose.results import dump_json
from boltpose.robot import plan_tools
from boltpose.schema import LocateResult, Prior, Visibility
from tests.support import reman18

MOTOR, VIEW = "motor_011", 1


def located(prior: Prior) -> LocateResult:
    scan, predictor = reman18.view(MOTOR, VIEW)
    base_from_camera = Transform.from_parts("base", "camera", np.eye(3), (900.0, 0.0, 300.0))
    return locate(scan, prior, base_from_camera, predictor)


@pytest.fixture(scope="module")
def before() -> LocateResult:
    return located(reman18.true_prior(MOTOR))


def test_what_a_person_changed_is_what_locate_says(before: LocateResult, tmp_path: Path) -> None:
    prior = reman18.true_prior(MOTOR)
    seen, turned = [b for b in before.bolts if b.visibility is Visibility.VISIBLE]
    hidden, gone, *_ = [b for b in before.bolts if b.visibility is Visibility.HIDDEN]
    path = tmp_path / "m.prior.npz"
    write_prior(path, prior)
    with ReviewSession.open(path) as session:
        for bolt in (seen, hidden):  # taken out and put back by a click beside the axis
            session.do(RemoveBolt(bolt=bolt.id))
            x, y, z = prior.bolt(bolt.id).prior_from_bolt.apply([1.5, 1.0, 0.0])
            session.do(AddBolt(position_mm=(x, y, z)))
        session.do(RemoveBolt(bolt=gone.id))
        made = session.do(FlipBolt(bolt=turned.id))
        session.do(NameBolt(bolt=seen.id, name="Ölpumpe links"))
        session.do(SetTool(bolts=(seen.id, hidden.id), tool="hex 8"))
        session.do(SetOrders(orders=((seen.id, 2), (hidden.id, 1))))
        session.save(by="A. Technician", date="2026-11-23")
    assert made is not None

    result = located(read_prior(path))

    assert result.is_ok
    after = {bolt.id: bolt for bolt in result.bolts}
    assert set(after) == ({bolt.id for bolt in before.bolts} - {gone.id, turned.id}) | {made.id}
    # put back: where it was, and seen as much of as before
    for bolt in (seen, hidden):
        again = after[bolt.id]
        assert np.linalg.norm(again.head_top - bolt.head_top) < 0.1
        assert angle_between_rad(again.axis, bolt.axis) < 1e-3
        assert again.visibility is bolt.visibility
        assert again.state is bolt.state
        assert again.tool == "hex 8"
    # removed: nothing stands there, but a head that the prior does not know may be told
    assert min(np.linalg.norm(b.head_top - gone.head_top) for b in result.bolts) > 5.0
    plan = plan_tools(result)
    assert plan.poses[0].bolt.id == seen.id
    # turned against what the scan shows: no robot goes there
    flipped = after[made.id]
    assert angle_between_rad(flipped.axis, -turned.axis) < 1e-2
    assert not flipped.is_sure
    assert made.id not in {pose.bolt.id for pose in plan.poses}
    (row,) = [b for b in json.loads(dump_json(result))["bolts"] if b["id"] == seen.id]
    assert (row["name"], row["tool"], row["order"]) == ("Ölpumpe links", "hex 8", 2)
    assert after[hidden.id].order == 1
