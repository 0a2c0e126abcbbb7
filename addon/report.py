"""What a conversion has done, in sentences for the panel: whole ones, which can be translated."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bpy.app.translations import pgettext_rpt as said

from ..core.conversion import Conversion
from ..core.settings import ConversionSettings
from ..core.suspicions import map_warnings
from .scene_needs import SceneNeeds

if TYPE_CHECKING:
    from ..core.files.written import WrittenConversion

ALL_LIGHT = 0.999
"""Of all light, in lamps: the rest shows nowhere."""

LEAST_SAID = 0.0005
"""Of all light: less of it that reaches nothing, or is shown wrong, is not worth a sentence."""


def headline(count: int, share: float) -> str:
    """count: of lamps. share: of all light that they give."""
    if count == 1:
        return said("1 lamp with {share:.1%} of all light").format(share=share)
    return said("{count} lamps with {share:.1%} of all light").format(count=count, share=share)


def predicted(conversion: Conversion | WrittenConversion) -> str:
    """What is to be wrong by prediction, as parts of the light."""
    edges, ground = conversion.predicted_error, conversion.ground_error
    walls = conversion.standing_error
    if walls is None:
        text = said(
            "By prediction right within {edges:.2%} under shadows, {ground:.2%} on level ground"
        )
    else:
        text = said(
            "By prediction right within {edges:.2%} under shadows, {ground:.2%} on level ground, "
            "{walls:.2%} on walls"
        )
    return text.format(edges=edges, ground=ground, walls=walls)


def _predicted_indoors(conversion: Conversion) -> str:
    text = said("By prediction right within {error:.2%} where light comes in through openings")
    return text.format(error=conversion.predicted_error)


def made_sentences(conversion: Conversion) -> list[str]:
    """How true it is, and what the user should know of it."""
    lines = []
    if conversion.suns:
        lines.append(
            _predicted_indoors(conversion) if conversion.is_indoors else predicted(conversion)
        )
    if conversion.gloss_error is not None and conversion.gloss_error > LEAST_SAID:
        text = said("What shines shows that light right within {error:.2%}, by prediction")
        lines.append(text.format(error=conversion.gloss_error))
    if conversion.residual is not None:
        error = conversion.account.relative_error.max()
        lines.append(said("Account: lamps + world = map within {error:.0e}").format(error=error))
    elif conversion.account.share < 0.999:
        left = 1 - conversion.account.share
        lines.append(said("{left:.1%} of all light is left out.").format(left=left))
    if conversion.environment.repairs.pixels:
        repairs = conversion.environment.repairs
        lines.append(said("Repaired pixels: {repairs}").format(repairs=repairs))
    return [*lines, *map_warnings(conversion), *conversion.notes]


def looked_sentences(needs: SceneNeeds) -> list[str]:
    """At which frames, where anything moves."""
    if not needs.looked:
        return []
    count, first, last = needs.looked
    text = said("Looked at {count} frames of {first} to {last} to see what may be skipped.")
    return [text.format(count=count, first=first, last=last)]


def skipped_sentences(
    conversion: Conversion, settings: ConversionSettings, needs: SceneNeeds, tree_off: bool
) -> list[str]:
    """What was left out, and why. settings: as the user has them."""
    lines = looked_sentences(needs)
    own, width = conversion.environment.own_width, conversion.width_that_lights
    if conversion.invisible_part > LEAST_SAID:
        text = said(
            "Skipped: {part:.1%} of the light reaches nothing that the camera shows: no lamps for "
            "it, it stays in the world."
        )
        lines.append(text.format(part=conversion.invisible_part))
    if settings.residual_width is None and width is not None and width < own:
        lines.append(_lights_narrower(needs).format(width=width, own=own))
    if not (conversion.settings.mirrors or conversion.account.share < ALL_LIGHT):
        lines.append(
            said(
                "Skipped: nothing mirrors sharply, so all light is in lamps, which EEVEE shadows; "
                "only the camera sees the world."
            )
        )
    if not needs.shows_map:
        lines.append(
            said("Skipped: the camera does not see the world, so renders do not load the HDRI.")
        )
    elif needs.shown_width(own) != own:
        lines.append(_shown_narrower(needs).format(shown=needs.shown_width(own), own=own))
    if any(sun.angular_diameter <= needs.unmet_width for sun in conversion.suns):
        alone = said(
            "Skipped: nothing mirrors sharply, so rays need not meet lamps by chance. If you "
            "add a mirror, convert again: till then it shows no sun."
        )
        besides = said(
            "Skipped: nothing else mirrors sharply, so rays need not meet lamps by chance. If you "
            "add something shiny, convert again: till then it shows no sun."
        )
        lines.append(besides if needs.singular else alone)
    if tree_off:
        lines.append(said("Skipped: the light tree, as it would take longer than it saves."))
    return lines


def _lights_narrower(needs: SceneNeeds) -> str:
    """With places for the width of the world that lights, and of the map's own."""
    if needs.mirrors:
        return said(
            "Skipped: the camera is too coarse for more, so the world that lights is {width} "
            "pixels wide instead of {own}."
        )
    if needs.singular:  # which show the map itself
        return said(
            "Skipped: nothing mirrors it sharply, so the world that lights is {width} pixels wide "
            "instead of {own}."
        )
    return said(
        "Skipped: nothing mirrors sharply, so the world that lights is {width} pixels wide "
        "instead of {own}."
    )


def _shown_narrower(needs: SceneNeeds) -> str:
    """With places for the width of what is shown, and of the map's own."""
    if needs.singular:
        return said(
            "Skipped: at this resolution camera and mirrors show no more than {shown} pixels "
            "around, so they get a map that wide instead of {own}."
        )
    return said(
        "Skipped: at this resolution the camera shows no more than {shown} pixels around, so "
        "it gets a map that wide instead of {own}."
    )


def mirror_sentences(needs: SceneNeeds, twins: int) -> list[str]:
    """twins: lamps that mirrors have for themselves."""
    if not needs.singular:
        return []
    if not twins:
        return [said("Mirrors and clear glass show the HDRI itself instead of lamps.")]
    return [
        said(
            "Mirrors and clear glass show the HDRI itself instead of lamps. If you add some, "
            "convert again: till then they show both."
        )
    ]


def portal_sentences(count: int) -> list[str]:
    """count: of openings that were found and got a portal."""
    if not count:
        return []
    if count == 1:
        return [
            said("Light comes in through 1 opening: a portal tells Cycles where to look for it.")
        ]
    text = said(
        "Light comes in through {count} openings: portals tell Cycles where to look for it."
    )
    return [text.format(count=count)]
