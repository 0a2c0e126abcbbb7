"""`blender --command sunsplit ...`: the command line of the core, inside Blender."""

import bpy

_handle: list[object] = []


def register() -> None:
    # One name for one command: a second registration would raise.
    if not _handle:
        _handle.append(bpy.utils.register_cli_command("sunsplit", _run))


def unregister() -> None:
    while _handle:
        bpy.utils.unregister_cli_command(_handle.pop())


def _run(arguments: list[str]) -> int:
    from ..core.cli import main

    return main(arguments, blender=bpy.app.binary_path or None)
