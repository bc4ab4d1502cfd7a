"""Results and priors as a web page that a technician turns with the mouse (extra `viewer`)."""
