"""Scans as a structured-light camera or a hand-held laser scanner would make them of solids."""
