"""Draws of motors: deterministic, buildable, as varied as their tables."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from boltpose.errors import ConfigError
from boltpose.factory.checks import check_layout
from boltpose.factory.draw_bodies import draw_bodies
from boltpose.factory.draw_bolts import draw_bolts
from boltpose.factory.draw_extras import draw_extras
from boltpose.factory.families import FAMILIES, sample_model, sample_motor
from boltpose.factory.layout import lay_out
from boltpose.factory.mirror import mirror_motor
from boltpose.factory.plans import PLANS, FamilyPlan
from boltpose.factory.spec import MotorSpec
from boltpose.factory.spec_fasteners import DistractorKind, HeadKind, Site


def drawn(plan: FamilyPlan, seed: int) -> MotorSpec:
    rng = np.random.default_rng(seed)
    return draw_extras(rng, draw_bolts(rng, plan, draw_bodies(rng, plan)))


def test_the_same_seed_gives_the_same_motor() -> None:
    first, second, other = (
        sample_motor(np.random.default_rng(seed), "compact_short") for seed in (5, 5, 6)
    )
    assert first == second
    assert first != other
    assert MotorSpec.model_validate_json(first.model_dump_json()) == first


def test_an_unknown_family_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"direct_closed.*got turbo"):
        sample_motor(np.random.default_rng(0), "turbo")


def test_a_sampled_model_has_bolts_on_it() -> None:
    model = sample_model(np.random.default_rng(1), "outboard")
    assert model.spec.family == "outboard"
    assert 4 <= len(model.bolts) <= 14


@pytest.mark.parametrize("plan", PLANS, ids=FAMILIES)
def test_draws_fit_together_and_vary(plan: FamilyPlan) -> None:
    radii: list[float] = []
    for seed in range(12):
        spec = draw_bodies(np.random.default_rng(seed), plan)
        check_layout(spec, lay_out(spec))
        radii.append(spec.housing.radius_mm)
        assert (spec.solenoid is None) == (plan.solenoid == "none")
        assert (spec.gearbox is None) == (plan.gear_train == "direct")
        assert spec.bracket.nose.style in plan.nose
    low, high = plan.yoke_radius_mm
    assert low <= min(radii)
    assert max(radii) <= high
    assert max(radii) - min(radii) > 0.4 * (high - low)


def test_all_heads_sites_and_distractors_occur() -> None:
    specs = [drawn(plan, seed) for plan in PLANS for seed in range(6)]
    bolts = [bolt for spec in specs for bolt in spec.bolts]
    assert {bolt.head for bolt in bolts} == set(HeadKind)
    assert {bolt.site for bolt in bolts} == set(Site) - {Site.YOKE}
    assert {bolt.thread_mm for bolt in bolts} == {4, 5, 6, 8}
    assert any(bolt.recess_mm > 0 for bolt in bolts)
    items = [item for spec in specs for item in spec.distractors]
    assert {item.kind for item in items} == set(DistractorKind)
    counts = [len(spec.bolts) for spec in specs]
    assert min(counts) <= 5
    assert max(counts) >= 12


def test_mirroring_twice_changes_nothing_but_writing_of_angles() -> None:
    spec = drawn(PLANS[0], 4)
    once = mirror_motor(spec)
    assert mirror_motor(mirror_motor(once)) == once
    for bolt, mirrored in zip(spec.bolts, once.bolts, strict=True):
        assert np.cos(np.radians(mirrored.angle_deg)) == pytest.approx(
            -np.cos(np.radians(bolt.angle_deg)), abs=1e-6
        )
        assert np.sin(np.radians(mirrored.angle_deg)) == pytest.approx(
            np.sin(np.radians(bolt.angle_deg)), abs=1e-6
        )


def test_families_have_different_names() -> None:
    assert all(first != second for first, second in pairwise(sorted(FAMILIES)))
