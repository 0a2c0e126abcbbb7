"""What a conversion has done, in sentences for the panel."""

from __future__ import annotations

from ..core.conversion import Conversion
from ..core.settings import ConversionSettings
from .scene_needs import SceneNeeds

LEAST_SAID = 0.0005
"""Of all light: less of it that reaches nothing is not worth a sentence."""


def headline(conversion: Conversion) -> str:
    count = len(conversion.suns)
    noun = "lamp" if count == 1 else "lamps"
    return f"{count} {noun} with {conversion.account.share:.1%} of all light"


def made_sentences(conversion: Conversion) -> list[str]:
    """How true it is, and what the user should know of it."""
    lines = []
    if conversion.suns:
        lines.append(
            f"By prediction right within {conversion.predicted_error:.2%} under shadows, "
            f"{conversion.ground_error:.2%} on level ground"
        )
    if conversion.residual is not None:
        error = conversion.account.relative_error.max()
        lines.append(f"Account: lamps + world = map within {error:.0e}")
    elif conversion.account.share < 0.999:
        lines.append(f"{1 - conversion.account.share:.1%} of all light is left out.")
    if conversion.environment.repairs.pixels:
        lines.append(f"Repaired pixels: {conversion.environment.repairs}")
    return [*lines, *conversion.notes]


def skipped_sentences(
    conversion: Conversion, settings: ConversionSettings, needs: SceneNeeds, tree_off: bool
) -> list[str]:
    """What was left out, and why. settings: as the user has them."""
    lines = []
    own, width = conversion.environment.own_width, conversion.settings.residual_width
    if conversion.invisible_part > LEAST_SAID:
        lines.append(
            f"Skipped: {conversion.invisible_part:.1%} of the light reaches nothing that the "
            "camera shows: no lamps for it, it stays in the world."
        )
    if conversion.residual is not None and width not in (settings.residual_width, "own"):
        why = "the camera is too coarse for more" if needs.mirrors else "nothing mirrors sharply"
        lines.append(
            f"Skipped: {why}, so the world that lights is {width} pixels wide instead of {own}."
        )
    shown = needs.width_for_camera(own)
    if not needs.camera_sees_world:
        lines.append("Skipped: the camera does not see the world, so renders do not load the HDRI.")
    elif shown != own:
        lines.append(
            f"Skipped: at this resolution the camera shows no more than {shown} pixels around, so "
            f"it gets a map that wide instead of {own}."
        )
    if tree_off:
        lines.append("Skipped: the light tree, as the lamps are cheaper without and alone.")
    return lines
