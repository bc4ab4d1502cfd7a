"""Settings of the service; section `[service]` of `boltpose.toml`."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass

from boltpose.errors import ConfigError

_HOST_NAME = re.compile(r"[A-Za-z0-9]([A-Za-z0-9.-]{0,251}[A-Za-z0-9])?")
LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1")
"""`Host` headers that a service on a loopback address answers to."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceConfig:
    """Where the service listens, what it may read, and how much it takes on."""

    host: str = "127.0.0.1"
    """Address to listen on. On any other than a loopback one API keys are required."""
    port: int = 8130
    """0 takes a free one."""
    data: str = "boltpose-service"
    """Folder of the service's own: journal, stored inputs, keys."""
    priors: str = "priors"
    """Folder of the `.prior.npz` files it knows; new ones are written there."""
    scans: str | None = None
    """Folder whose files a request may name by their paths; None allows uploads only."""
    models: str | None = None
    """Folder with other networks than the shipped ones."""
    database: str | None = None
    """URL of the journal, for example `postgresql+psycopg://user:word@host/name`; by default an
    SQLite file in `data`."""
    allowed_hosts: tuple[str, ...] = ()
    """More names that clients may call the service by (header `Host`)."""
    can_change_priors: bool = True
    """Whether clients may build and delete priors."""
    workers: int = 1
    """Processes that locate, each with its own networks (some 0.5 GB)."""
    queue_size: int = 8
    """Requests that may wait for a worker; further ones get 429."""
    max_upload_mb: float = 256.0
    """Largest request body; more is cut off while it comes in and gets 413."""
    upload_timeout_s: float = 60.0
    """Longest time for a request body to come in."""
    locate_timeout_s: float = 60.0
    """Longest time for one computation. The worker is then ended and a new one started."""
    build_timeout_s: float = 600.0
    """The same, for building a prior."""
    queue_timeout_s: float = 60.0
    """Longest wait for a worker."""
    drain_s: float = 20.0
    """On the way down: how long running requests may take to finish."""
    prior_memory_mb: float = 512.0
    """Prepared priors kept in each worker; the one unused for longest goes first."""
    worker_memory_mb: float = 4096.0
    """Most memory of each worker. An input that needs more is refused, or ends that worker alone;
    the computer's other programs never pay for it."""
    keep_inputs_days: float = 90.0
    """Inputs older than this are deleted; what was asked and answered stays in the journal."""
    keep_inputs_gb: float = 20.0
    """Oldest inputs are deleted beyond this."""

    def __post_init__(self) -> None:
        if not (is_address(self.host) or _HOST_NAME.fullmatch(self.host)):
            raise ConfigError(f"host must be an address or a name, got '{self.host}'")
        _check_range("port", self.port, 0, 65535)
        for name in ("data", "priors"):
            if not getattr(self, name):
                raise ConfigError(f"{name} must be a folder, got nothing")
        # lists of a settings file become what is frozen too
        object.__setattr__(self, "allowed_hosts", tuple(self.allowed_hosts))
        for host in self.allowed_hosts:
            if not (is_address(host) or _HOST_NAME.fullmatch(host)):
                raise ConfigError(f"allowed_hosts: '{host}' is no name of a host, without a port")
        _check_range("workers", self.workers, 1, 64)
        _check_range("queue_size", self.queue_size, 0, 10_000)
        _check_range("max_upload_mb", self.max_upload_mb, 0.001, 16_384)
        for name in ("upload_timeout_s", "locate_timeout_s", "build_timeout_s", "queue_timeout_s"):
            _check_range(name, getattr(self, name), 0.01, 86_400)
        _check_range("drain_s", self.drain_s, 0, 3600)
        _check_range("prior_memory_mb", self.prior_memory_mb, 1, 1_000_000)
        _check_range("worker_memory_mb", self.worker_memory_mb, 1024, 1_000_000)
        _check_range("keep_inputs_days", self.keep_inputs_days, 0, 100_000)
        _check_range("keep_inputs_gb", self.keep_inputs_gb, 0, 1_000_000)

    @property
    def max_upload_bytes(self) -> int:
        """Largest request body."""
        return int(self.max_upload_mb * 1e6)

    @property
    def is_loopback(self) -> bool:
        """Whether only programs on this computer can reach the service."""
        if is_address(self.host):
            return ipaddress.ip_address(self.host).is_loopback
        return self.host == "localhost"


def is_address(text: str) -> bool:
    """Tell an IP address from a name."""
    try:
        ipaddress.ip_address(text)
    except ValueError:
        return False
    return True


def _check_range(name: str, value: float, low: float, high: float) -> None:
    if isinstance(value, bool) or not low <= value <= high:  # written so that NaN fails too
        raise ConfigError(f"{name} must be {low:g} to {high:g}, got {value}")
