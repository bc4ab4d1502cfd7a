"""Registration methods of others beside ours, on all views of reman18 (simulated); resumable.

    python benchmarks/bench_registration.py                             # everything: hours
    python benchmarks/bench_registration.py --methods ours --again      # after a change of ours
    python benchmarks/bench_registration.py --motors motor_000 --views 0 -o /tmp/peers

Needs the extra `bench`. The records lie in results/peers; `boltpose evaluate` renders them into
docs/results.md. What is measured says `boltpose.evaluation.peers_methods`; the verdict against hard
cases is measured by `boltpose.evaluation.hard_run`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from boltpose.evaluation.peers_records import FOLDER
from boltpose.evaluation.peers_report import sections
from boltpose.evaluation.peers_run import main

if __name__ == "__main__":
    main(sys.argv[1:])
    if len(sys.argv) == 1:
        print("\n\n".join(sections(Path("results"))) or f"no records in results/{FOLDER}")
