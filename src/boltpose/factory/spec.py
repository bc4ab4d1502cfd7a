"""`MotorSpec`: a starter motor written down. Lengths in mm, angles in degrees.

Everything is counted along the motor's axis from the joint between yoke and what stands in front
of it; the model is then moved into frame `motor` (z from main housing to connector, solenoid in
+y). A specification says how the motor was made; what use did to it is `wear.WearSpec`.
"""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from boltpose.factory.spec_fasteners import BoltSpec, DistractorSpec, SpecModel


class HousingSpec(SpecModel):
    """The yoke: the steel tube around the armature."""

    radius_mm: float = Field(default=37, gt=15, lt=90)
    length_mm: float = Field(default=95, gt=25, lt=260)
    ovality_mm: float = Field(default=0, ge=0, le=2)
    """Difference of the largest and the smallest radius."""
    crimps: int = Field(default=0, ge=0, le=12)
    """Dents that hold the rear cap, evenly around the rear rim."""
    grooves: tuple[float, ...] = ()
    """Distances behind the front end at which a groove runs around."""
    bands: tuple[float, ...] = ()
    """Distances behind the front end at which a raised band or seam runs around."""
    flats: tuple[float, ...] = ()
    """Polar angles of flats milled or pressed along the mantle."""
    flat_depth_mm: float = Field(default=1.5, ge=0, le=6)
    seam_angle_deg: float | None = None
    """Where a weld seam runs along the mantle; None for none."""
    name_plate_angle_deg: float | None = None
    """Where the name plate is; None for none."""
    name_plate_size_mm: tuple[float, float] = (45, 28)
    """Along the axis and around it."""
    finish: Literal["painted_steel", "bare_steel", "zinc"] = "painted_steel"


class RearCapSpec(SpecModel):
    """The cap behind the yoke, with the rear bearing; class main housing."""

    style: Literal["flat", "domed", "stepped", "spider"] = "flat"
    """`spider`: a ring with arms and openings."""
    length_mm: float = Field(default=14, gt=3, lt=60)
    radius_mm: float | None = Field(default=None, gt=15, lt=95)
    """None: as the yoke."""
    hub_radius_mm: float = Field(default=11, gt=3, lt=40)
    hub_height_mm: float = Field(default=5, ge=0, lt=25)
    """Of the bearing cup over the cap's back; 0 for none."""
    hub_hollow: bool = False
    """True: an open bearing seat; False: a closed cup."""
    edge_mm: float = Field(default=2, ge=0, lt=8)
    """Rounding of the rim."""
    ribs: int = Field(default=0, ge=0, le=16)
    """Radial ribs on the back."""
    openings: int = Field(default=4, ge=2, le=8)
    """Between the arms of a `spider`."""
    finish: Literal["cast_aluminium", "cast_iron", "painted_steel", "zinc"] = "cast_aluminium"


class GearboxSpec(SpecModel):
    """A reduction gear's ring between yoke and bracket; class connector."""

    radius_mm: float = Field(default=39, gt=15, lt=95)
    length_mm: float = Field(default=24, gt=6, lt=80)
    shaft_offset_mm: float = Field(default=0, ge=0, lt=100)
    """How far the pinion's shaft stands off the main axis: 0 for a planetary gear."""
    shaft_angle_deg: float = 90
    """Polar angle of that offset."""
    ribs: int = Field(default=0, ge=0, le=24)
    """Axial ribs around the ring."""
    flange_mm: float = Field(default=0, ge=0, lt=8)
    """How far a rim stands out at the joint to the bracket; 0 for none."""
    finish: Literal["cast_aluminium", "cast_iron", "painted_steel", "zinc"] = "cast_aluminium"


class EarSpec(SpecModel):
    """One ear of the mounting flange."""

    angle_deg: float
    reach_mm: float = Field(gt=20, lt=180)
    """From the main axis to the centre of its hole."""
    radius_mm: float = Field(default=13, gt=5, lt=30)
    hole_mm: float = Field(default=11, ge=0, lt=25)
    """Diameter of its hole; 0 for none."""
    threaded: bool = False
    """True: a longer boss behind the ear."""


