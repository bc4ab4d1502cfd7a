"""Train and export the networks."""
