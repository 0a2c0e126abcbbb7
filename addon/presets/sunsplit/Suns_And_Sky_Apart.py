import bpy

settings = bpy.context.scene.sunsplit

settings.target = "auto"
settings.lights = 0
settings.tolerance = 0.0
settings.share_auto = True
settings.share = 0.5
settings.strata = 2
settings.method = "edge"
settings.samples = 0
settings.frequency = "energy"
settings.per_stratum = False
settings.shape = "disc"
settings.position = "centroid"
settings.fill = "auto"
settings.residual = "map"
settings.residual_width = 0
settings.residual_samples = 500
settings.skips = True
settings.two_passes = False
settings.light_groups = True
