"""The core imports alone: nothing optional, nothing heavy before it is used."""

from __future__ import annotations

import subprocess
import sys

import pytest

HIDE = """
import sys

class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {hidden!r}:
            raise ModuleNotFoundError(f"hidden: {{name}}", name=name.split(".")[0])

sys.meta_path.insert(0, Hidden())
"""


def run(code: str, *hidden: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", HIDE.format(hidden=set(hidden)) + code],
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_main_job_imports_without_any_extra() -> None:
    done = run(
        "import boltpose.locate, boltpose.prior.build, boltpose.results\n"
        "import boltpose.segmentation.models, boltpose.io.scan, boltpose.picture\n"
        "import boltpose.cli.app\n"
        "assert not {'torch', 'open3d', 'onnx'} & set(sys.modules)\n",
        "torch", "open3d", "onnx", "onnxscript", "safetensors", "pytest", "hypothesis",
    )  # fmt: skip

    assert (done.returncode, done.stderr) == (0, "")


def test_every_public_name_resolves_without_torch_or_open3d() -> None:
    done = run(
        "import boltpose\n"
        "assert 'numpy' not in sys.modules, 'the top level must be lazy'\n"
        "[getattr(boltpose, name) for name in boltpose.__all__]\n",
        "torch", "open3d", "onnx",
    )  # fmt: skip

    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("arguments", "hidden", "extra"),
    [
        (["train", "parts", "--out", "run"], "torch", "train"),
        (["train", "scene", "--out", "run"], "safetensors", "train"),
    ],
)
def test_a_missing_extra_is_one_line_with_the_install_line(
    arguments: list[str], hidden: str, extra: str
) -> None:
    done = run(f"from boltpose.cli.app import main\nsys.exit(main({arguments!r}))\n", hidden)

    assert done.returncode == 2
    assert done.stderr == f"boltpose: this needs {hidden}: pip install 'boltpose[{extra}]'\n"
