"""Pictures are drawn coarsely here: what they show is tested, not how smooth they are."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _coarse_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("boltpose.picture.paint.SUPERSAMPLING", 1)
