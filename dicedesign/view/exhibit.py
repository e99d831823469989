"""What is on show: one body, or die, and where it stands; whoever changes it, all panels follow."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np
from scipy.spatial.transform import Rotation

from dicedesign.geometry.hulls.hull import ConvexHull
from dicedesign.rest.poses import standing_transform
from dicedesign.runtime.arrays import Floats
from dicedesign.view.motion import SPHERE_AT, SPHERE_RADIUS, Motion, Place, turned
from dicedesign.view.nodes import BodyNodes, Sphere, met_facet, met_sphere
from dicedesign.view.page import Job, Page
from dicedesign.view.viewed_body import MOST_SHOWN, Solid, ViewedBody, thinned

__all__ = ["Exhibit"]

AMBIENT: Final = 1.2
"""Light from everywhere."""

Listener = Callable[[ViewedBody], None]

FRAME: Final = 1.0 / 50.0
"""Seconds between two poses of a motion."""


class Exhibit:
    """The scene of a page. All of it is used in the page's own thread (`Page.soon`).

    Attributes
    ----------
    viewed: the body on show, or None.
    place: where its points are in the scene.
    pose: (4, 4) motion that puts it onto the plane z = 0, in its own unit.
    on_facet, on_direction: called, where they are set, when the hull is clicked with the facet and
        the point (3,) of the body, and when the sphere is with the direction (3,).
    """

    def __init__(self, page: Page) -> None:
        self.page = page
        self.viewed: ViewedBody | None = None
        self.place = Place(np.zeros(3), 1.0)
        self.pose = np.eye(4)
        self.on_facet: Callable[[int, Floats], None] | None = None
        self.on_direction: Callable[[Floats], None] | None = None
        self._listeners: list[Listener] = []
        self._beginners: list[Listener] = []
        self._moving: Job | None = None
        scene = page.scene
        # What would be mirrored in the body is the largest part of what drawing costs.
        scene.configure_environment_map(hdri=None)
        scene.add_light_ambient("/light", intensity=AMBIENT)
        # Shadows take most of the time of a browser without a graphics card.
        scene.configure_default_lights(True, cast_shadow=False)
        scene.add_grid(
            "/floor", width=6.0, height=3.0, cell_size=0.5, section_size=0.5, shadow_opacity=0.0
        )
        self._sphere = Sphere(scene)
        self._body = BodyNodes(scene)
        self._sphere.on_click(lambda *ray: page.soon(lambda: self._sphere_clicked(*ray)))
        camera = page.server.initial_camera
        camera.position, camera.look_at, camera.fov = (0.7, -8.4, 3.9), (0.7, 0.0, 0.7), 0.75

    def on_change(self, listener: Listener) -> None:
        """Call a function with the body whenever it is another, after it is shown."""
        self._listeners.append(listener)

    def on_show(self, listener: Listener) -> None:
        """Call a function with the body whenever another one is on show, after that."""
        self._beginners.append(listener)

    def listen(self, to_body: bool) -> None:
        """Whether the body can be clicked, or lets the mouse through to what is inside it."""
        page = self.page
        self._body.on_click(
            (lambda *ray: page.soon(lambda: self._body_clicked(*ray))) if to_body else None
        )

    @property
    def down(self) -> Floats:
        """(3,) direction of the body that points down."""
        return -self.pose[2, :3]

    def show(self, viewed: ViewedBody) -> None:
        """Show another body, standing on its most probable rest."""
        self.hold()
        self.viewed = None
        self.place = Place.of(viewed.hull)
        self._show_mesh(viewed)
        self.update(viewed)
        self.put(self.standing(0))
        for listener in self._beginners:
            listener(viewed)

    def preview(self, hull: ConvexHull) -> None:
        """Show a hull whose rests are not known yet."""
        self.hold()
        self.viewed = None
        self.place = Place.of(hull)
        with self.page.server.atomic():
            self._body.show_hull(self.place.into_scene(hull.vertices), hull.triangles)
        pose = np.eye(4)
        pose[2, 3] = -hull.vertices[:, 2].min()
        pose[:2, 3] = -self.place.origin[:2]
        self.put(pose)

    def update(self, viewed: ViewedBody) -> None:
        """Show the same body after a change."""
        before, self.viewed = self.viewed, viewed
        if before is not None and viewed.dragged != before.dragged:
            self._show_mesh(viewed)
        with self.page.server.atomic():
            self._body.update(viewed, self.place)
            self._sphere.update(viewed)
            for listener in self._listeners:
                listener(viewed)
        self.page.server.flush()

    def standing(self, rest: int) -> Floats:
        """The pose (4, 4) of the body on a rest."""
        assert self.viewed is not None
        poses = self.viewed.poses
        height = float(poses.hull.heights(poses.center_of_mass)[poses.facets[rest]])
        return standing_transform(poses.normals[rest], height, poses.center_of_mass)

    def put(self, pose: Floats) -> None:
        """Put the body into a pose (4, 4)."""
        self.pose = pose
        wxyz, position = self.place.frame(pose)
        with self.page.server.atomic():
            self._body.frame.wxyz, self._body.frame.position = wxyz, position
            self._sphere.point_down(self.down)

    def stand(self, rest: int) -> None:
        """Turn the body until it stands on a rest."""
        self.move(self.to(self.standing(rest)))

    def to(self, pose: Floats) -> Motion:
        """The motion from where the body is into a pose (4, 4)."""
        assert self.viewed is not None
        return turned(self.viewed.hull, self.pose, pose)

    def move(self, motion: Motion, on_end: Callable[[], None] = lambda: None) -> None:
        """Show a motion; another, or `hold`, ends it. on_end: called where none did."""
        self.hold()

        def frames(job: Job) -> None:
            started = time.perf_counter()
            passed = 0.0
            while passed < motion.seconds[-1]:
                job.progress("")
                passed = time.perf_counter() - started
                self.page.soon(partial(self._put_of, job, motion.at(passed)), "pose")
                time.sleep(FRAME)

        def ended(_: None) -> None:
            self.page.soon(lambda: self._end_of(job, motion, on_end))

        job = Job(frames, lambda *_: None, ended, self.page.failed, lambda: None)
        self._moving = job

    def hold(self) -> None:
        """End a motion where it is."""
        if self._moving is not None:
            self._moving.stop()
            self._moving = None

    def _put_of(self, job: Job, pose: Floats) -> None:
        if self._moving is job:
            self.put(pose)

    def _end_of(self, job: Job, motion: Motion, on_end: Callable[[], None]) -> None:
        if self._moving is job:
            self._moving = None
            self.put(motion.poses[-1])
            on_end()

    def _show_mesh(self, viewed: ViewedBody) -> None:
        body = viewed.solid.body
        self._body.show_mesh(None, None)
        if body.triangles is None or viewed.dragged or viewed.solid.is_convex:
            return
        if len(body.triangles) <= MOST_SHOWN:
            self._body.show_mesh(self.place.into_scene(body.points), body.triangles)
            return
        points, triangles = body.points, body.triangles

        def thin(job: Job) -> Any:
            job.progress(f"thinning {len(triangles):,} triangles to look at")
            return thinned(points, triangles)

        self.page.start(thin, lambda mesh: self._show_thinned(viewed.solid, *mesh))

    def _show_thinned(self, solid: Solid, points: Floats, triangles: Any) -> None:
        if self.viewed is not None and self.viewed.solid is solid:
            self._body.show_mesh(self.place.into_scene(points), triangles)

    def _body_clicked(self, origin: Floats, direction: Floats) -> None:
        if self.viewed is None or self.on_facet is None:
            return
        wxyz, position = self.place.frame(self.pose)
        back = Rotation.from_quat(wxyz, scalar_first=True).inv()
        start = self.place.from_scene(back.apply(origin - position))
        met = met_facet(self.viewed.hull, start, back.apply(direction))
        if met is not None:
            self.on_facet(*met)

    def _sphere_clicked(self, origin: Floats, direction: Floats) -> None:
        met = met_sphere((origin - SPHERE_AT) / SPHERE_RADIUS, direction)
        if met is not None and self.viewed is not None and self.on_direction is not None:
            self.on_direction(met)
