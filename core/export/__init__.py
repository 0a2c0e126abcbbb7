"""A conversion as files of other renderers: from `Skylight` through `Emitters` to text."""
