"""One self-contained HTML page per scan: verdict, pictures, bolts, scores, origin."""

from boltpose.report.page import render_report, write_report

__all__ = ["render_report", "write_report"]
