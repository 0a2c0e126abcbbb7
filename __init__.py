"""Sunsplit: an HDRI becomes sun lamps and a calm world. The extension's entry point."""


def register() -> None:
    from . import addon

    addon.register()


def unregister() -> None:
    from . import addon

    addon.unregister()
