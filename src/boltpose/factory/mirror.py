"""Mirrored arrangements: the same motor for the other side of an engine."""

from __future__ import annotations

from boltpose.factory.spec import MotorSpec


def _turned(angle_deg: float) -> float:
    """A direction mirrored at the yz-plane, -180 to 180."""
    return round((180 - angle_deg + 180) % 360 - 180, 6)


def mirror_motor(spec: MotorSpec) -> MotorSpec:
    """Mirror where everything sits at the yz-plane; bolts and teeth stay as they are."""
    housing, bracket, nose = spec.housing, spec.bracket, spec.bracket.nose
    plate, seam = housing.name_plate_angle_deg, housing.seam_angle_deg
    terminals = spec.terminals
    gearbox = spec.gearbox
    if gearbox is not None:
        gearbox = gearbox.model_copy(update={"shaft_angle_deg": _turned(gearbox.shaft_angle_deg)})
    plug = terminals.plug
    if plug is not None:
        plug = plug.model_copy(update={"angle_deg": _turned(plug.angle_deg)})
    return spec.model_copy(
        update={
            "housing": housing.model_copy(
                update={
                    "flats": tuple(_turned(angle) for angle in housing.flats),
                    "name_plate_angle_deg": None if plate is None else _turned(plate),
                    "seam_angle_deg": None if seam is None else _turned(seam),
                }
            ),
            "gearbox": gearbox,
            "bracket": bracket.model_copy(
                update={
                    "ears": tuple(
                        ear.model_copy(update={"angle_deg": _turned(ear.angle_deg)})
                        for ear in bracket.ears
                    ),
                    "nose": nose.model_copy(
                        update={"window_angle_deg": _turned(nose.window_angle_deg)}
                    ),
                }
            ),
            "terminals": terminals.model_copy(
                update={
                    "studs": tuple(
                        stud.model_copy(update={"angle_deg": _turned(stud.angle_deg)})
                        for stud in terminals.studs
                    ),
                    "plug": plug,
                }
            ),
            "bolts": tuple(
                bolt.model_copy(update={"angle_deg": _turned(bolt.angle_deg)})
                for bolt in spec.bolts
            ),
            "distractors": tuple(
                item.model_copy(update={"angle_deg": _turned(item.angle_deg)})
                for item in spec.distractors
            ),
        }
    )
