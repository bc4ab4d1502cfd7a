"""The examples of every command's help; a test runs each of them."""

from __future__ import annotations

REQUEST = "20260301T081502123456-1f2e3d4c"
"""An id as `boltpose journal list` shows it."""
EXAMPLES: dict[str, tuple[str, ...]] = {
    "locate": (
        "boltpose locate scan.zdf --prior motor.prior.npz --hand-eye hand_eye.yaml -o poses.json",
        "boltpose locate scan.ply --prior priors/ --hand-eye hand_eye.yaml --json",
        "boltpose locate scan.zdf -o poses.json --report report.html",
    ),
    "demo": ("boltpose demo -o demo_output",),
    "view": (
        "boltpose view poses.json",
        "boltpose view motor.prior.npz",
        "boltpose view --live --prior motor.prior.npz --hand-eye hand_eye.yaml --watch scans/",
    ),
    "evaluate": (
        "boltpose evaluate --data data/reman18 --motor motor_000",
        "boltpose evaluate --report-only",
    ),
    "export": ("boltpose export runs/parts -o networks/parts.onnx",),
    "export-poses": (
        "boltpose export-poses poses.json --to kuka -o bolts.dat --approach 80",
        "boltpose export-poses poses.json --to csv -o bolts.csv --include-hidden",
    ),
    "label": (
        "boltpose label full_scan.ply -o labelled.ply",
        "boltpose label corrected.ply --from-colours -o labels.ply",
    ),
    "report": ("boltpose report poses.json -o report.html",),
    "reproduce": (
        "boltpose reproduce table2 --budget quick --synthetic data/motors",
        "boltpose reproduce all --report-only",
    ),
    "serve": (
        "boltpose serve --priors priors/ --data journal/",
        "boltpose serve --data journal/ --new-key robot-1",
    ),
    "config init": ("boltpose config init",),
    "config check": ("boltpose config check", "boltpose config check cell_2.toml --json"),
    "config show": ("boltpose config show --config cell_2.toml",),
    "prior build": (
        "boltpose prior build full_scan.ply -o motor.prior.npz --picture prior.png",
        "boltpose prior build motor.stl --parts parts.yaml -o motor.prior.npz",
    ),
    "prior show": ("boltpose prior show motor.prior.npz --picture prior.png",),
    "prior edit": (
        "boltpose prior edit motor.prior.npz --remove T3 --confirm T1 --by 'A. Smith'",
        "boltpose prior edit motor.prior.npz --tool T1='hex 8' --order T1=1 -o new.prior.npz",
    ),
    "prior review": ("boltpose prior review motor.prior.npz --by 'A. Smith'",),
    "journal list": ("boltpose journal list --data journal/",),
    "journal show": (f"boltpose journal show {REQUEST} --data journal/",),
    "journal export": (f"boltpose journal export {REQUEST} --data journal/ -o request",),
    "journal replay": ("boltpose journal replay --last 20 --data journal/",),
    "journal report": (f"boltpose journal report {REQUEST} --data journal/ -o request.html",),
    "synth motors": ("boltpose synth motors -o data/motors -n 200 --workers 2",),
    "synth scenes": ("boltpose synth scenes -o data/scenes -n 20 --views 2 --preview",),
    "synth model": ("boltpose synth model motor.json -o my_motor",),
    "synth spec": ("boltpose synth spec -o motor.json",),
    "synth families": ("boltpose synth families",),
    "synth preview": ("boltpose synth preview data/scenes",),
    "synth pictures": ("boltpose synth pictures -o docs/images --only families,camera",),
    "synth card": ("boltpose synth card data/scenes",),
    "synth compare": ("boltpose synth compare data/reman18 data/scenes",),
    "train parts": ("boltpose train parts --data my_scans --out runs/parts --recipe few",),
    "train scene": ("boltpose train scene --data data/reman18 --out runs/scene",),
}
"""By the words of the command."""
