from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import lzf
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from boltpose.io.lzf import decompress_lzf


def compress(plain: bytes) -> bytes:
    """liblzf through another binding; it gives up on what does not shrink."""
    return lzf.compress(plain, 2 * len(plain) + 64)


@given(st.lists(st.tuples(st.binary(max_size=40), st.integers(1, 60)), min_size=1, max_size=12))
def test_inverts_an_independent_compressor(pieces: list[tuple[bytes, int]]) -> None:
    plain = b"".join(piece * times for piece, times in pieces) + b"end"
    assert decompress_lzf(compress(plain), len(plain)).tobytes() == plain


def test_a_stream_written_by_hand() -> None:
    # literal run of 3, then 'copy 6 from 3 back', then 'copy 10 from 1 back' in the long form
    stream = bytes([2]) + b"abc" + bytes([4 << 5, 2]) + bytes([7 << 5, 1, 0])
    assert decompress_lzf(stream, 19).tobytes() == b"abc" * 3 + b"c" * 10


@pytest.mark.parametrize("size", [-1, 0, 18, 20, 32, 51, 10**12])
def test_another_size_is_refused(size: int) -> None:
    stream = bytes([2]) + b"abc" + bytes([4 << 5, 2]) + bytes([7 << 5, 1, 0])
    with pytest.raises(ValueError, match=r"LZF|compressed bytes"):
        decompress_lzf(stream, size)


@pytest.mark.parametrize("cut", range(1, 9))
def test_every_cut_is_refused(cut: int) -> None:
    stream = bytes([2]) + b"abc" + bytes([4 << 5, 2]) + bytes([7 << 5, 1, 0])
    with pytest.raises(ValueError, match="LZF"):
        decompress_lzf(stream[:-cut], 19)


def test_copy_from_before_the_start_is_refused() -> None:
    with pytest.raises(ValueError, match="broken LZF stream"):
        decompress_lzf(bytes([0]) + b"a" + bytes([4 << 5, 200]), 7)


def test_threads_do_not_disturb_each_other() -> None:
    plains = [np.full(100_000, value, dtype=np.uint8).tobytes() for value in range(16)]
    streams = [compress(plain) for plain in plains]
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda stream: decompress_lzf(stream, 100_000).tobytes(), streams))
    assert found == plains
