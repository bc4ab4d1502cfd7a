"""What an operator does about a refusal, code by code."""

from __future__ import annotations

from dataclasses import dataclass

from boltpose.schema import Check


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice:
    """One reason code in an operator's words."""

    meaning: str
    todo: str


ADVICE: dict[Check, Advice] = {
    Check.NO_MOTOR: Advice(
        meaning="The scan shows no motor.",
        todo="Look at the picture. Is a motor clamped and in the camera's view? Clamp it, then scan"
        " again. If it is there: check the exposure and the unit of the scan (mm).",
    ),
    Check.TOO_FEW_POINTS: Advice(
        meaning="Too little of the motor was measured.",
        todo="Clear the view and clean the camera's window. Bring all of the motor into the"
        " picture, check the exposure, then scan again.",
    ),
    Check.EXPLAINED: Advice(
        meaning="What is clamped is not the chosen motor.",
        todo="Compare the type plate with the chosen motor. Choose the right one, or let boltpose"
        " choose: give it the folder of all motors.",
    ),
    Check.FREE_SPACE: Advice(
        meaning="The camera saw through places where the motor would have to be.",
        todo="Usually the wrong motor, or its mirror image. Check the type plate. If the type is"
        " right, look for parts that are missing and scan this motor anew for its prior.",
    ),
    Check.FIT: Advice(
        meaning="The motor is similar, but does not lie on the known shape.",
        todo="Check the type plate for another size of the same family. Wipe off thick grease and"
        " dirt. Make sure that nothing moved during the scan, then scan again.",
    ),
    Check.COVERAGE: Advice(
        meaning="Parts of the motor in free view were not measured.",
        todo="Shiny or black surface: change the exposure or the camera's place. Make sure that the"
        " scan is not cut off at its borders, then scan again.",
    ),
    Check.AMBIGUOUS: Advice(
        meaning="Two different positions fit nearly alike.",
        todo="Bring a part that tells front from back or the turn into view (solenoid, connector):"
        " scan from another side, or add a second scan.",
    ),
    Check.UNCONSTRAINED: Advice(
        meaning="Too little shape is in view to hold the position.",
        todo="Bring more of the motor into view: scan from another side, or add a second scan.",
    ),
    Check.UNLIKELY: Advice(
        meaning="Every check is met, but all together look like a wrong position.",
        todo="Scan again, from another side if you can. If it comes back: check the motor's type"
        " and tell the cell engineer.",
    ),
    Check.VIEWS_DISAGREE: Advice(
        meaning="The scans put the motor in different places.",
        todo="Make sure that the motor did not move between the scans and that every scan has its"
        " own robot pose. Then scan again. If it comes back: check the hand-eye calibration.",
    ),
    Check.UNKNOWN_MOTOR: Advice(
        meaning="None of the known motors fits, or two fit alike.",
        todo="Check the type plate. A new motor needs its own prior first (`boltpose prior build`)."
        " If two fit alike: choose the right one yourself.",
    ),
}
