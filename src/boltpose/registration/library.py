"""All motors a cell knows: their sketches in memory, the rest read and prepared when wanted."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from boltpose.errors import ConfigError
from boltpose.prior.folder import open_prior_folder
from boltpose.prior.sketch import PriorSketch, sketch_prior
from boltpose.registration.prepare import PreparedPrior, prepare_prior
from boltpose.registration.shortlist import ShortlistConfig, ShortlistIndex, build_shortlist_index
from boltpose.schema import Prior

Kept = TypeVar("Kept")


class PriorLibrary:
    """Priors by row, sorted by name: what is found does not depend on the order they came in.

    Keeps the priors prepared last; results do not depend on it. Not to be shared by threads.
    """

    def __init__(
        self,
        sketches: Sequence[PriorSketch],
        read: Callable[[str], Prior],
        *,
        paths: Mapping[str, Path] | None = None,
        config: ShortlistConfig | None = None,
        kept: int = 8,
    ) -> None:
        """Index the sketches.

        Args:
            sketches: One per motor, names all different.
            read: Returns the prior of a name.
            paths: Files of the priors by name, where they have any.
            config: Settings of the shortlist.
            kept: So many prepared priors stay in memory, some 20 MB each.

        Raises:
            ConfigError: There is no sketch, or a name comes twice.
        """
        self.config = config or ShortlistConfig()
        self.index: ShortlistIndex = build_shortlist_index(
            sorted(_with_unique_names(sketches), key=lambda sketch: sketch.name), self.config
        )
        self.names = tuple(sketch.name for sketch in self.index.sketches)
        self.paths: Mapping[str, Path] = dict(paths or {})
        self._read = read
        self._kept = kept
        self._priors: OrderedDict[int, Prior] = OrderedDict()
        self._prepared: OrderedDict[int, PreparedPrior] = OrderedDict()

    @classmethod
    def from_priors(
        cls, priors: Sequence[Prior], config: ShortlistConfig | None = None
    ) -> PriorLibrary:
        """Make a library of priors in memory.

        Raises:
            ConfigError: There is none, or a name comes twice.
            EmptyScanError: A prior holds no points.
        """
        by_name = {prior.name: prior for prior in priors}
        sketches = [sketch_prior(prior) for prior in priors]
        return cls(sketches, by_name.__getitem__, config=config)

    @classmethod
    def from_folder(cls, folder: str | Path, config: ShortlistConfig | None = None) -> PriorLibrary:
        """Open a folder of `.prior.npz` files; of each only its sketch is read.

        Raises:
            InputFileError: There is no such folder, no prior in it, a prior cannot be read, or two
                have the same name.
        """
        shelf = open_prior_folder(folder)
        return cls(shelf.sketches, shelf.read, paths=shelf.paths, config=config)

    def __len__(self) -> int:
        return len(self.names)

    def prior(self, row: int) -> Prior:
        """Return a prior.

        Raises:
            InputFileError: Its file cannot be read.
        """
        return _keep(self._priors, row, lambda: self._read(self.names[row]), self._kept)

    def prepared(self, row: int) -> PreparedPrior:
        """Return a prior ready for registration.

        Raises:
            InputFileError: Its file cannot be read.
        """
        return _keep(self._prepared, row, lambda: prepare_prior(self.prior(row)), self._kept)

    def forget(self) -> None:
        """Drop what is kept in memory, as if just opened."""
        self._priors.clear()
        self._prepared.clear()


def _keep(store: OrderedDict[int, Kept], row: int, make: Callable[[], Kept], size: int) -> Kept:
    if row not in store:
        store[row] = make()
        while len(store) > size:
            store.popitem(last=False)
    store.move_to_end(row)
    return store[row]


def _with_unique_names(sketches: Sequence[PriorSketch]) -> Sequence[PriorSketch]:
    names = [sketch.name for sketch in sketches]
    if not names:
        raise ConfigError("a library needs at least one prior, got none")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ConfigError(f"priors must have different names, got more than one {twice[0]!r}")
    return sketches
