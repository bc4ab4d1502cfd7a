"""The command line: `boltpose prior build|show|edit`, `locate`, `demo`, `evaluate`, `train`."""
