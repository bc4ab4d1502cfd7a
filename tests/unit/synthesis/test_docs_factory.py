"""What docs/factory.md shows can be made."""

from __future__ import annotations

import json
import re
from pathlib import Path

from boltpose.factory.build import build_motor
from boltpose.factory.families import FAMILIES
from boltpose.factory.spec import MotorSpec
from boltpose.synthesis.pictures import PICTURES

ROOT = Path(__file__).resolve().parents[3]
TEXT = (ROOT / "docs" / "factory.md").read_text(encoding="utf-8")
IMAGES = ROOT / "docs" / "images" / "factory"


def test_the_worked_example_is_the_file_and_can_be_built() -> None:
    (block,) = re.findall(r"```json\n(.*?)```", TEXT, re.DOTALL)
    document = json.loads((ROOT / "examples" / "bench_7.json").read_text(encoding="utf-8"))
    assert json.loads(block) == document
    model = build_motor(MotorSpec.model_validate(document))
    assert len(model.bolts) == len(document["bolts"])


def test_every_picture_is_shown_and_small() -> None:
    shown = set(re.findall(r"images/factory/([\w.]+)\)", TEXT))
    there = {path.name for path in IMAGES.iterdir()}
    assert shown == there
    sizes = [path.stat().st_size for path in IMAGES.iterdir()]
    assert max(sizes) < 300_000
    assert sum(sizes) < 4_000_000
    prefixes = tuple(PICTURES)
    assert all(name.startswith((*prefixes, "bench_7")) for name in there)


def test_the_page_counts_the_families_right() -> None:
    words = {12: "Twelve", 14: "Fourteen", 16: "Sixteen", 18: "Eighteen"}
    assert f"{words[len(FAMILIES)]} topologies" in TEXT
