"""What the window says while a conversion is on its way."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy

from ..core.progress import Progress, silent

if TYPE_CHECKING:
    from .jobs import Job


def progress() -> Progress:
    """For a conversion that is waited for: printed where there is no window."""
    return _print if bpy.app.background else silent


def _print(stage: str, fraction: float) -> None:
    print(f"Sunsplit: {fraction:4.0%} {stage}", flush=True)


def show_progress(context: bpy.types.Context, job: Job | None) -> None:
    """In the status bar and in the panels; None: it is over."""
    text = f"Sunsplit: {job.stage} {job.fraction:.0%}    Esc: Cancel" if job else None
    if context.workspace:
        context.workspace.status_text_set(text)
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in ("VIEW_3D", "PROPERTIES", "STATUSBAR"):
                area.tag_redraw()
