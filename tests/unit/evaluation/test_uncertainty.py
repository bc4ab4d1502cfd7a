from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from boltpose.errors import InputFileError
from boltpose.evaluation.bolts import BoltError
from boltpose.evaluation.codec import encode
from boltpose.evaluation.poses import LocatedBoltRecord
from boltpose.evaluation.uncertainty_report import (
    PICTURE,
    chance_band,
    confidence_of,
    draw_uncertainty,
    sections,
)
from boltpose.evaluation.uncertainty_run import (
    FOLDER,
    FORMAT,
    TOLERANCES_MM,
    UncertainBolt,
    UncertainMotor,
    read_uncertain_motor,
    read_uncertain_motors,
    sigmas_across_mm,
    write_uncertain_motor,
)
from boltpose.geometry.transforms import Transform
from boltpose.placement import PlacementConfig, place_bolt
from boltpose.schema import Visibility
from boltpose.tool_fit import disc_probability
from tests.support import records

WIDE, NARROW, AXIAL, TILT = 0.2, 0.05, 0.12, 0.003
TOOL_FITS = tuple(disc_probability(WIDE, NARROW, tolerance) for tolerance in TOLERANCES_MM)


def sampled(rng: np.random.Generator, view: int, scale: float = 1.0) -> UncertainBolt:
    """A bolt whose error is drawn from what is stated of it, or from a multiple of that."""
    x, y, z = scale * rng.normal(size=3) * (WIDE, NARROW, AXIAL)
    record = LocatedBoltRecord(
        found_id="T1",
        true_id=0,
        is_sure=True,
        error=BoltError(
            lateral_mm=float(np.hypot(x, y)),
            axial_mm=float(z),
            axis_rad=float(scale * TILT * np.hypot(*rng.normal(size=2))),
        ),
        sigma_lateral_mm=WIDE,
        sigma_axial_mm=AXIAL,
        sigma_axis_rad=TILT,
        position_sigmas=float(np.sqrt((x / WIDE) ** 2 + (y / NARROW) ** 2 + (z / AXIAL) ** 2)),
        is_truly_visible=view % 2 == 0,
        visibility=Visibility.VISIBLE,
        visible_fraction=0.5,
        true_visible_fraction=0.5,
    )
    return UncertainBolt(
        view=view,
        bolt=record,
        sigmas_across_mm=(WIDE, NARROW),
        tool_fits=TOOL_FITS,
    )


def motor(name: str, family: str, scale: float = 1.0, count: int = 200) -> UncertainMotor:
    rng = np.random.default_rng(7)
    return UncertainMotor(
        format=FORMAT,
        fingerprint="0",
        motor=name,
        family=family,
        bolts=tuple(sampled(rng, i % 4, scale) for i in range(count)),
    )


def test_confidence_is_uniform_where_the_statement_is_true() -> None:
    rng = np.random.default_rng(0)
    confidence = np.array([confidence_of(sampled(rng, 0)) for _ in range(2500)])
    levels = np.linspace(0.05, 0.95, 19)
    held = (confidence[:, :, None] <= levels).mean(axis=0)
    # four sigma of a share of 2500 draws
    np.testing.assert_allclose(held, np.broadcast_to(levels, held.shape), atol=0.04)


def test_too_bold_a_statement_holds_less_and_too_shy_a_one_more() -> None:
    rng = np.random.default_rng(1)
    bold = np.array([confidence_of(sampled(rng, 0, 2.0)) for _ in range(500)])
    shy = np.array([confidence_of(sampled(rng, 0, 0.5)) for _ in range(500)])
    assert ((bold <= 0.95).mean(axis=0) < 0.85).all()
    assert ((shy <= 0.95).mean(axis=0) > 0.99).all()


def test_an_exact_bolt_lies_in_every_region() -> None:
    entry = sampled(np.random.default_rng(2), 0, 0.0)
    np.testing.assert_allclose(confidence_of(entry), 0.0, atol=1e-6)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_sigmas_beside_the_axis_do_not_hang_on_the_frame(seed: int) -> None:
    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    # an error along the axis that is far larger than those beside it must not leak into them
    covariance = turn @ np.diag([NARROW**2, WIDE**2, 3.0**2]) @ turn.T
    still = Transform.identity("camera", "prior")
    placed = place_bolt(
        records.prior_bolt(),
        records.registration(still),
        None,
        visible_fraction=0.0,
        visibility=Visibility.HIDDEN,
        alignment_sigma_rad=0.0,
        config=PlacementConfig(),
    )
    bolt = replace(
        placed,
        frame_from_bolt=Transform.from_parts("base", "bolt", turn, (800.0, 10.0, 90.0)),
        covariance_mm2=covariance,
    )
    np.testing.assert_allclose(sigmas_across_mm(bolt), (WIDE, NARROW), rtol=1e-6)


def test_a_record_survives_its_file(tmp_path: Path) -> None:
    record = motor("motor_000", "offset_reduction", count=3)
    write_uncertain_motor(tmp_path / "motor_000.json", record)
    assert read_uncertain_motors(tmp_path) == (record,)


@pytest.mark.parametrize("name", ["gone", "broken", "old"])
def test_another_file_is_refused_by_name(tmp_path: Path, name: str) -> None:
    path = tmp_path / f"{name}.json"
    if name == "broken":
        path.write_text("{}")
    if name == "old":
        record = replace(motor("motor_000", "offset_reduction", count=1), format="other/1")
        path.write_text(json.dumps(encode(record)))
    with pytest.raises(InputFileError, match=f"{name}.json"):
        read_uncertain_motor(path)


def test_the_report_tells_what_is_held_of_both_halves(tmp_path: Path) -> None:
    assert sections(tmp_path) == []
    assert not draw_uncertainty(tmp_path, tmp_path / "results.md")
    folder = tmp_path / FOLDER
    folder.mkdir()
    write_uncertain_motor(folder / "motor_000.json", motor("motor_000", "offset_reduction"))
    # nothing else is known to the test half but errors of nought: all of it is held
    still = motor("motor_001", "another", scale=0.0)
    write_uncertain_motor(folder / "motor_001.json", still)
    text = "\n".join(sections(tmp_path))
    assert "| odd families (test) | 200 | 4 | 100 / 100 / 100 / 100 / 100 |" in text
    assert "| odd, hidden | 100 | 2 |" in text
    even = next(line for line in text.splitlines() if line.startswith("| even families (chose) |"))
    assert "| 200 | 4 |" in even
    assert f"({PICTURE.as_posix()})" in text

    report = tmp_path / "docs" / "results.md"
    assert draw_uncertainty(tmp_path, report)
    picture = report.parent / PICTURE
    first = picture.read_bytes()
    assert len(first) < 200_000
    draw_uncertainty(tmp_path, report)
    assert picture.read_bytes() == first


def test_fewer_views_allow_more_to_chance() -> None:
    few, many = chance_band(0.95, 9), chance_band(0.95, 900)
    assert few[0] < many[0] < 0.95 < many[1] < few[1] == 1.0
    assert chance_band(0.5, 100) == pytest.approx((0.402, 0.598), abs=1e-3)