class NoseSpec(SpecModel):
    """What stands in front of the flange, around the pinion."""

    style: Literal["closed", "open", "stub"] = "closed"
    """`closed`: a bell with a front bearing and a window for the ring gear; `open`: an arm to a
    front bearing; `stub`: a short collar, the pinion stands free."""
    length_mm: float = Field(default=48, gt=4, lt=140)
    radius_mm: float = Field(default=27, gt=12, lt=70)
    """At its foot."""
    tip_radius_mm: float = Field(default=19, gt=7, lt=60)
    straight: float = Field(default=0.4, ge=0, le=0.8)
    """Share of the length before it tapers from foot to tip."""
    wall_mm: float = Field(default=4.5, gt=1.5, lt=12)
    window_angle_deg: float = -90
    """Middle of the window, or of the open side."""
    window_width_deg: float = Field(default=120, ge=0, lt=300)
    window_length_mm: float = Field(default=26, ge=0, lt=120)
    tip_boss_mm: float = Field(default=4, ge=0, lt=20)
    """Height of the front bearing's boss."""
    bearing_open: bool = True
    """True: the shaft's end shows in the boss; False: the boss is closed."""


class BracketSpec(SpecModel):
    """The drive-end bracket: mounting flange, nose, pad for the solenoid; class connector."""

    radius_mm: float = Field(default=42, gt=18, lt=100)
    """Of its round body."""
    body_length_mm: float = Field(default=22, gt=4, lt=90)
    """From the joint (or gearbox) to the front of the flange."""
    flange_mm: float = Field(default=10, gt=3, lt=30)
    """Thickness of the flange and its ears."""
    flange_style: Literal["ears", "round", "polygon"] = "ears"
    """`ears`: webs to each ear; `round`: a disc that the ears stand out of; `polygon`: the hull of
    the ears."""
    flange_radius_mm: float | None = Field(default=None, gt=18, lt=110)
    """Of the disc; None: as the body."""
    ears: tuple[EarSpec, ...] = (
        EarSpec(angle_deg=0, reach_mm=58),
        EarSpec(angle_deg=180, reach_mm=58),
    )
    ribs: int = Field(default=4, ge=0, le=16)
    """Ribs between body and flange or nose."""
    rib_mm: float = Field(default=4, gt=1, lt=12)
    """Thickness of a rib."""
    side_ribs: int = Field(default=0, ge=0, le=24)
    """Ribs along the body's side, behind the flange."""
    pockets: int = Field(default=0, ge=0, le=8)
    """Casting pockets in the front face."""
    pilot_mm: float = Field(default=0, ge=0, lt=12)
    """Height of the round register in front of the flange; 0 for none."""
    finish: Literal["cast_aluminium", "cast_iron", "painted_steel"] = "cast_aluminium"
    nose: NoseSpec = NoseSpec()


class SolenoidSpec(SpecModel):
    """The solenoid beside the yoke: a steel can with a plastic cap; class solenoid."""

    radius_mm: float = Field(default=25, gt=8, lt=50)
    length_mm: float = Field(default=66, gt=12, lt=220)
    """Of the can."""
    offset_mm: float = Field(default=65, gt=20, lt=140)
    """From the main axis to the solenoid's axis, in +y."""
    front_mm: float = Field(default=8, gt=-80, lt=80)
    """Where its front end is: distance in front of the joint."""
    pad_mm: float = Field(default=9, gt=2, lt=30)
    """Thickness of the bracket's pad in front of it."""
    flange_radius_mm: float | None = Field(default=None, gt=8, lt=60)
    """A mounting flange at the front of the can, flattened to lugs; None for none."""
    flange_mm: float = Field(default=4, gt=1, lt=12)
    cap_length_mm: float = Field(default=22, gt=3, lt=60)
    cap_radius_mm: float | None = Field(default=None, gt=6, lt=50)
    """None: a little less than the can."""
    cap_style: Literal["round", "stepped", "d_shaped", "square"] = "round"
    lever_housing: bool = True
    """A cast bridge over the shift lever between solenoid pad and nose; class connector."""
    lever_style: Literal["slab", "hump", "ribbed", "plate"] = "slab"
    """Shape of that bridge: `slab`: narrow with straight sides; `hump`: wide and rounded like a
    bell; `ribbed`: a plate with ribs; `plate`: an end plate across yoke and solenoid with a
    slender ridge."""
    plunger_boot: bool = False
    """A rubber boot over the plunger in front of an open pad; class solenoid."""
    finish: Literal["painted_steel", "bare_steel", "zinc"] = "painted_steel"


