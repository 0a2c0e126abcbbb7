"""`scene.sunsplit`: what the user chose for a scene, and what is needed to take it back."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..core.export.settings import LUMENS_PER_WATT
from ..core.settings import MOST, TOLERANCE, ConversionSettings

DEFAULTS = ConversionSettings()

# As arguments of the operator they are not remembered: the scene's settings are.
_FRESH: set[str] = {"SKIP_SAVE"}

CHOICES = {
    "target": EnumProperty(
        name="Target",
        description="What shows the result",
        items=[
            ("auto", "Render Engine", "EEVEE for a scene that EEVEE renders, else Cycles"),
            ("cycles", "Cycles", "The world keeps its shadows: lamps for what would make noise"),
            (
                "eevee",
                "EEVEE",
                "The world casts no shadows: with an automatic share more of it becomes lamps",
            ),
            ("both", "Both", "As EEVEE, and right in Cycles with the same lamps"),
            ("export", "Export", "As EEVEE, and the whole map may become lamps"),
        ],
        default="auto",
        options=_FRESH,
    ),
    "lights": IntProperty(
        name="Lights",
        description="At most so many sun lamps, used up where they make shadows truer; "
        "0: as few as the tolerance allows",
        default=0,
        options=_FRESH,
        min=0,
        max=MOST["lights"],
        soft_max=64,
    ),
    "tolerance": FloatProperty(
        name="Tolerance",
        description="How wrong shadows may be by prediction, in percent of the mean light: more "
        f"lamps are not made. 0: {TOLERANCE:g} % where Lights is 0, else none",
        default=0.0,
        options=_FRESH,
        min=0.0,
        max=100.0,
        soft_max=10.0,
        precision=2,
        subtype="PERCENTAGE",
    ),
    "share_auto": BoolProperty(
        name="Automatic Share",
        description="Find the bright region by itself: whole lights with their halo",
        default=True,
        options=_FRESH,
    ),
    "share": FloatProperty(
        name="Share",
        description="Part of all light in the bright region. 0: no lamps; 1: the whole map "
        "becomes lamps",
        default=0.5,
        options=_FRESH,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
    ),
    "strata": IntProperty(
        name="Strata",
        description="Levels of brightness that the map is cut into (an even number)",
        default=DEFAULTS.strata,
        options=_FRESH,
        min=2,
        step=2,
        soft_max=16,
    ),
    "method": EnumProperty(
        name="Method",
        description="How lamps are placed in the bright region",
        items=[
            (
                "edge",
                "Truest Shadows",
                "Cells of light, cut and balanced where a lamp's shadow would be most wrong",
            ),
            (
                "penrose",
                "Penrose",
                "Samples of a Penrose tiling by importance, a lamp for each",
            ),
            ("median-cut", "Median Cut", "Boxes that hold equal light, a lamp for each"),
            ("variance", "Variance", "Boxes whose light is least spread, a lamp for each"),
            ("kmeans", "K-Means", "Cells around the means of their light, a lamp for each"),
        ],
        default=DEFAULTS.method,
        options=_FRESH,
    ),
    "samples": IntProperty(
        name="Samples",
        description="So many samples are clustered down to the lights; 0: as few as it takes",
        default=0,
        options=_FRESH,
        min=0,
        max=MOST["samples"],
        soft_max=4096,
    ),
    "frequency": EnumProperty(
        name="Frequency",
        description="What weighs samples that lie so close that they are clustered",
        items=[
            ("energy", "Energy", "The light of each sample's cell"),
            ("mean", "Mean", "The light of each sample's cell over the cell's area"),
            ("one", "One", "Each sample counts the same"),
        ],
        default=DEFAULTS.frequency,
        options=_FRESH,
    ),
    "per_stratum": BoolProperty(
        name="Per Stratum",
        description="Lamps are placed in each bright stratum by itself",
        default=DEFAULTS.per_stratum,
        options=_FRESH,
    ),
    "shape": EnumProperty(
        name="Shape",
        description="What the lamps look like in a mirror, and how soft their shadows are",
        items=[
            ("disc", "Discs", "As wide as the light that they replace"),
            ("point", "Points", "Of no width: hard shadows, not seen in mirrors"),
        ],
        default=DEFAULTS.shape,
        options=_FRESH,
    ),
    "position": EnumProperty(
        name="Position",
        description="Where a lamp stands in its cell",
        items=[
            ("centroid", "Mean of Light", "Where the cell's light has its mean"),
            ("sample", "Sample", "Where the sample was placed"),
        ],
        default=DEFAULTS.position,
        options=_FRESH,
    ),
    "fill": EnumProperty(
        name="Under Lamps",
        description="What the world shows where the lamps' light was taken out",
        items=[
            ("auto", "Automatic", "The surroundings with whole lights, else black"),
            ("surroundings", "Surroundings", "Lamps get what shines above the surroundings"),
            ("black", "Black", "Lamps get all the light of the bright region"),
        ],
        default="auto",
        options=_FRESH,
    ),
    "residual": EnumProperty(
        name="Residual",
        description="What becomes of the light that no lamp gives",
        items=[
            ("map", "World Map", "The world shows the map without the lamps' light"),
            ("voronoi", "Voronoi Map", "The world shows cells of samples of that map"),
            ("none", "Nothing", "Lamps only: the rest of the light is left out"),
        ],
        default=DEFAULTS.residual,
        options=_FRESH,
    ),
    "residual_width": IntProperty(
        name="Residual Width",
        description="Pixels of the residual map's width, a whole part of the map's; 0: as many as "
        "lights and mirrors of the scene need",
        default=0,
        options=_FRESH,
        min=0,
    ),
    "residual_samples": IntProperty(
        name="Residual Samples",
        description="Cells of the Voronoi map",
        default=DEFAULTS.residual_samples,
        options=_FRESH,
        min=1,
        max=MOST["residual_samples"],
        soft_max=4096,
    ),
    "skips": BoolProperty(
        name="Skip the Unneeded",
        description="Leave out what this scene, as it is now, cannot show: lamps for light that "
        "reaches nothing the camera sees, an HDRI that it does not see or is wider than its "
        "picture, details that nothing mirrors, Cycles' light tree",
        default=True,
        options=_FRESH,
    ),
    "two_passes": BoolProperty(
        name="Two Passes",
        description="Lamps and world as two view layers, each with the samples that its noise asks "
        "for, added in the compositor (Cycles)",
        default=False,
        options=_FRESH,
    ),
    "light_groups": BoolProperty(
        name="Light Groups",
        description="Lamps in the light group Suns and the world in Sky, to balance them after the "
        "render (Cycles)",
        default=False,
        options=_FRESH,
    ),
}
"""The settings of a conversion, once: for the scene and as arguments of the operator."""


EXPORT_CHOICES = {
    "format": EnumProperty(
        name="Format",
        description="Whose files are written",
        items=[
            ("pbrt", "pbrt", "pbrt-v4: parallel lights and a map around the scene"),
            ("mitsuba", "Mitsuba", "Mitsuba 3: parallel lights and a map around the scene"),
            ("povray", "POV-Ray", "POV-Ray 3.7: area lights, and a map that lights by radiosity"),
            ("usd", "USD", "Universal Scene Description: distant lights and a dome light"),
            ("gltf", "glTF", "glTF 2.0: directional lights in lux, and the map beside them"),
        ],
        default="usd",
        options=_FRESH,
    ),
    "up": EnumProperty(
        name="Up",
        description="The axis that points up in the files",
        items=[
            ("usual", "Usual", "What the format's users expect"),
            ("y", "Y", "Y up"),
            ("z", "Z", "Z up, as in Blender"),
        ],
        default="usual",
        options=_FRESH,
    ),
    "discs": EnumProperty(
        name="Discs",
        description="What becomes of suns with a width where the format has no such lights",
        items=[
            ("auto", "Automatic", "Narrow suns become many lights, wide ones go into the map"),
            ("lights", "Many Lights", "Each becomes many lights: shadows fade in small steps"),
            ("map", "In the Map", "Each goes into the map, as the disc that it is"),
        ],
        default="auto",
        options=_FRESH,
    ),
    "lux": FloatProperty(
        name="Lux",
        description="What a light of strength 1 has in the file: 683 as in Blender's own glTF "
        "files, 1 for viewers that take lux as a plain number",
        default=LUMENS_PER_WATT,
        options=_FRESH,
        min=1e-6,
        soft_min=1.0,
        soft_max=LUMENS_PER_WATT,
    ),
    "reader": EnumProperty(
        name="For",
        description="Who reads the file: Blender's importer takes suns of USD for four times as "
        "strong and twice as wide as they are",
        items=[
            ("usdlux", "All Others", "Whoever follows the specification, UsdLux"),
            ("blender", "Blender", "Blender's own importer"),
        ],
        default="usdlux",
        options=_FRESH,
    ),
}
"""The settings of an export, once: for the scene and as arguments of the operator."""


class SunsplitExport(bpy.types.PropertyGroup):
    """Settings of the next export."""

    __annotations__ = EXPORT_CHOICES


class SunsplitLamp(bpy.types.PropertyGroup):
    """One lamp of a conversion: known by itself, not by a name or mark that a copy has too."""

    __annotations__ = {"lamp": PointerProperty(type=bpy.types.Object)}


class SunsplitBeforePasses(bpy.types.PropertyGroup):
    """What two passes have changed, and what they have made for it.

    samples: of the user's view layer. use_layer_samples: empty, where there are no two passes.
    compositor: what our nodes are in, from Blender 5 on; before, a scene has one of its own.
    """

    __annotations__ = {
        "samples": IntProperty(),
        "use_layer_samples": StringProperty(),
        "use_compositing": BoolProperty(),
        "use_single_layer": BoolProperty(),
        "use_nodes": BoolProperty(),
        "black_world": PointerProperty(type=bpy.types.World),
        "compositor": PointerProperty(type=bpy.types.NodeTree),
    }


class SunsplitBeforeEevee(bpy.types.PropertyGroup):
    """Settings of EEVEE as they were before a conversion changed them, where it did: `is_set`."""

    __annotations__ = {
        "is_set": BoolProperty(),
        "use_shadows": BoolProperty(),
        "shadow_steps": IntProperty(),
        "shadow_pool": StringProperty(),
        "clamp_indirect": FloatProperty(),
    }


class SunsplitSettings(bpy.types.PropertyGroup):
    """Settings of the next conversion, and what the last one has made."""

    __annotations__ = CHOICES | {
        "original_world": PointerProperty(
            type=bpy.types.World, name="Original World", description="What Restore brings back"
        ),
        "converted_world": PointerProperty(
            type=bpy.types.World, name="Converted World", description="What Restore removes"
        ),
        "collection": PointerProperty(
            type=bpy.types.Collection, name="Suns", description="What holds the lamps"
        ),
        "lamps": CollectionProperty(type=SunsplitLamp),
        "portals": CollectionProperty(type=SunsplitLamp),
        "portals_collection": PointerProperty(
            type=bpy.types.Collection, name="Portals", description="What shows Cycles the openings"
        ),
        "sky": PointerProperty(
            type=bpy.types.Object, name="Sky", description="What turns the lamps with the world"
        ),
        "light_tree_off": BoolProperty(
            name="Light Tree Off", description="Restore switches Cycles' light tree on again"
        ),
        "before_passes": PointerProperty(type=SunsplitBeforePasses),
        "show_overlay": BoolProperty(
            name="Show Suns",
            description="In the 3D view the suns on the sky and where their light comes from, in "
            "the Image editor the bright region, its cells and the suns over the HDRI; a click on "
            "a sun selects its lamp. Never in renders",
            default=True,
        ),
        "outlines": StringProperty(
            name="Outlines", description="The bright region and its cells, for the overlay"
        ),
        "before_eevee": PointerProperty(type=SunsplitBeforeEevee),
        "export": PointerProperty(type=SunsplitExport),
        "report": StringProperty(
            name="Report", description="What the last conversion did, a sentence a line"
        ),
    }

    @property
    def is_converted(self) -> bool:
        """Whether there is a conversion to restore, even where the user has removed parts."""
        return bool(self.original_world or self.converted_world or self.collection)
