"""What the panel's choices mean: settings for the core, and what only concerns the scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from ..core.settings import ConversionSettings
from .eevee import target_for


@dataclass(frozen=True)
class SceneOptions:
    """What a scene may choose besides what becomes of its map.

    skips: what the scene does not need, as it is now, is left out. two_passes, light_groups: see
    the modules of these names.
    """

    skips: bool = True
    two_passes: bool = False
    light_groups: bool = False


def settings_for(chosen: Mapping[str, Any], engine: str) -> ConversionSettings:
    """The values of the panel, by the names of `properties.CHOICES`, as the core wants them.

    engine: of the scene, for the target that it chooses.
    """
    options = {field.name for field in fields(SceneOptions)}
    values = {name: value for name, value in chosen.items() if name not in options}
    share = None if values.pop("share_auto") else float(values["share"])
    return ConversionSettings(
        **values
        | {
            "target": target_for(values["target"], engine),
            "share": share,
            "lights": values["lights"] or None,
            "tolerance": values["tolerance"] or None,
            # The slider can stop at an odd number; the next even one is meant.
            "strata": values["strata"] + values["strata"] % 2,
            "samples": values["samples"] or None,
            "residual_width": values["residual_width"] or None,
            "fill": None if values["fill"] == "auto" else values["fill"],
        }
    )


def options_for(chosen: Mapping[str, Any]) -> SceneOptions:
    """The rest of what `settings_for` takes."""
    return SceneOptions(**{field.name: bool(chosen[field.name]) for field in fields(SceneOptions)})
