"""Draw the overlay of one sun without a window: python -m tests.addon.draw_overlay OUT"""

from __future__ import annotations

import sys
from types import SimpleNamespace

import bpy  # noqa: F401  gpu comes with it
import gpu
import numpy as np
from mathutils import Matrix

from sunsplit.addon.overlay.draw import Drawing
from sunsplit.addon.overlay.layers import sun_layers, words
from sunsplit.addon.overlay.marks import discs_in_map, marks_in_map
from sunsplit.addon.overlay.screen import Frame
from sunsplit.addon.overlay.suns import ShownSuns

WIDTH, HEIGHT = 400, 300


def main(path: str) -> None:
    """One orange sun of 60 pixels' radius in the middle of a grey picture."""
    suns = ShownSuns(
        lamps=(SimpleNamespace(name="Sun 1"),),
        to_light=np.array([[1.0, 0, 0]]),
        half_angle=np.array([np.pi / 8]),
        colour=np.array([[1.0, 0.66, 0.25]]),
        rank=(1,),
        selected=np.zeros(1, bool),
        active=None,
    )
    # On a map 960 x 480 with its middle in the picture's, a pixel is 3 / 8 of a degree.
    size = np.array([960.0, 480.0])
    origin = np.array([WIDTH, HEIGHT]) / 2 - size / 2
    marks = marks_in_map(discs_in_map(suns.to_light, suns.half_angle), origin, size, 9.0)
    halo, frame = np.ones((1, 4)), Frame(0, 0, WIDTH, HEIGHT)
    gpu.init()
    canvas = gpu.types.GPUOffScreen(WIDTH, HEIGHT)
    with canvas.bind():
        gpu.state.active_framebuffer_get().clear(color=(128 / 255, 128 / 255, 128 / 255, 1))
        gpu.matrix.load_matrix(Matrix.Identity(4))
        scale, shift = (
            Matrix.Diagonal((2 / WIDTH, 2 / HEIGHT, 1, 1)),
            Matrix.Translation((-1, -1, 0)),
        )
        gpu.matrix.load_projection_matrix(shift @ scale)
        labels = words(suns, marks, halo, frame, 1.0, ranks_only=False)
        Drawing(sun_layers(suns, marks, halo, 1.0), labels).draw()
        read = gpu.state.active_framebuffer_get().read_color(0, 0, WIDTH, HEIGHT, 4, 0, "UBYTE")
    read.dimensions = WIDTH * HEIGHT * 4
    np.save(path, np.array(read, np.uint8).reshape(HEIGHT, WIDTH, 4))
    canvas.free()


if __name__ == "__main__":
    main(sys.argv[1])
