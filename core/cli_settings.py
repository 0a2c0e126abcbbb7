"""The settings of a conversion as arguments of the command line."""

from __future__ import annotations

import argparse
from typing import get_args

from .figure_settings import FigureSettings
from .settings import (
    TOLERANCE,
    ConversionSettings,
    Fill,
    Frequency,
    Method,
    Position,
    ResidualKind,
    ResidualWidth,
    Shape,
    Target,
)

DEFAULTS = ConversionSettings()
FIGURES = FigureSettings()


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Every field of `ConversionSettings`, in groups."""
    _add_bright(parser.add_argument_group("the bright region A"))
    _add_placement(parser.add_argument_group("the lights"))
    _add_rest(parser.add_argument_group("the rest, region B"))


def settings_from(options: argparse.Namespace) -> ConversionSettings:
    """What was chosen."""
    return ConversionSettings(
        target=options.target,
        lights=options.lights,
        tolerance=options.tolerance,
        share=options.share,
        strata=options.strata,
        method=options.method,
        samples=options.samples,
        per_stratum=options.per_stratum,
        shape=options.shape,
        position=options.position,
        frequency=options.frequency,
        residual=options.residual,
        residual_width=options.residual_width,
        residual_samples=options.residual_samples,
        fill=options.fill,
    )


def add_figure_settings(parser: argparse.ArgumentParser) -> None:
    """Every field of `FigureSettings` but the number of Figure 1's samples."""
    group = parser.add_argument_group("the figures (defaults: the paper's)")
    counts = (
        ("samples", "of the whole map, figure 2"),
        ("lights", "of region A, figure 3"),
        ("residual-samples", "samples of region B, figure 3"),
    )
    for name, what in counts:
        default = getattr(FIGURES, name.replace("-", "_"))
        what = f"{what} (default: %(default)s)"
        group.add_argument(f"--{name}", type=_count, default=default, metavar="N", help=what)
    group.add_argument(
        "--share",
        type=_share,
        default=FIGURES.share,
        metavar="X",
        help="part of all light in region A, 0 to 1, or auto (default: %(default)s)",
    )
    group.add_argument(
        "--strata",
        type=_strata,
        default=FIGURES.strata,
        metavar="N",
        help="strata of luminance; half of them are region A (default: %(default)s)",
    )
    group.add_argument(
        "--method",
        choices=[method for method in get_args(Method) if method != "edge"],
        default=FIGURES.method,
        help="how samples are placed (default: %(default)s)",
    )


def figure_settings_from(options: argparse.Namespace) -> FigureSettings:
    return FigureSettings(
        samples=options.samples,
        lights=options.lights,
        share=options.share,
        strata=options.strata,
        residual_samples=options.residual_samples,
        method=options.method,
    )


def _add_bright(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--target",
        choices=get_args(Target),
        default=DEFAULTS.target,
        help="what the result is for: cycles (default) shows the rest with its shadows; eevee and "
        "export light with it from everywhere, so that more of the map becomes suns; both is as "
        "eevee, and chosen to be right in Cycles too",
    )
    group.add_argument(
        "--share",
        type=_share,
        metavar="X",
        help="part of all light in the bright region, 0 (no suns) to 1 (no residual), or auto "
        "(default): for cycles whole peaks with their halo, else where shadows are truest",
    )
    group.add_argument(
        "--strata",
        type=_strata,
        default=DEFAULTS.strata,
        metavar="N",
        help="strata of luminance; half of them are region A (default: %(default)s)",
    )
    group.add_argument(
        "--fill",
        choices=get_args(Fill),
        help="what the residual shows in region A (default: surroundings with edge, else black)",
    )


def _add_placement(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--lights",
        type=_lights,
        metavar="N",
        help="at most N suns, or auto (default): as few as the tolerance allows",
    )
    group.add_argument(
        "--tolerance",
        type=_percent,
        metavar="PERCENT",
        help="how wrong shadows may be by prediction, of the mean irradiance (default: "
        f"{TOLERANCE:g} with --lights auto, else none)",
    )
    group.add_argument(
        "--method",
        choices=get_args(Method),
        default=DEFAULTS.method,
        help="how lights are placed (default: edge: in cells for the truest shadows; "
        "the others place samples by importance, a light for the cell of each)",
    )
    group.add_argument(
        "--samples",
        type=_count,
        metavar="N",
        help="place N samples and cluster them down to the lights (default: as few as it takes)",
    )
    group.add_argument(
        "--frequency",
        choices=get_args(Frequency),
        default=DEFAULTS.frequency,
        help="what weighs samples that are clustered (default: %(default)s)",
    )
    group.add_argument(
        "--per-stratum", action="store_true", help="place lights in each bright stratum by itself"
    )
    group.add_argument(
        "--shape",
        choices=get_args(Shape),
        default=DEFAULTS.shape,
        help="disc: as wide as the light that it replaces (default); point: of no width",
    )
    group.add_argument(
        "--position",
        choices=get_args(Position),
        default=DEFAULTS.position,
        help="of a light in its cell: where its light has its mean (default), or at the sample",
    )


def _add_rest(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--residual",
        choices=get_args(ResidualKind),
        default=DEFAULTS.residual,
        help="the map without the suns, its Voronoi map, or nothing (default: %(default)s)",
    )
    group.add_argument(
        "--residual-width",
        type=_residual_width,
        metavar="PIXELS",
        help='a whole part of the map\'s width, "own" for all of it, which mirrors and backgrounds '
        'show, or "lighting" for as few as light needs (default: about 1024)',
    )
    group.add_argument(
        "--residual-samples",
        type=_count,
        default=DEFAULTS.residual_samples,
        metavar="N",
        help="cells of a Voronoi map (default: %(default)s)",
    )


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from 1 up")
    return int(text)


def _residual_width(text: str) -> ResidualWidth:
    if text == "own" or text == "lighting":
        return text
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no number from 1 up, own or lighting")
    return int(text)


def _lights(text: str) -> int | None:
    if text == "auto":
        return None
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is neither auto nor a number from 1 up")
    return int(text)


def _percent(text: str) -> float:
    try:
        percent = float(text.removesuffix("%"))
    except ValueError:
        percent = -1.0
    if not 0 < percent <= 100:
        raise argparse.ArgumentTypeError(f"{text!r} is no percentage above 0 and up to 100")
    return percent


def _strata(text: str) -> int:
    if not text.isdecimal() or int(text) < 2 or int(text) % 2:
        raise argparse.ArgumentTypeError(f"{text!r} is not an even number from 2 up")
    return int(text)


def _share(text: str) -> float | None:
    if text == "auto":
        return None
    try:
        share = float(text)
    except ValueError:
        share = -1.0
    if not 0 <= share <= 1:
        raise argparse.ArgumentTypeError(f"{text!r} is neither auto nor 0 to 1")
    return share
