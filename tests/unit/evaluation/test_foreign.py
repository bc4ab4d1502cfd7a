import dataclasses
import json
from pathlib import Path

import pytest

from boltpose.errors import InputFileError
from boltpose.evaluation.foreign import (
    FORMAT,
    ForeignRecord,
    ForeignReport,
    read_foreign,
    render_foreign,
    write_foreign,
)
from boltpose.evaluation.negatives import Expectation

THERE = ForeignRecord(
    name="toy in clutter",
    expectation=Expectation.RIGHT_OR_REFUSE,
    places=20,
    accepted=6,
    votes=(6,),
    reference_gap_mm=1.2,
    reference_gap_rad=0.01,
    surface_mm=0.3,
    reference_surface_mm=0.9,
    failed={"free_space_violated": 14, "wrong_motor": 3},
    right_but_refused=2,
    right_failed={"surfaces_differ": 2},
    best_coverage=0.98,
    cpu_s=30.0,
)
REPORT = ForeignReport(format=FORMAT, reference="another program", records=(THERE,))


@pytest.mark.parametrize(
    ("change", "is_as_wanted"),
    [
        ({}, True),
        ({"votes": (), "accepted": 0}, True),
        ({"votes": (5, 1)}, False),
        ({"reference_gap_mm": 5.1}, True),
        ({"reference_gap_mm": 5.1, "surface_mm": 0.9}, False),
        ({"reference_gap_mm": 15.1}, False),
        ({"expectation": Expectation.REFUSE}, False),
        ({"expectation": Expectation.REFUSE, "votes": ()}, True),
        ({"reference_gap_mm": None, "reference_gap_rad": None}, False),
    ],
)
def test_what_is_wanted(change: dict[str, object], is_as_wanted: bool) -> None:
    assert dataclasses.replace(THERE, **change).is_as_wanted is is_as_wanted


def test_what_was_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "foreign.json"
    write_foreign(path, REPORT)
    assert read_foreign(path) == REPORT
    path.write_text(json.dumps({"format": FORMAT}))
    with pytest.raises(InputFileError, match="a report on foreign scans"):
        read_foreign(path)


def test_the_section_names_package_licence_and_every_search() -> None:
    text = render_foreign(REPORT)

    assert "opencv-doc" in text
    assert "Apache-2.0" in text
    assert "another program" in text
    row = (
        "| toy in clutter | right or refuse | 20 | 6 | 1 | 2 places: surfaces_differ 2 "
        "| 1.2 mm, 0.57 deg "
        "| 0.30 / 0.90 mm | 98.0 % | yes | 1.5 |"
    )
    assert row in text
