from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from boltpose.cli.exit_codes import ExitCode
from boltpose.io.full_scan import is_mesh, read_full_scan
from boltpose.prior.file import prior_to_json, read_prior
from boltpose.schema import Part
from tests.unit.cli.conftest import Cell, Run, write_ply

CUBE_OBJ = "o housing\n" + "".join(
    f"v {x} {y} {z}\n" for x in (-50, 50) for y in (-40, 40) for z in (-60, 60)
) + "".join(
    f"f {a} {b} {c}\n"
    for a, b, c in [
        (1, 2, 4), (1, 4, 3), (5, 8, 6), (5, 7, 8), (1, 6, 2), (1, 5, 6),
        (3, 4, 8), (3, 8, 7), (1, 3, 7), (1, 7, 5), (2, 6, 8), (2, 8, 4),
    ]
)  # fmt: skip


def test_show_lists_every_bolt_and_marks_the_unsure(run: Run, cell: Cell) -> None:
    outcome = run("prior", "show", cell.prior)

    assert outcome.code == ExitCode.OK
    assert "look at 1 bolt" in outcome.out
    rows = {line.split()[0]: line for line in outcome.out.splitlines() if line.strip()}
    assert rows["T1"].split()[-1] == "yes"
    assert "B1: confidence 90%: little flank" in outcome.out
    assert "20.00    20.00    50.00" in rows["T1"]


def test_show_json_is_the_prior(run: Run, cell: Cell) -> None:
    outcome = run("prior", "show", cell.prior, "--json", "--picture", cell.folder / "p.png")

    assert json.loads(outcome.out) == json.loads(json.dumps(prior_to_json(read_prior(cell.prior))))
    assert outcome.err == ""
    assert (cell.folder / "p.png").exists()


def test_edit_removes_confirms_and_adds(run: Run, cell: Cell) -> None:
    before = cell.prior.read_bytes()

    outcome = run(
        "prior", "edit", cell.prior, "--remove", "T2", "--confirm", "B1",
        "--add", "-20,-20,50", "-o", cell.folder / "new.prior.npz",
    )  # fmt: skip

    assert outcome.code == ExitCode.OK
    assert cell.prior.read_bytes() == before
    edited = read_prior(cell.folder / "new.prior.npz")
    assert edited.bolt("B1").is_sure
    gaps = [
        np.linalg.norm(bolt.prior_from_bolt.translation_mm - (-20, -20, 50))
        for bolt in edited.bolts
    ]
    assert len(edited.bolts) == 3
    assert min(gaps) < 3.0


def test_edit_replaces_the_prior_by_default(run: Run, cell: Cell) -> None:
    assert run("prior", "edit", cell.prior, "--remove", "T1").code == ExitCode.OK

    assert [bolt.id for bolt in read_prior(cell.prior).bolts] == ["T2", "B1"]


def test_a_ply_with_faces_is_a_mesh(tmp_path: Path) -> None:
    cloud, mesh = tmp_path / "cloud.ply", tmp_path / "mesh.ply"
    write_ply(cloud, np.eye(3) * 100)
    text = cloud.read_text().replace(
        "end_header\n", "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
    mesh.write_text(text + "3 0 1 2\n")

    assert not is_mesh(cloud)
    assert is_mesh(mesh)
    assert is_mesh(tmp_path / "motor.STL")


def test_a_mesh_is_sampled_the_same_way_every_time_with_labels(tmp_path: Path) -> None:
    mesh, names = tmp_path / "cube.obj", tmp_path / "names.yaml"
    mesh.write_text(CUBE_OBJ)
    names.write_text("housing: main_housing\n")

    first = read_full_scan(mesh, unit=None, parts=names)
    second = read_full_scan(mesh, unit=None, parts=names)

    np.testing.assert_array_equal(first.points, second.points)
    assert first.labels is not None
    assert (first.labels == Part.MAIN_HOUSING).all()
    half = np.array([50, 40, 60])
    on_surface = np.abs(np.abs(first.points) - half).min(axis=1)
    assert on_surface.max() < 1e-6
