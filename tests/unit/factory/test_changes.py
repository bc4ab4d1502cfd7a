from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from boltpose.errors import ConfigError
from boltpose.factory.changes import ChangeKind, ChangeRates, change_motor, draw_changes
from boltpose.factory.model import Material, MotorModel, SolidPart
from boltpose.geometry.transforms import angle_between_rad
from tests.unit.factory.small_motor import is_closed, small_motor, volume_mm3

NEVER: dict[str, Any] = {kind.value: 0.0 for kind in ChangeKind}


def only(**rates: float) -> ChangeRates:
    return ChangeRates(**{**NEVER, **rates})


def part(model: MotorModel, name: str) -> SolidPart | None:
    return next((p for p in model.parts if p.name == f"electrical_connector_{name}"), None)


def test_without_any_chance_nothing_changes() -> None:
    changed = draw_changes(small_motor(), np.random.default_rng(1), only())
    assert changed.changes == ()
    assert changed.model.parts == small_motor().parts
    assert changed.model.bolts == small_motor().bolts


def test_the_same_seed_changes_the_same() -> None:
    rates = ChangeRates(cable_aside=0.9, bolt_replaced=0.5, nut_gone=0.5, fresh_grease=0.9)
    one, two = (draw_changes(small_motor(), np.random.default_rng(4), rates) for _ in range(2))
    assert one.changes == two.changes
    for a, b in zip(one.model.parts, two.model.parts, strict=True):
        np.testing.assert_array_equal(a.vertices, b.vertices)
    same = change_motor(small_motor(), np.random.default_rng(4), rates)
    assert [p.name for p in same.parts] == [p.name for p in one.model.parts]


@pytest.mark.parametrize("seed", range(6))
def test_whatever_happens_parts_stay_closed_and_bolts_accounted_for(seed: int) -> None:
    everything = ChangeRates(
        cable_aside=0.5,
        cable_gone=0.4,
        plug_broken=0.5,
        nut_gone=0.5,
        fresh_grease=0.5,
        bolt_lost=0.3,
        bolt_replaced=0.4,
    )
    model = small_motor()
    changed = draw_changes(model, np.random.default_rng(seed), everything)
    for solid in changed.model.parts:
        assert is_closed(solid.faces), solid.name
        assert volume_mm3(solid) > 0, solid.name
    kept = {bolt.id for bolt in changed.model.bolts}
    assert kept.isdisjoint(changed.lost)
    assert kept | set(changed.lost) == {bolt.id for bolt in model.bolts}
    assert {solid.bolt_id for solid in changed.model.parts if solid.bolt_id} == kept


def test_a_cable_pushed_aside_keeps_its_ends() -> None:
    before = part(small_motor(), "cable")
    changed = draw_changes(small_motor(), np.random.default_rng(0), only(cable_aside=1))
    after = part(changed.model, "cable")
    assert before is not None
    assert after is not None
    moved = np.linalg.norm(after.vertices - before.vertices, axis=1)
    assert 1 < moved.max() <= 7.0
    for name in ("lug", "grommet"):
        anchor = part(small_motor(), name)
        assert anchor is not None
        centre = 0.5 * (anchor.vertices.min(axis=0) + anchor.vertices.max(axis=0))
        nearest = np.argsort(np.linalg.norm(before.vertices - centre, axis=1))[:20]
        assert moved[nearest].max() < 0.6


def test_a_lost_cable_leaves_grommet_and_stud() -> None:
    changed = draw_changes(small_motor(), np.random.default_rng(0), only(cable_gone=1)).model
    assert part(changed, "cable") is None
    assert part(changed, "lug") is None
    assert part(changed, "grommet") is not None
    assert part(changed, "stud_1") is not None


def test_a_broken_plug_leaves_a_stump() -> None:
    before = part(small_motor(), "plug")
    changed = draw_changes(small_motor(), np.random.default_rng(0), only(plug_broken=1)).model
    after = part(changed, "plug")
    assert before is not None
    assert after is not None
    # a plug of 18 mm on the back of the solenoid's cap, looking along -z
    cut = after.vertices[:, 2].min() - before.vertices[:, 2].min()
    assert cut == pytest.approx(0.75 * 18, abs=0.01)


def test_lost_nuts_leave_bare_studs() -> None:
    before = part(small_motor(), "stud_2")
    changed = draw_changes(small_motor(), np.random.default_rng(0), only(nut_gone=1)).model
    after = part(changed, "stud_2")
    assert before is not None
    assert after is not None
    assert np.ptp(after.vertices[:, 0]) == pytest.approx(8, abs=0.05)
    assert np.ptp(before.vertices[:, 0]) > 12


def test_a_replaced_bolt_keeps_axis_and_seat_and_id() -> None:
    model = small_motor()
    changed = draw_changes(model, np.random.default_rng(2), only(bolt_replaced=1)).model
    assert [bolt.id for bolt in changed.bolts] == [bolt.id for bolt in model.bolts]
    for old, new in zip(model.bolts, changed.bolts, strict=True):
        assert new.spec.head != old.spec.head
        assert angle_between_rad(old.axis, new.axis) == 0
        seats = [bolt.head_top - bolt.head_height_mm * bolt.axis for bolt in (old, new)]
        np.testing.assert_allclose(seats[0], seats[1], atol=1e-9)
        (solid,) = (p for p in changed.parts if p.bolt_id == new.id)
        local = new.motor_from_bolt.inverse().apply(solid.vertices)
        assert local[:, 2].max() == pytest.approx(0, abs=1e-6)


def test_fresh_grease_is_a_part_of_its_own() -> None:
    changed = draw_changes(small_motor(), np.random.default_rng(2), only(fresh_grease=1))
    (change,) = changed.changes
    (lump,) = (p for p in changed.model.parts if p.name == change.subject)
    assert lump.material is Material.GREASE


def test_rates_are_checked() -> None:
    with pytest.raises(ConfigError, match="bolt_lost must be 0 to 1, got 2"):
        ChangeRates(bolt_lost=2)
    with pytest.raises(ConfigError, match="push_mm must be above 0 and at most 30, got 0"):
        ChangeRates(push_mm=0)
