"""Sizes of bolt heads, drives and washers by their standards, M4 to M8 (mm).

Source:
    Nominal (largest) sizes of ISO 4017 (hexagon), EN 1665 (hexagon with flange, heavy series),
    ISO 4762 (socket cap), ISO 14583 (hexalobular pan), ISO 7045 (cross recess, type H),
    ISO 1207 (slotted cheese), ISO 10664 (hexalobular drive) and ISO 7089 (washers). EN 1665
    starts at M5; M4 is what makers sell under its name. Cross recess depths are the means of
    the table's gauge depths; the wing's width is that of the driver blade.
"""

from __future__ import annotations

from dataclasses import dataclass

from boltpose.factory.spec_fasteners import HeadKind


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadSize:
    """One head of a standard."""

    across_mm: float
    """Spanner size of a hexagon, diameter of a round head."""
    height_mm: float
    """From the seat to the top, flange included."""
    flange_mm: float = 0
    """Diameter of the flange; 0 for none."""
    flange_edge_mm: float = 0
    """Thickness of the flange at its rim."""
    crown_mm: float = 0
    """Radius of the domed top of a pan head; 0 for a flat top."""
    drive_mm: float = 0
    """Size of the recess: spanner size of a socket, outer diameter of six lobes or of a cross,
    width of a slot."""
    drive_inner_mm: float = 0
    """Inner diameter of six lobes; width of a cross's wing."""
    drive_depth_mm: float = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class WasherSize:
    """One plain washer."""

    diameter_mm: float
    thickness_mm: float


_HEX = {
    4: HeadSize(across_mm=7, height_mm=2.8),
    5: HeadSize(across_mm=8, height_mm=3.5),
    6: HeadSize(across_mm=10, height_mm=4),
    8: HeadSize(across_mm=13, height_mm=5.3),
}
_HEX_FLANGE = {
    4: HeadSize(across_mm=7, height_mm=4.6, flange_mm=9.4, flange_edge_mm=0.8),
    5: HeadSize(across_mm=8, height_mm=5.8, flange_mm=11.8, flange_edge_mm=1.0),
    6: HeadSize(across_mm=10, height_mm=6.6, flange_mm=14.2, flange_edge_mm=1.1),
    8: HeadSize(across_mm=13, height_mm=8.1, flange_mm=18, flange_edge_mm=1.2),
}
_SOCKET_CAP = {
    4: HeadSize(across_mm=7, height_mm=4, drive_mm=3, drive_depth_mm=2),
    5: HeadSize(across_mm=8.5, height_mm=5, drive_mm=4, drive_depth_mm=2.5),
    6: HeadSize(across_mm=10, height_mm=6, drive_mm=5, drive_depth_mm=3),
    8: HeadSize(across_mm=13, height_mm=8, drive_mm=6, drive_depth_mm=4),
}
_TORX_PAN = {
    4: HeadSize(
        across_mm=8,
        height_mm=3.1,
        crown_mm=6.5,
        drive_mm=3.95,
        drive_inner_mm=2.84,
        drive_depth_mm=1.5,
    ),
    5: HeadSize(
        across_mm=9.5,
        height_mm=3.7,
        crown_mm=8,
        drive_mm=4.5,
        drive_inner_mm=3.22,
        drive_depth_mm=1.7,
    ),
    6: HeadSize(
        across_mm=12,
        height_mm=4.6,
        crown_mm=10,
        drive_mm=5.6,
        drive_inner_mm=4.01,
        drive_depth_mm=2.2,
    ),
    8: HeadSize(
        across_mm=16,
        height_mm=6,
        crown_mm=13,
        drive_mm=7.93,
        drive_inner_mm=5.64,
        drive_depth_mm=2.9,
    ),
}
_PHILLIPS_PAN = {
    4: HeadSize(
        across_mm=8,
        height_mm=3.1,
        crown_mm=6.5,
        drive_mm=4.4,
        drive_inner_mm=1.4,
        drive_depth_mm=2.15,
    ),
    5: HeadSize(
        across_mm=9.5,
        height_mm=3.7,
        crown_mm=8,
        drive_mm=4.9,
        drive_inner_mm=1.4,
        drive_depth_mm=2.65,
    ),
    6: HeadSize(
        across_mm=12,
        height_mm=4.6,
        crown_mm=10,
        drive_mm=6.9,
        drive_inner_mm=2.2,
        drive_depth_mm=3.35,
    ),
    8: HeadSize(
        across_mm=16,
        height_mm=6,
        crown_mm=13,
        drive_mm=9,
        drive_inner_mm=2.8,
        drive_depth_mm=4.3,
    ),
}
_SLOTTED = {
    4: HeadSize(across_mm=7, height_mm=2.6, drive_mm=1.2, drive_depth_mm=1.1),
    5: HeadSize(across_mm=8.5, height_mm=3.3, drive_mm=1.2, drive_depth_mm=1.3),
    6: HeadSize(across_mm=10, height_mm=3.9, drive_mm=1.6, drive_depth_mm=1.6),
    8: HeadSize(across_mm=13, height_mm=5, drive_mm=2, drive_depth_mm=2),
}

HEAD_SIZES: dict[HeadKind, dict[int, HeadSize]] = {
    HeadKind.HEX: _HEX,
    HeadKind.HEX_FLANGE: _HEX_FLANGE,
    HeadKind.SOCKET_CAP: _SOCKET_CAP,
    HeadKind.TORX_PAN: _TORX_PAN,
    HeadKind.PHILLIPS_PAN: _PHILLIPS_PAN,
    HeadKind.SLOTTED: _SLOTTED,
}
"""Head of every kind by nominal thread diameter."""

WASHERS: dict[int, WasherSize] = {
    4: WasherSize(diameter_mm=9, thickness_mm=0.8),
    5: WasherSize(diameter_mm=10, thickness_mm=1),
    6: WasherSize(diameter_mm=12, thickness_mm=1.6),
    8: WasherSize(diameter_mm=16, thickness_mm=1.6),
}
"""Washer by nominal thread diameter."""

NUTS: dict[int, HeadSize] = {
    4: HeadSize(across_mm=7, height_mm=3.2),
    5: HeadSize(across_mm=8, height_mm=4.7),
    6: HeadSize(across_mm=10, height_mm=5.2),
    8: HeadSize(across_mm=13, height_mm=6.8),
    10: HeadSize(across_mm=16, height_mm=8.4),
}
"""Hexagon nut of ISO 4032 by nominal thread diameter."""
