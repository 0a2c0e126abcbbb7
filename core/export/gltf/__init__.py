"""glTF 2.0: `lights` makes the files of `document`s, `scene` and `images` are their parts."""

from .lights import made_for_gltf

__all__ = ["made_for_gltf"]
