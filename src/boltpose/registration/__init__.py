"""Where the prior is in one view, and whether that can be trusted."""
