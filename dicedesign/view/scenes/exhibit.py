"""What is on show: one body, or die, and where it stands; whoever changes it, all panels follow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dicedesign.rest.poses import standing_transform
from dicedesign.runtime.arrays import Floats
from dicedesign.view.bodies.viewed_body import ViewedBody
from dicedesign.view.page.page import Page
from dicedesign.view.scenes.hull import BodyNodes
from dicedesign.view.scenes.place import Place
from dicedesign.view.scenes.sphere import Sphere

__all__ = ["Exhibit"]

Listener = Callable[[ViewedBody], None]


class Exhibit:
    """The scene of a page. All of it is used in the page's own thread (`Page.soon`).

    Attributes
    ----------
    viewed: the body on show, or None.
    place: where its points are in the scene.
    pose: (4, 4) motion that puts it onto the plane z = 0, in its own unit.
    """

    def __init__(self, page: Page) -> None:
        self.page = page
        self.viewed: ViewedBody | None = None
        self.place = Place(np.zeros(3), 1.0)
        self.pose = np.eye(4)
        self._listeners: list[Listener] = []
        scene = page.scene
        scene.add_grid(
            "/floor", width=9.0, height=5.0, cell_size=0.5, section_size=0.5, shadow_opacity=0.15
        )
        self._sphere = Sphere(scene)
        self._body = BodyNodes(scene)
        page.server.initial_camera.position = (0.0, -5.2, 2.6)
        page.server.initial_camera.look_at = (0.0, 0.0, 0.8)

    def on_change(self, listener: Listener) -> None:
        """Call a function with the body whenever it is another, after it is shown."""
        self._listeners.append(listener)

    def show(self, viewed: ViewedBody) -> None:
        """Show another body, standing on its most probable rest."""
        self.viewed = viewed
        self.place = Place.of(viewed.hull)
        body = viewed.solid.body
        if body.triangles is None or viewed.dragged:
            self._body.show_mesh(None, None)
        else:
            self._body.show_mesh(self.place.into_scene(body.points), body.triangles)
        self.update(viewed)
        self.stand(0)

    def update(self, viewed: ViewedBody) -> None:
        """Show the same body after a change."""
        if self.viewed is None:
            self.show(viewed)
            return
        if viewed.dragged and not self.viewed.dragged:
            self._body.show_mesh(None, None)
        self.viewed = viewed
        with self.page.server.atomic():
            self._body.update(viewed, self.place)
            self._sphere.update(viewed)
            for listener in self._listeners:
                listener(viewed)
        self.page.server.flush()

    def stand(self, rest: int) -> None:
        """Put the body onto a rest."""
        assert self.viewed is not None
        poses = self.viewed.poses
        normal = poses.normals[rest]
        height = float(poses.hull.heights(poses.center_of_mass)[poses.facets[rest]])
        self.put(standing_transform(normal, height, poses.center_of_mass))

    def put(self, pose: Floats) -> None:
        """Put the body into a pose (4, 4)."""
        self.pose = pose
        wxyz, position = self.place.frame(pose)
        with self.page.server.atomic():
            self._body.frame.wxyz, self._body.frame.position = wxyz, position
            self._sphere.point_down(-pose[2, :3])
