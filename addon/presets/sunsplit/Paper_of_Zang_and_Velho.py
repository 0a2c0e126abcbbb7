import bpy

settings = bpy.context.scene.sunsplit

settings.target = "auto"
settings.lights = 64
settings.tolerance = 0.0
settings.share_auto = False
settings.share = 0.5
settings.strata = 2
settings.method = "penrose"
settings.samples = 0
settings.frequency = "energy"
settings.per_stratum = False
settings.shape = "point"
settings.position = "sample"
settings.fill = "auto"
settings.residual = "voronoi"
settings.residual_width = 0
settings.residual_samples = 493
settings.skips = True
settings.two_passes = False
settings.light_groups = False
