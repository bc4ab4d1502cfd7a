"""Settings that cannot work are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from boltpose.errors import ConfigError
from boltpose.service.config import ServiceConfig
from boltpose.service.keys import KeyRing
from boltpose.service.state import State
from tests.support.service import make_config


@pytest.mark.parametrize(
    "settings",
    [
        {"host": "http://a"},
        {"host": ""},
        {"port": -1},
        {"port": 65536},
        {"workers": 0},
        {"workers": True},
        {"queue_size": -1},
        {"max_upload_mb": float("nan")},
        {"locate_timeout_s": 0},
        {"allowed_hosts": ("a:80",)},
        {"prior_memory_mb": 0},
        {"keep_inputs_days": -1},
        {"data": ""},
    ],
)
def test_settings_out_of_range_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=next(iter(settings))):
        ServiceConfig(**settings)


@pytest.mark.parametrize(
    ("host", "is_loopback"),
    [
        ("127.0.0.1", True),
        ("127.5.0.1", True),
        ("::1", True),
        ("localhost", True),
        ("0.0.0.0", False),
        ("::", False),
        ("192.168.1.5", False),
        ("localhost.evil.org", False),
    ],
)
def test_only_loopback_is_loopback(host: str, is_loopback: bool) -> None:
    assert ServiceConfig(host=host).is_loopback is is_loopback


def test_an_address_that_others_reach_needs_a_key(tmp_path: Path) -> None:
    config = make_config(tmp_path, host="0.0.0.0")
    with pytest.raises(ConfigError, match="--new-key"):
        State(config)
    KeyRing(Path(config.data)).add("robot")
    state = State(config)
    with pytest.raises(ConfigError, match="another service"):
        State(config)
    state.journal.close()
