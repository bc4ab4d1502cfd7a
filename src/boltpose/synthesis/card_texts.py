"""The parts of a data card that are the same for every data set."""

from __future__ import annotations

FORMAT_TEXT = """
## Files

    dataset.json                 the settings, and the versions of the packages it was made with
    motor_XXXXX/prior.ply        full scan, frame C: float x, y, z in mm, uchar label (binary)
    motor_XXXXX/prior_gt.json    T_M_to_C (motor frame -> scan frame), every bolt in C and in the
                                 motor frame, points per class, points per bolt
    motor_XXXXX/spec.json        the motor as a specification for `boltpose synth model`
    motor_XXXXX/wear.json        what use did to it

Classes: 0 background and clamp, 1 main housing, 2 connector, 3 solenoid, 4 electrical connector,
5 gear, 6 bolt. Nuts, rivets, bosses, pole screws, dowels and empty holes have the class of what
they sit on.

Frames: M motor (origin on the housing's axis half way along the motor without terminals, z from
main housing to connector, y towards the solenoid), C full scan (arbitrary), B camera (x right,
y down, z forward), A robot base. Column vectors, p_C = T_M_to_C p_M. All lengths are mm.

Of a bolt, `head_top` is on its axis in the top face, `position` = `head_centre` half way up the
head, `head_centroid` the centre of the head's outer surface, `axis` the unit vector out of the
head, `side` top for +z of M and bottom for -z, `across` the spanner size or head diameter, `name`
its id in the specification. The layout is that of the data set reman18, with more keys.
"""

SCENES_FORMAT_TEXT = """
    motor_XXXXX/depth/00000V.png     16 bit, along the optical axis; mm = value * depth_scale; 0 is
                                     no measurement
    motor_XXXXX/label/00000V.png     8 bit, class of every measured pixel
    motor_XXXXX/scene_camera.json    per view cam_K (3x3, row by row) and depth_scale
    motor_XXXXX/scene_gt.json        per view T_C_to_B (also as BOP has it), T_B_to_A
    motor_XXXXX/hand_eye/00000V.yaml T_B_to_A as Zivid writes it
    motor_XXXXX/bolts.json           per view every bolt of the scanned motor, seen or not

Every view clamps the motor anew: another clamp, another pose, another camera, other settings of
the sensor, and sometimes a motor that has changed since its scan (`present` is false for a bolt
that is gone). Half of the views are cut to a region of interest around the clamp, as many cells do.
Class bolt means heads; the rods of through-bolts are main housing. `visible_fraction` is the share
of 500 points, even by area, on the outer surface of a head that have a pixel of that bolt within
0.7 mm; `visible` asks for a tenth and 30 pixels.
"""

ANGLES_TEXT = """
Here every clamping is seen {angles} times, not once: views with the same `clamping` in bolts.json
(V // {angles}) show one motor in one clamp, untouched between the shots, by one camera from
{angles} places. Its settings and its systematic errors (scale, bias, ripple, lumps, warp) are the
same in all of them.
"""

LIMITS_TEXT = """
## What it is not

Shapes are generic: they follow how starter motors are built, no product. Labels are exact, people
label less exactly. Light is reflected once, there is no ambient light and no lens distortion (what
a maker's calibration leaves of it is in the sensor's warp), and no colour. Hand-eye matrices are
exact. A network that does well here has shown that it does well on simulated motors.
"""
