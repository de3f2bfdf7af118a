"""Obstacles that are added on the page: placed with the mouse or in numbers, moved by a gizmo of their own."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import viser

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.model.obstacles import Box, Cylinder, Obstacle, Sphere
from jacokin.model.scene import Scene
from jacokin.viewer.browser.controls import Post, set_value, watch

KINDS = ("box", "cylinder", "sphere")
SIZE = (0.12, 0.12, 0.12)  # [m]
PLACE = (0.3, -0.3, 0.06)  # [m] of one that is added without the mouse
FARTHEST = 1.5  # [m] from the base, of a click on the floor
MOST = 20  # obstacles of a page
ADD, WAITING = "Add by a click", "Click on the floor"
GIZMO = "/obstacle"
NONE = "none"


class Placed(NamedTuple):
    """An obstacle of the page."""

    kind: str
    """One of `KINDS`."""
    size: Array
    """(3,) edges [m]; a cylinder is as wide as the first and as high as the last, a sphere as wide as the first."""
    place: Array
    """(3,) of its centre in the base [m]."""

    def obstacle(self, name: str) -> Obstacle:
        """The same for a solver.

        Raises:
            InvalidInputError: a size that is not positive, or numbers that are not finite.
        """
        width, _, height = self.size
        if self.kind == "box":
            return Box(name, self.size, self.place)
        if self.kind == "cylinder":
            return Cylinder(name, 0.5 * width, height, self.place)
        return Sphere(name, 0.5 * width, self.place)


class BuildingControls:
    """The folder "Add obstacles" of the panel. They stand upright, beside those of the scene that was given."""

    def __init__(self, server: viser.ViserServer, given: Scene | None, post: Post) -> None:
        """Add the controls, which post "add", "clicked", "pick", "shape", "moved" and "remove"."""
        self._given = Scene() if given is None else given
        self._placed: dict[str, Placed] = {}
        self._chosen: str | None = None
        self._count = 0
        self._waiting = False
        self._ray: tuple[Array, Array] | None = None
        gui = server.gui
        with gui.add_folder("Add obstacles", expand_by_default=False):
            self._by_click = gui.add_button(ADD, hint="Then click on the floor, where it is to stand")
            self._add = gui.add_button("Add in front", hint="Without the mouse; then type where it stands")
            self._pick = gui.add_dropdown("Obstacle", (NONE,), initial_value=NONE, hint="The one that is changed")
            self._kind = gui.add_dropdown("Kind", KINDS, initial_value=KINDS[0])
            self._size = gui.add_vector3("Size [m]", SIZE, step=0.01, hint="x, y, z; of what is round width and height")
            self._place = gui.add_vector3("Place [m]", PLACE, step=0.01, hint="Of its middle: x, y, z in the base")
            self._remove = gui.add_button("Remove", disabled=True)
        self._gizmo = server.scene.add_transform_controls(
            GIZMO, scale=0.12, depth_test=False, disable_rotations=True, visible=False
        )
        self._by_click.on_click(lambda _: self._wait(not self._waiting))
        self._add.on_click(lambda _: post("add"))
        self._remove.on_click(lambda _: post("remove"))
        watch(post, "pick", self._pick)
        watch(post, "shape", self._kind, self._size, self._place)

        @self._gizmo.on_update
        def _(event: viser.TransformControlsEvent) -> None:
            post("moved")

        @server.scene.on_click()
        def _(event: viser.SceneClickEvent) -> None:
            if self._waiting:
                self._ray = np.array(event.ray_origin), np.array(event.ray_direction)
                post("clicked")

    def change(self, names: dict[str, int]) -> Scene | None:
        """Answer what a page did.

        Args:
            names: what was posted.

        Returns:
            Every obstacle, those that were given first; None where there are none.

        Raises:
            InvalidInputError: a click beside the floor, a size that is not positive, numbers that are not finite, or
                too many obstacles; nothing has changed then.
        """
        before = dict(self._placed), self._chosen
        try:
            self._answer(names)
            scene = self._given.adding(*(each.obstacle(name) for name, each in self._placed.items()))
        except InvalidInputError:
            self._placed, self._chosen = before
            raise
        finally:
            self._show()
        return scene if len(scene) or scene.attached else None

    def _answer(self, names: dict[str, int]) -> None:
        if "clicked" in names and self._ray is not None:
            self._wait(False)
            place = on_floor(*self._ray)
            size = self._typed()
            height = size[0] if self._kind.value == "sphere" else size[2]
            self._insert(Placed(self._checked_kind(), size, place + np.array([0.0, 0.0, 0.5 * height])))
        elif "add" in names:
            self._insert(Placed(self._checked_kind(), self._typed(), np.array(PLACE)))
        elif "pick" in names:
            self._chosen = self._pick.value if self._pick.value in self._placed else None
        elif self._chosen is None:
            return
        elif "remove" in names:
            del self._placed[self._chosen]
            self._chosen = next(reversed(self._placed), None)
        elif "moved" in names:
            place = checks.vector("obstacle", np.array(self._gizmo.position), 3, "m")
            self._placed[self._chosen] = self._placed[self._chosen]._replace(place=place)
        else:
            place = checks.vector("obstacle", self._place.value, 3, "m")
            self._placed[self._chosen] = Placed(self._checked_kind(), self._typed(), place)

    def _insert(self, new: Placed) -> None:
        if len(self._placed) >= MOST:
            raise InvalidInputError(f"a page adds {MOST} obstacles at most; remove one first")
        self._count += 1
        self._chosen = f"added_{self._count}"
        self._placed[self._chosen] = new

    def _checked_kind(self) -> str:
        return checks.choice("kind", self._kind.value, KINDS)

    def _typed(self) -> Array:
        return checks.positive_vector("size", self._size.value, 3, "m")

    def _wait(self, waiting: bool) -> None:
        """Take the next click in the scene for a place, or no longer."""
        self._waiting = waiting
        self._by_click.label = WAITING if waiting else ADD

    def _show(self) -> None:
        """Bring the controls to what there is."""
        options = (NONE, *self._placed)
        if tuple(self._pick.options) != options:
            self._pick.options = options
        set_value(self._pick, self._chosen or NONE)
        self._remove.disabled = self._chosen is None
        self._gizmo.visible = self._chosen is not None
        if self._chosen is not None:
            kind, size, place = self._placed[self._chosen]
            set_value(self._kind, kind)
            set_value(self._size, _rounded(size))
            set_value(self._place, _rounded(place))
            self._gizmo.position = place


def on_floor(origin: Array, direction: Array) -> Array:
    """(3,) where a ray from `origin` in `direction` (3,) meets the floor, z = 0 [m].

    Raises:
        InvalidInputError: it does not, or far from the arm, or numbers are not finite.
    """
    origin, direction = checks.vector("click", origin, 3, "m"), checks.vector("click", direction, 3, "m")
    length = -origin[2] / direction[2] if direction[2] * origin[2] < 0.0 else math.inf
    place = origin + length * direction if math.isfinite(length) else np.full(3, math.inf)
    if not np.linalg.norm(place) <= FARTHEST:
        raise InvalidInputError(f"click on the floor, at most {FARTHEST} m from the arm's base")
    return np.array([place[0], place[1], 0.0])


def _rounded(values: Array) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 4) for value in values)
    return x, y, z
