"""Prior and motor points of one view -> `camera_from_prior`, checked against what was seen."""
