"""An operator whose work goes on beside the living window: with progress, until it is done or Esc
is pressed. Scripts, which run an operator at once, wait for it.
"""

from __future__ import annotations

from importlib import import_module

import bpy

from ..core.errors import SunsplitError
from ..core.progress import Progress, silent
from .jobs import TICK, Job
from .steps import Apart, Steps, run_at_once

NAVIGATION = {
    *("MOUSEMOVE", "INBETWEEN_MOUSEMOVE", "MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE"),
    *("TRACKPADPAN", "TRACKPADZOOM", "MOUSEROTATE", "NDOF_MOTION", "WINDOW_DEACTIVATE"),
}
"""What the user may do meanwhile: look around, but not change the scene."""


class InSteps:
    """For an operator that has `work(context)`, which gives the steps, and `done(context, result)`,
    which says what to do with their result, as Blender wants to be answered. Steps raise
    SunsplitError for the user to read.

    home: the module of the add-on that `work` needs: it is imported apart, as that takes a while.
    """

    home = ""

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            result = run_at_once(self._steps(context), _printed())
        except SunsplitError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return self.done(context, result)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background:
            return self.execute(context)
        if Job.running:
            self.report({"WARNING"}, "Sunsplit is at work: wait for it, or stop it by Esc")
            return {"CANCELLED"}
        self._job, self._shown = Job(self._steps(context)), ""
        manager = context.window_manager
        self._timer = manager.event_timer_add(TICK, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        job = self._job
        if event.type == "ESC" and event.value == "PRESS":
            job.cancel()
        elif event.type != "TIMER":
            return {"PASS_THROUGH"} if event.type in NAVIGATION else {"RUNNING_MODAL"}
        if not job.is_cancelled and not job.advance():
            text = f"Sunsplit: {job.stage} {job.fraction:.0%}    Esc: Cancel"
            if text != self._shown:
                _show(context, text)
                self._shown = text
            return {"RUNNING_MODAL"}
        self.cancel(context)
        if job.is_cancelled:
            self.report({"INFO"}, "Cancelled: the scene is as it was")
            return {"CANCELLED"}
        if isinstance(job.error, SunsplitError):
            self.report({"ERROR"}, str(job.error))
            return {"CANCELLED"}
        if job.error is not None:
            raise job.error
        return self.done(context, job.result)

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender calls this, too, when the window goes away."""
        self._job.cancel()
        context.window_manager.event_timer_remove(self._timer)
        _show(context, None)

    def _steps(self, context: bpy.types.Context) -> Steps:
        yield Apart(lambda *_: import_module(self.home, __package__), 0.0, 0.0)
        return (yield from self.work(context))


def _printed() -> Progress:
    """Progress of work that is waited for: printed where there is no window."""
    return _print if bpy.app.background else silent


def _print(stage: str, fraction: float) -> None:
    print(f"Sunsplit: {fraction:4.0%} {stage}", flush=True)


def _show(context: bpy.types.Context, text: str | None) -> None:
    """Progress in the status bar and in the panels; None: it is over."""
    if context.workspace:
        context.workspace.status_text_set(text)
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            # No more than the panels: a view may take long to be drawn.
            kind = {"VIEW_3D": "UI", "PROPERTIES": "WINDOW"}.get(area.type)
            for region in area.regions:
                if region.type == kind:
                    region.tag_redraw()