class StudSpec(SpecModel):
    """A terminal stud on the back of the solenoid's cap, with its nuts."""

    radius_mm: float = Field(default=12, ge=0, lt=45)
    angle_deg: float
    """Both polar about the solenoid's axis."""
    thread_mm: Literal[5, 6, 8, 10] = 8
    length_mm: float = Field(default=20, gt=3, lt=45)
    nuts: int = Field(default=1, ge=0, le=2)
    nut_height_mm: float = Field(default=5.5, gt=1, lt=12)
    bend_deg: float = Field(default=0, ge=0, le=25)


class PlugSpec(SpecModel):
    """A plug housing of the control line."""

    radius_mm: float = Field(default=14, ge=0, lt=60)
    angle_deg: float
    """Both polar about the solenoid's axis."""
    size_mm: tuple[float, float, float] = (14, 10, 18)
    """Width, depth and height; the height is along -z, or outward for a plug on the side."""
    on_side: bool = False
    """True: it stands radially on the cap's mantle."""
    kind: Literal["box", "blade", "round"] = "box"


class CableSpec(SpecModel):
    """The strap or cable from a stud to the yoke."""

    stud: int = Field(default=0, ge=0)
    """Index of the stud that it starts from."""
    radius_mm: float = Field(default=4, gt=1, lt=9)
    kind: Literal["cable", "braid", "bar"] = "cable"
    enters: Literal["rear_cap", "yoke"] = "yoke"
    """Where it goes into the motor, through a rubber grommet."""
    sag_mm: float = 6
    """How far it bulges outwards."""


class TerminalsSpec(SpecModel):
    """Everything electrical outside: class electrical connector."""

    studs: tuple[StudSpec, ...] = (StudSpec(angle_deg=60), StudSpec(angle_deg=-60))
    plug: PlugSpec | None = None
    cable: CableSpec | None = CableSpec()


class GearSpec(SpecModel):
    """Pinion, one-way clutch and shaft: class gear."""

    teeth: int = Field(default=10, ge=7, le=16)
    module_mm: float = Field(default=2.3, gt=1, lt=4.5)
    width_mm: float = Field(default=17, gt=5, lt=45)
    clutch_radius_mm: float = Field(default=17, gt=5, lt=45)
    clutch_length_mm: float = Field(default=14, gt=2, lt=50)
    shaft_radius_mm: float = Field(default=6, gt=2.5, lt=16)
    gap_mm: float = Field(default=4, ge=0, lt=60)
    """From the flange's front to the clutch."""
    stop_ring: bool = True
    """A ring on the shaft in front of the pinion."""
    turn_deg: float = 0
    """Turn of the teeth about the shaft."""


class MotorSpec(SpecModel):
    """A starter motor, wholly. `MotorSpec()` is one too: change what differs on your bench."""

    name: str = Field(default="motor", pattern=r"^[A-Za-z0-9._-]{1,60}$")
    family: str = "custom"
    """Which topology it was drawn from; free text for your own motors."""
    housing: HousingSpec = HousingSpec()
    rear_cap: RearCapSpec = RearCapSpec()
    gearbox: GearboxSpec | None = None
    bracket: BracketSpec = BracketSpec()
    solenoid: SolenoidSpec | None = SolenoidSpec()
    """None: a motor without one. Its +y is the direction that all angles here call 90 degrees;
    sampled motors have the window or open side of the nose in -y."""
    terminals: TerminalsSpec = TerminalsSpec()
    """Without a solenoid they sit on the rear cap, polar about the main axis."""
    gear: GearSpec = GearSpec()
    bolts: tuple[BoltSpec, ...] = ()
    distractors: tuple[DistractorSpec, ...] = ()
