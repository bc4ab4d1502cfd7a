"""Build the prior of the demo motor, locate its bolts in one scan, and use the result."""

from boltpose import (
    build_prior,
    load_models,
    locate,
    read_hand_eye,
    read_scan,
)
from boltpose.cli.demo import DEMO_FOLDER

models = load_models()

# once per motor type; `write_prior` keeps it
full_scan = read_scan(DEMO_FOLDER / "full_scan.ply")
prior = build_prior(full_scan, models.parts, name="demo motor")

# once per clamped motor
scan = read_scan(DEMO_FOLDER / "000002.png", camera=DEMO_FOLDER / "scene_camera.json")
base_from_camera = read_hand_eye(DEMO_FOLDER / "hand_eye.yaml").transform
result = locate(scan, prior, base_from_camera, models.scene)

if not result.is_ok:
    raise SystemExit("refused: " + "; ".join(result.verdict.reasons))
for bolt in result.bolts:
    x, y, z = bolt.head_top
    print(
        f"{bolt.id:4} {bolt.visibility:8} head_top {x:8.2f} {y:8.2f} {z:8.2f} mm "
        f"in {result.frame}, sigma {bolt.sigma_lateral_mm:.2f} mm beside the axis"
    )
