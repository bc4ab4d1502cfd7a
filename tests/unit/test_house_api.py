"""The public names are a promise; a change of them is a decision, seen as a diff."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

import boltpose
from boltpose.errors import BoltposeError
from tests.support import api_surface


def test_the_public_names_are_those_on_record() -> None:
    # after an intended change: python -m tests.support.api_surface
    recorded = json.loads(api_surface.PATH.read_text(encoding="utf-8"))
    assert api_surface.describe_api() == recorded


def test_dir_and_all_agree_and_strangers_are_told() -> None:
    assert set(boltpose.__all__) <= set(dir(boltpose))
    assert not hasattr(boltpose, "no_such_name")


def test_every_error_is_ours_and_a_builtin() -> None:
    import boltpose.errors

    kinds = [
        kind
        for kind in vars(boltpose.errors).values()
        if isinstance(kind, type) and issubclass(kind, BoltposeError) and kind is not BoltposeError
    ]
    assert len(kinds) >= 8
    for kind in kinds:
        builtins = (ValueError, ImportError, OSError, KeyError, TypeError, RuntimeError)
        assert issubclass(kind, builtins), kind


@pytest.mark.parametrize(
    "first",
    [
        "import boltpose.locate, boltpose.locate_views",
        "from boltpose.locate import LocateConfig",
        "from boltpose.locate_views import Shot",
        "pass",
    ],
)
def test_a_module_never_stands_in_for_its_function(first: str) -> None:
    code = f"{first}\nfrom boltpose import locate, locate_views\n"
    code += "assert callable(locate) and callable(locate_views)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)

    assert (done.returncode, done.stderr) == (0, "")
