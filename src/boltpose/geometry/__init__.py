"""Pure functions and value types: numpy in and out, no files, no settings."""
