"""LZF decompression, by the filter that h5py carries.

PCL writes `binary_compressed` PCD files with liblzf. h5py ships the same library as HDF5's filter
`lzf`, so a stream is stored as the one chunk of a data set in memory and read back. No package
has to be added, and 5 million points take a fraction of a second instead of the many seconds of
a loop in Python.
"""

from __future__ import annotations

import secrets
from typing import Any

import h5py
import numpy as np

from boltpose.arrays import UInt8Array

_MARK = bytes(range(200, 232))
"""32 bytes appended as one literal run (control byte 31) to see where the stream's output ends:
HDF5 neither reports nor checks the length."""
_MAX_EXPANSION = 264
"""LZF's longest copy, 264 bytes, takes 3 bytes of input; a larger claim is broken."""


def decompress_lzf(stream: bytes, size: int) -> UInt8Array:
    """Decompress an LZF stream.

    Args:
        stream: The compressed bytes.
        size: How many bytes come out.

    Returns:
        Shape (size,).

    Raises:
        ValueError: The stream is broken or does not decompress to exactly `size` bytes.

    Source:
        Marc Lehmann, liblzf 3.6.
    """
    if not 0 < size <= len(stream) * _MAX_EXPANSION:
        raise ValueError(f"{len(stream)} compressed bytes cannot hold {size}")
    total = size + len(_MARK)
    # HDF5 refuses to open one name twice, and another thread may be in here
    name = f"lzf-{secrets.token_hex(8)}"
    with h5py.File(name, "w", driver="core", backing_store=False) as memory:
        # Any: the low-level API of h5py has no types
        chunk: Any = memory.create_dataset(
            "chunk", shape=(total,), chunks=(total,), dtype=np.uint8, compression="lzf"
        )
        chunk.id.write_direct_chunk((0,), stream + b"\x1f" + _MARK)
        try:
            output: UInt8Array = chunk[:]
        except OSError as error:
            raise ValueError(f"broken LZF stream ({error})") from None
    if output[size:].tobytes() != _MARK:
        raise ValueError(f"an LZF stream that does not decompress to {size} bytes")
    return output[:size]
