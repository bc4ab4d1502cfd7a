"""What Prometheus is told; labels come from fixed sets, so their number is bounded."""

from __future__ import annotations

from boltpose.errors import MissingExtraError

try:
    from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
except ImportError as error:
    raise MissingExtraError("prometheus-client", "service") from error

_SECONDS = (0.01, 0.03, 0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3, 5, 10, 30, 60)


class Metrics:
    """Counters of one service, in a registry of their own."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.requests = Counter(
            "boltpose_requests",
            "Answered requests",
            ["route", "method", "status"],
            registry=self.registry,
        )
        self.poses = Counter(
            "boltpose_poses", "Results of locate: ok or refused", ["status"], registry=self.registry
        )
        self.refusals = Counter(
            "boltpose_refusals", "Refused poses by reason", ["reason"], registry=self.registry
        )
        self.errors = Counter(
            "boltpose_errors", "Failed requests by code", ["code"], registry=self.registry
        )
        self.stage_seconds = Histogram(
            "boltpose_stage_seconds",
            "Wall time of each stage of locate",
            ["stage"],
            buckets=_SECONDS,
            registry=self.registry,
        )
        self.locate_seconds = Histogram(
            "boltpose_locate_seconds",
            "From the last byte of a request to its answer, waiting included",
            buckets=_SECONDS,
            registry=self.registry,
        )
        self.wait_seconds = Histogram(
            "boltpose_wait_seconds",
            "Time waited for a worker",
            buckets=_SECONDS,
            registry=self.registry,
        )
        self.queue_length = Gauge(
            "boltpose_queue_length", "Requests waiting for a worker", registry=self.registry
        )
        self.running = Gauge(
            "boltpose_in_progress", "Requests waiting or at work", registry=self.registry
        )
        self.workers = Gauge("boltpose_workers", "Workers alive", registry=self.registry)
        self.restarts = Gauge(
            "boltpose_worker_restarts", "Workers replaced since the start", registry=self.registry
        )
        self.prior_bytes = Gauge(
            "boltpose_prepared_prior_bytes",
            "Prepared priors kept by the worker that answered last",
            registry=self.registry,
        )

    def text(self) -> bytes:
        """The page that Prometheus reads."""
        return generate_latest(self.registry)
