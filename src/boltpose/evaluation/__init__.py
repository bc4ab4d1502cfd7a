"""How well the main job does: against the truth of reman18, and on scans that must be refused."""
