"""The sections of `docs/results.md` on what a pose may be trusted with, and their pictures."""

from __future__ import annotations

from pathlib import Path

from boltpose.evaluation import (
    bolt_state_report,
    hard_report,
    peers_report,
    several_views_report,
    table1_report,
    uncertainty_report,
    variants_report,
)
from boltpose.evaluation.hard_picture import draw_verdict
from boltpose.evaluation.several_views_report import draw_several_views
from boltpose.evaluation.table1_report import draw_table1
from boltpose.evaluation.uncertainty_report import draw_uncertainty
from boltpose.evaluation.variants_picture import draw_variants

_REPORTS = (
    hard_report,
    uncertainty_report,
    bolt_state_report,
    variants_report,
    several_views_report,
    table1_report,
    peers_report,
)


def trust_sections(results: Path) -> list[str]:
    """Render what lies under a folder of results; what was not measured has no section."""
    return [section for report in _REPORTS for section in report.sections(results)]


def draw_trust(results: Path, report: Path) -> None:
    """Draw the pictures that the sections show, beside the report."""
    for draw in (draw_verdict, draw_uncertainty, draw_variants, draw_several_views, draw_table1):
        draw(results, report)
