"""The pipeline: an environment map goes in; suns, a residual map and an account come out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .account import Account, settle
from .cells import Cells
from .environment import LUMINANCE_WEIGHTS, EnvironmentMap
from .placement.choice import choose_suns
from .progress import Progress, silent
from .region import light_of_map, light_of_region_a
from .residual import LevelledPixels, residual_of, without
from .samples import MapOfSamples, map_of_samples
from .settings import ConversionSettings
from .share import choose_strata
from .strata import Strata
from .suns import Sun
from .visible import VisiblePart, in_gloss, to_indoors
from .whole_lights import suns_for_whole_lights


@dataclass(frozen=True, eq=False)
class Conversion:
    """What became of a map.

    suns: brightest first. cells: what light each took, None without suns. residual: float32
    (height, width, 3) of the width that was asked for, or None. levelled: the same with all pixels
    of a wide map, where these were asked for; then `residual` is as narrow as what was looked at.
    samples: what a Voronoi residual was made of, else None. predicted_error: what shadows of the
    suns are wrong by, as a part of the mean irradiance; see `prediction.Prediction`, and
    `placement.ChosenSuns.standing_error` for walls. ground_error:
    what level ground in the open gets wrong of the worst channel, as a part of its irradiance; 0
    where it is indoors. gloss_error: see `placement.ChosenSuns`.
    visible: what suns were chosen from, where that is not the whole map, or indoors. notes: plain
    sentences for the user.
    """

    environment: EnvironmentMap
    settings: ConversionSettings
    strata: Strata
    suns: tuple[Sun, ...]
    cells: Cells | None
    residual: NDArray[np.float32] | None
    levelled: LevelledPixels | None
    samples: MapOfSamples | None
    account: Account
    predicted_error: float
    ground_error: float
    standing_error: float | None
    gloss_error: float | None
    visible: VisiblePart | None
    notes: tuple[str, ...]

    @property
    def visible_share(self) -> float:
        """Part of the visible luminance that the suns give."""
        return float(self.account.suns @ LUMINANCE_WEIGHTS) / self.strata.light

    @property
    def is_indoors(self) -> bool:
        """Whether errors are predicted for places that light reaches through openings only."""
        return self.visible is not None and self.visible.indoors is not None

    @property
    def width_that_lights(self) -> int | None:
        """Of the whole residual, None without one."""
        if self.residual is None:
            return None
        return self.levelled.width if self.levelled else self.residual.shape[1]

    @property
    def invisible_part(self) -> float:
        """Of all luminance, what reaches nothing that is looked at."""
        if self.visible is None:
            return 0.0
        return 1 - self.strata.light / float(self.account.source @ LUMINANCE_WEIGHTS)


def convert(
    environment: EnvironmentMap,
    settings: ConversionSettings | None = None,
    progress: Progress = silent,
    visible: VisiblePart | None = None,
) -> Conversion:
    """Split a map into suns (region A) and a residual map (region B).

    visible: what of the map reaches what is looked at, where that is known: what does not stays in
    the residual, unless the share or the target asks for all of the map. Places indoors count
    where a share is given, too.
    """
    settings = settings or ConversionSettings()
    visible = _what_counts(visible, settings)
    progress("strata", 0.0)
    strata = choose_strata(environment, settings, visible)
    progress("region A", 0.3)
    light = strata.once(
        settings.filled, lambda: light_of_region_a(environment, strata, settings.filled)
    )
    progress("suns", 0.5)
    if settings.takes_whole_lights:
        light, chosen, notes = suns_for_whole_lights(light, strata, settings, visible)
    else:
        notes = ()
        shadowed = settings.shadowed_residual
        unshadowed = None if shadowed else light_of_map(without(environment, light))
        chosen = choose_suns(light, strata, settings, unshadowed, visible)
    progress("residual", 0.7)
    residual, levelled, samples = None, None, None
    notes = (*_share_note(strata, settings), *notes, *chosen.notes)
    if settings.leaves_residual:
        seen = strata.light / float(environment.scalar_irradiance @ LUMINANCE_WEIGHTS)
        residual, levelled = residual_of(environment, light, settings.residual_width, seen)
        if settings.residual == "voronoi":
            samples, more = map_of_samples(residual, settings)
            residual, levelled, notes = samples.radiance, None, notes + more
    progress("account", 0.9)
    account = settle(environment, chosen.suns, residual)
    progress("done", 1.0)
    return Conversion(
        environment,
        settings,
        strata,
        chosen.suns,
        chosen.taken and Cells(light.lit.pixels, chosen.taken, light.width, light.height),
        residual,
        levelled,
        samples,
        account,
        chosen.predicted_error,
        chosen.ground_error,
        chosen.standing_error,
        chosen.gloss_error,
        visible,
        notes,
    )


def _what_counts(visible: VisiblePart | None, settings: ConversionSettings) -> VisiblePart | None:
    """All of the map where that is asked for, but to no other places or surfaces."""
    if visible is None or settings.chooses_border:
        return visible
    if not settings.shadowed_residual:
        return None
    if visible.indoors is not None:
        return to_indoors(None, visible.indoors)
    return in_gloss(None, visible.gloss)


def _share_note(strata: Strata, settings: ConversionSettings) -> tuple[str, ...]:
    asked = settings.share
    if asked is None or abs(strata.share - asked) <= min(0.02, asked / 2):
        return ()
    return (
        f"A share of {asked:.2%} was asked for; pixels of equal brightness stay together, so "
        f"region A holds {strata.share:.1%}.",
    )
