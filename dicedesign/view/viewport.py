"""3D view of one body, its pose and its Gauss sphere."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from dicedesign.runtime.arrays import Floats
from dicedesign.view.motion import SPHERE_POSITION, SPHERE_RADIUS, Motion, SceneFrame
from dicedesign.view.nodes import BodyNodes, Sphere, direction_on_ray, facet_on_ray
from dicedesign.view.page import Job, Page
from dicedesign.view.viewed_body import MAX_DRAWN_TRIANGLES, ViewedBody, decimate

__all__ = ["Viewport"]

AMBIENT_LIGHT = 1.2

PHONE_CAMERA = (-0.9, -9.0, 2.6), (-0.9, 0.0, -1.0)
"""Position and target of the camera on a screen that is taller than wide: the body in its upper
half."""

FRAME_SECONDS = 1.0 / 50.0
"""Time between two poses of a motion."""


class Viewport:
    """3D view of the page. Use it only in the thread of changes (`Page.enqueue`).

    Attributes
    ----------
    viewed: body in view; it appears with `show`.
    frame: coordinates of the body in the scene.
    pose: (4, 4) motion of the body onto the plane z = 0, in its own unit.
    on_change: called with the body after every change of it; on_show: whenever another body comes
        into view.
    on_facet: called after a click on the hull, with the facet and the point (3,) of the body.
    on_direction: called after a click on the sphere, with the direction (3,).
    """

    def __init__(self, page: Page, viewed: ViewedBody) -> None:
        self.page, self.viewed = page, viewed
        self.frame = SceneFrame.of(viewed.hull)
        self.pose = np.eye(4)
        self.on_change: list[Callable[[ViewedBody], None]] = []
        self.on_show: list[Callable[[ViewedBody], None]] = []
        self.on_facet: Callable[[int, Floats], None] = lambda *_: None
        self.on_direction: Callable[[Floats], None] = lambda _: None
        self._motion_job: Job | None = None
        scene = page.scene
        # Reflections are the largest part of the drawing time.
        scene.configure_environment_map(hdri=None)
        scene.add_light_ambient("/light", intensity=AMBIENT_LIGHT)
        # Shadows are slow in a browser without a graphics card.
        scene.configure_default_lights(True, cast_shadow=False)
        scene.add_grid(
            "/floor", width=6.0, height=3.0, cell_size=0.5, section_size=0.5, shadow_opacity=0.0
        )
        self._sphere = Sphere(scene)
        self._body = BodyNodes(scene)
        self._sphere.on_click(lambda *ray: page.enqueue(lambda: self._click_sphere(*ray)))
        camera = page.server.initial_camera
        camera.position, camera.look_at, camera.fov = (1.0, -5.3, 2.8), (1.0, 0.0, 0.75), 0.75

        @page.server.on_client_connect
        def _(client: Any) -> None:
            # A phone has its panel in the lower half.
            if client.camera.aspect < 1.0:
                client.camera.position, client.camera.look_at = PHONE_CAMERA

    def enable_clicks(self, enabled: bool) -> None:
        """Let the hull take clicks, or let the mouse through to objects inside it."""
        page = self.page
        self._body.on_click(
            (lambda *ray: page.enqueue(lambda: self._click_body(*ray))) if enabled else None
        )

    @property
    def down(self) -> Floats:
        """(3,) direction of the body that points down."""
        return -self.pose[2, :3]

    def show(self, viewed: ViewedBody) -> None:
        """Show another body on its most probable rest."""
        self.hold()
        self.viewed, self.frame = viewed, SceneFrame.of(viewed.hull)
        self._show_mesh(viewed)
        self.update(viewed)
        self.put(viewed.poses.transforms[0])
        for listener in self.on_show:
            listener(viewed)

    def update(self, viewed: ViewedBody) -> None:
        """Show the body after a change."""
        before, self.viewed = self.viewed, viewed
        if viewed.is_dragged != before.is_dragged:
            self._show_mesh(viewed)
        with self.page.server.atomic():
            self._body.update(viewed, self.frame)
            self._sphere.update(viewed)
            for listener in self.on_change:
                listener(viewed)
        self.page.server.flush()

    def put(self, pose: Floats) -> None:
        """Put the body into a pose (4, 4)."""
        self.pose = pose
        with self.page.server.atomic():
            self._body.frame.wxyz, self._body.frame.position = self.frame.place(pose)
            self._sphere.point_down(self.down)

    def move(self, motion: Motion, on_end: Callable[[], None] = lambda: None) -> None:
        """Show a motion. on_end: called at its end, unless `hold` or another motion stopped it."""
        self.hold()

        def put(job: Job, pose: Floats) -> None:
            if self._motion_job is job:
                self.put(pose)

        def show_frames(job: Job) -> Job:
            start = time.perf_counter()
            seconds = 0.0
            while seconds < motion.seconds[-1]:
                job.check()
                seconds = time.perf_counter() - start
                self.page.enqueue(partial(put, job, motion.at(seconds)), "pose")
                time.sleep(FRAME_SECONDS)
            return job

        def end(job: Job) -> None:
            if self._motion_job is job:
                self._motion_job = None
                self.put(motion.poses[-1])
                on_end()

        self._motion_job = self.page.start(show_frames, end)

    def hold(self) -> None:
        """Stop the motion at its current pose."""
        if self._motion_job is not None:
            self._motion_job.stop()
            self._motion_job = None

    def _show_mesh(self, viewed: ViewedBody) -> None:
        shape = viewed.shape
        points, triangles = shape.body.points, shape.body.triangles
        self._body.show_mesh(None, viewed)
        if triangles is None or viewed.is_dragged or shape.is_convex:
            return
        if len(triangles) <= MAX_DRAWN_TRIANGLES:
            self._body.show_mesh((self.frame.to_scene(points), triangles), viewed)
            return

        def work(job: Job) -> Any:
            job.progress(f"decimating {len(triangles):,} triangles for display")
            return decimate(points, triangles)

        def show(mesh: Any) -> None:
            if self.viewed.shape is shape:
                self._body.show_mesh((self.frame.to_scene(mesh[0]), mesh[1]), viewed)

        self.page.start(work, show)

    def _click_body(self, origin: Floats, direction: Floats) -> None:
        wxyz, position = self.frame.place(self.pose)
        to_body = Rotation.from_quat(wxyz, scalar_first=True).inv()
        start = self.frame.from_scene(to_body.apply(origin - position))
        self.on_facet(*facet_on_ray(self.viewed.hull, start, to_body.apply(direction)))

    def _click_sphere(self, origin: Floats, direction: Floats) -> None:
        start = (origin - SPHERE_POSITION) / SPHERE_RADIUS
        self.on_direction(direction_on_ray(start, direction))
