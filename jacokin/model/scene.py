"""`Scene`: the obstacles around an arm, given one by one, in a file or by a MuJoCo model."""

from __future__ import annotations

import os
import re
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from pathlib import Path
from typing import Self

import mujoco
import numpy as np
import orjson
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin import files
from jacokin.arrays import Array
from jacokin.documents import read_json, read_yaml
from jacokin.errors import InvalidInputError, JacokinError, ModelError, UnknownNameError
from jacokin.model import checks, poses
from jacokin.model.contact import Contact
from jacokin.model.contact_arrays import WorldArrays
from jacokin.model.descriptions import mjcf
from jacokin.model.obstacles import (
    Attached,
    Box,
    Capsule,
    Cylinder,
    Floor,
    Obstacle,
    OtherRobot,
    RobotPart,
    Sphere,
    Surroundings,
    place,
    pose_of,
)
from jacokin.model.point_cloud import NAME, PointCloud
from jacokin.model.poses import pose
from jacokin.model.robot import Robot, fingerprint
from jacokin.model.surrounded import make_world, surround


def _load_robot(name: str, robot: str, q: ArrayLike, base: pin.SE3, finger_angle: float | None = None) -> OtherRobot:
    """Another robot that `load_robot` knows by its name, or by its file; errors as of both."""
    from jacokin.model.loading import load_robot  # which few scenes need

    return OtherRobot(name, load_robot(robot), q, base, finger_angle)


ORIENTATION = ("quat_wxyz", "rpy", "rotation")
HELD = "attached_to"  # the frame that carries a shape, whose pose is then in that frame
# Each shape of a file, and its keys beside "shape" and "name": those that it needs, and others.
SHAPES: Mapping[str, tuple[Callable[..., Obstacle | OtherRobot], tuple[str, ...], tuple[str, ...]]] = {
    "box": (Box, ("size", "position"), (*ORIENTATION, HELD)),
    "sphere": (Sphere, ("radius", "position"), (HELD,)),
    "capsule": (Capsule, ("radius", "length", "position"), (*ORIENTATION, HELD)),
    "cylinder": (Cylinder, ("radius", "length", "position"), (*ORIENTATION, HELD)),
    "floor": (Floor, (), ("height",)),
    "point_cloud": (PointCloud.load, ("file",), ("radius", "position", *ORIENTATION)),
    "robot": (_load_robot, ("robot", "q", "position"), ("finger_angle", *ORIENTATION)),
}
#: Of each shape that stands by itself.
KINDS = {
    "box": Box,
    "sphere": Sphere,
    "capsule": Capsule,
    "cylinder": Cylinder,
    "floor": Floor,
    "point_cloud": PointCloud,
}


class Scene:
    """Obstacles that stand still in the base frame, other robots among them, and shapes that the arm holds; immutable.

    Attributes:
        surroundings: the same in one value.
    """

    __slots__ = ("_contacts", "_world", "surroundings")

    surroundings: Surroundings
    _world: WorldArrays | None
    _contacts: weakref.WeakKeyDictionary[Robot, Contact]

    def __init__(
        self,
        obstacles: Iterable[Obstacle] = (),
        *,
        finger_angle: float | None = None,
        allow: Iterable[tuple[str, str]] = (),
    ) -> None:
        """Check the shapes.

        Args:
            obstacles: `Box`, `Sphere`, `Capsule`, `Cylinder`, `Floor`, `PointCloud`, or other shapes with `name` and
                `add_to`.
            finger_angle: angle at which the fingers stand when contact is looked for [rad]; None for the angle that
                the robot was loaded with.
            allow: pairs of names whose contact does not count: of obstacles, of shapes or links of the arm, or "robot"
                for all of it. A link stands for what it carries, too: ("hand", "cup") are hand and fingers.

        Raises:
            InvalidInputError: not shapes, two of the same name, an angle that is not a number, or not pairs of names.
        """
        self._keep(
            Surroundings(
                obstacles=_checked(obstacles),
                allow=_checked_pairs("allow", allow),
                finger_angle=checks.optional(checks.number, "finger_angle", finger_angle, "rad"),
            )
        )

    def _keep(self, surroundings: Surroundings) -> None:
        object.__setattr__(self, "surroundings", surroundings)
        object.__setattr__(self, "_contacts", weakref.WeakKeyDictionary())
        object.__setattr__(self, "_world", None)

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The shapes that stand still."""
        return self.surroundings.obstacles

    @property
    def robots(self) -> tuple[OtherRobot, ...]:
        """The other robots, whose shapes are among the obstacles."""
        return tuple(dict.fromkeys(each.robot for each in self.obstacles if isinstance(each, RobotPart)))

    @property
    def attached(self) -> tuple[Attached, ...]:
        """The shapes that the arm holds."""
        return self.surroundings.attached

    @property
    def allow(self) -> tuple[tuple[str, str], ...]:
        """Pairs of names whose contact does not count."""
        return self.surroundings.allow

    @property
    def finger_angle(self) -> float | None:
        """Angle of the fingers when contact is looked for [rad]; None for the one the robot was loaded with."""
        return self.surroundings.finger_angle

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse changes after construction."""
        raise AttributeError(f"a Scene does not change; make another one instead of setting {name!r}")

    def __repr__(self) -> str:
        """The names of the shapes."""
        held = [f"{each.name} on {each.to}" for each in self.attached]
        return f"Scene({', '.join((*self.names, *held)) or 'empty'})"

    def __len__(self) -> int:
        """Number of obstacles."""
        return len(self.obstacles)

    def __iter__(self) -> Iterator[Obstacle]:
        """The obstacles in order."""
        return iter(self.obstacles)

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Pickle the shapes; what was compiled is made anew."""
        return _rebuild, (self.surroundings,)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the obstacles."""
        return tuple(obstacle.name for obstacle in self.obstacles)

    def attach(self, shape: Obstacle | str, to: str = "hand", *, pose: pin.SE3 | ArrayLike | None = None) -> Scene:
        """A scene in which the arm holds a shape: it moves along, and counts against whatever is not on its link.

        Args:
            shape: a new shape, or the name of an obstacle, which then no longer stands still.
            to: name of the frame that carries it.
            pose: T_to_shape, or a position (3,) [m]; None for the shape's own, read in that frame.

        Raises:
            InvalidInputError: not a shape, a floor or a cloud of points, a name that is used, or an obstacle without a
                pose.
            UnknownNameError: no obstacle of that name.
        """
        checks.text("to", to)
        found = self._whole(shape)[0] if isinstance(shape, str) else _checked([shape])[0]
        if isinstance(shape, str) and pose is None:
            raise InvalidInputError(f"pose is needed: where {shape!r} is in the frame {to!r}")
        if isinstance(found, Floor):
            raise InvalidInputError(f"{found.name!r} is a floor, which no arm can hold")
        if isinstance(found, RobotPart):
            raise InvalidInputError(f"{found.robot.name!r} is another robot, which no arm can hold")
        if isinstance(found, PointCloud):
            raise InvalidInputError(
                f"{found.name!r} is a PointCloud: attach a Box, Sphere, Capsule or Cylinder around it"
            )
        rest = tuple(each for each in self.obstacles if each is not found)
        held = Attached(found if pose is None else place(found, pose), to)
        _checked([*rest, *(each.shape for each in self.attached), held.shape])
        return _rebuild(self.surroundings._replace(obstacles=rest, attached=(*self.attached, held)))

    def detach(self, name: str, *, pose: pin.SE3 | ArrayLike | None = None) -> Scene:
        """A scene in which the arm no longer holds a shape.

        Args:
            name: of the shape.
            pose: where it stands now: T_base_shape, or a position (3,) [m]; None to leave it out.

        Raises:
            UnknownNameError: the arm holds no such shape.
            InvalidInputError: the pose is malformed.
        """
        held = {each.name: each for each in self.attached}
        put = held[checks.choice("attached shape", name, held)]
        stands = () if pose is None else (place(put.shape, pose),)
        rest = tuple(each for each in self.attached if each is not put)
        allow = self.allow if stands else self._allowed_without({name})
        return _rebuild(self.surroundings._replace(obstacles=(*self.obstacles, *stands), attached=rest, allow=allow))

    def with_fingers(self, angle: float | None) -> Scene:
        """This scene with the fingers at another angle [rad] when contact is looked for.

        Raises:
            InvalidInputError: not a number.
        """
        angle = checks.optional(checks.number, "angle", angle, "rad")
        return _rebuild(self.surroundings._replace(finger_angle=angle))

    def adding(self, *obstacles: Obstacle) -> Scene:
        """This scene with more obstacles.

        Raises:
            InvalidInputError: not shapes, or two of the same name.
        """
        held = [each.shape for each in self.attached]
        found = _checked((*held, *self.obstacles, *obstacles))[len(held) :]
        return _rebuild(self.surroundings._replace(obstacles=found))

    def adding_robot(
        self,
        robot: Robot,
        q: ArrayLike,
        *,
        name: str,
        base: pin.SE3 | ArrayLike,
        finger_angle: float | None = None,
    ) -> Scene:
        """This scene with another robot, which stands still: each of its shapes is an obstacle, "name/shape".

        `plan_motion(..., meanwhile={name: trajectory})` keeps clear of it while it moves.

        Args:
            robot: what it is; the arm itself may be of the same kind.
            q: (dof,) where its joints stand [rad].
            name: what it is called here.
            base: where its base is: T_base_other, or a position (3,) [m].
            finger_angle: where its fingers stand [rad]; None for the angle that it was loaded with.

        Raises:
            InvalidInputError: malformed, a name that is used, or no finger can take the angle.
            ModelError: it has no collision shapes, or they cannot be loaded.
        """
        other = OtherRobot(name, robot, q, base, finger_angle)
        taken = {*self.surroundings.names, *(each.name for each in self.robots)}
        if other.name in taken:
            raise InvalidInputError(f"the name {other.name!r} is used in the scene; names must differ")
        return self.adding(*other.parts)

    def removing(self, *names: str) -> Scene:
        """This scene without some obstacles or robots, and without the contact that was allowed with them.

        Raises:
            UnknownNameError: no such obstacle or robot.
        """
        gone = {part.name for name in names for part in self._whole(name)} | set(names)
        kept = tuple(obstacle for obstacle in self.obstacles if obstacle.name not in gone)
        return _rebuild(self.surroundings._replace(obstacles=kept, allow=self._allowed_without(gone)))

    def moving(self, poses: Mapping[str, pin.SE3 | ArrayLike]) -> Scene:
        """This scene with some obstacles elsewhere.

        Args:
            poses: T_base_shape by name, or a position (3,) [m], with the axes of the base then. Of another robot, where
                its joints are (dof,) [rad].

        Raises:
            UnknownNameError: no such obstacle or robot.
            InvalidInputError: not a mapping, a malformed pose, or a floor, which has none.
        """
        given = checks.mapping("poses", poses, "a dict of names and poses")
        moved = dict[str, Obstacle]()
        for name, where in given.items():
            first = self._whole(name)[0]
            now = first.robot.at(where).parts if isinstance(first, RobotPart) else (place(first, where),)
            moved |= {each.name: each for each in now}
        there = tuple(moved.get(obstacle.name, obstacle) for obstacle in self.obstacles)
        return _rebuild(self.surroundings._replace(obstacles=there))

    def changed(self, leaving: Iterable[str], coming: Mapping[str, Obstacle]) -> Scene:
        """This scene with some obstacles gone and others come, by name; one that comes replaces that of its name.

        Raises:
            InvalidInputError: what comes is not a shape, or has another name.
            UnknownNameError: what leaves is not there, nor comes.
        """
        leaving, coming = (
            checks.listed("leaving", leaving),
            checks.mapping("coming", coming, "a dict of names and shapes"),
        )
        for name, shape in zip(coming, _checked(coming.values()), strict=True):
            if shape.name != name:
                raise InvalidInputError(f"obstacles[{name!r}] has the name {shape.name!r}")
        gone = {*leaving, *coming}
        for name in leaving:
            if name not in coming:
                gone |= {part.name for part in self._whole(name)}
        kept = [obstacle for obstacle in self.obstacles if obstacle.name not in gone]
        there = _checked((*kept, *coming.values()))
        allow = self._allowed_without(gone.difference(coming))
        return _rebuild(self.surroundings._replace(obstacles=there, allow=allow))

    def allowing(self, *pairs: tuple[str, str]) -> Scene:
        """This scene with more pairs of names whose contact does not count.

        Raises:
            InvalidInputError: not pairs of names.
        """
        return _rebuild(self.surroundings._replace(allow=self.allow + _checked_pairs("pairs", pairs)))

    def _allowed_without(self, gone: Set[str]) -> tuple[tuple[str, str], ...]:
        """The allowed contact that is not with shapes which are gone."""
        return tuple(pair for pair in self.allow if gone.isdisjoint(pair))

    def _whole(self, name: str) -> tuple[Obstacle, ...]:
        """An obstacle, or the parts of another robot."""
        robots = {each.name: each for each in self.robots}
        known = {each.name: each for each in self.obstacles if not isinstance(each, RobotPart)}
        checks.choice("obstacle", name, (*known, *robots))
        return robots[name].parts if name in robots else (known[name],)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a .yaml, .yml or .json file, as `save` writes it; `docs/planning.md` has an example.

        Raises:
            InvalidInputError: no such file, another ending, malformed, or wrong numbers; names the entry.
            ModelError: the description of another robot is missing or malformed; names the entry.
            UnknownNameError: an unknown shape or key.
        """
        file = checks.path("path", path, "a file name")
        obstacles, held, finger_angle, allow = _read_file(file)
        found = cls(obstacles, finger_angle=finger_angle, allow=allow)
        for shape, to in held:
            found._keep(found.attach(shape, to).surroundings)
        return found

    def save(self, path: str | Path) -> None:
        """Write a .json file that `load` reads to the same scene, to the last bit; clouds of points to files beside it.

        Those are .npz files that begin with the file's name. Other robots are written by their name or file.

        Raises:
            InvalidInputError: another ending, the file cannot be written, a shape of your own, or another robot that
                was loaded with options.
        """
        file = checks.path("path", path, "a file name")
        if file.suffix.lower() != ".json":
            raise InvalidInputError(f"a scene is saved as .json, got {str(file)!r}")
        document: dict[str, object] = {"obstacles": _written(self, file)}
        if self.finger_angle is not None:
            document["finger_angle"] = self.finger_angle
        if self.allow:
            document["allow"] = self.allow
        with files.replacing(file) as temporary:
            temporary.write_bytes(orjson.dumps(document, option=orjson.OPT_INDENT_2))

    @classmethod
    def from_mujoco(
        cls,
        model: mujoco.MjModel,
        *,
        base: str | pin.SE3 | None = None,
        exclude: Iterable[str] = (),
        finger_angle: float | None = None,
    ) -> Self:
        """The geoms of a compiled MuJoCo model that stand still and can collide.

        Meshes, height fields and ellipsoids become their bounding boxes. The body that carries an arm's first joint is
        left out, as part of that arm.

        Args:
            model: the model, for example `physics.model`.
            base: where the arm's base is: name of a body or site, or T_world_base; None for the world's origin.
            exclude: names of geoms, or of bodies with all their geoms, to be left out.
            finger_angle: as in `Scene`.

        Raises:
            InvalidInputError: not a model, or a plane that is not horizontal in the base frame.
            UnknownNameError: no such body, site or geom.
        """
        checks.instance("model", model, mujoco.MjModel, "a compiled mujoco.MjModel")
        return cls(_collect_geoms(model, base, checks.listed("exclude", exclude)), finger_angle=finger_angle)

    def measure(self, robot: Robot, rows: Array, *, self_collision: bool = False) -> Array:
        """Distances (n,) [m] for checked configurations (n, dof); `Robot.clearance` is the public way."""
        return self.contact(robot).distances(rows, self_collision=self_collision)

    def contact(self, robot: Robot) -> Contact:
        """Contact of a robot with itself and with these obstacles, prepared once.

        Raises:
            InvalidInputError: an obstacle has the name of a shape of the arm, or no finger can take the angle.
            ShapeError: the description's shapes cannot be loaded.
        """
        if robot not in self._contacts:
            around = self.surroundings
            self._contacts[robot] = Contact(robot, around, found=surround(robot, around, self._made_world()))
        return self._contacts[robot]

    def _made_world(self) -> WorldArrays:
        """The arrays of the obstacles, made once for all robots."""
        made = self._world
        if made is None:
            made = make_world(self.obstacles)
            object.__setattr__(self, "_world", made)
        return made


def _checked(obstacles: Iterable[Obstacle]) -> tuple[Obstacle, ...]:
    """The obstacles of a list.

    Raises:
        InvalidInputError: it is not a list, or one is not an obstacle with a name, or two share a name, a robot and a
            shape as well.
    """
    found = checks.listed("obstacles", obstacles)
    names = set()
    for shape in found:
        name = getattr(shape, "name", None)
        if not callable(getattr(shape, "add_to", None)) or not isinstance(name, str) or not name:
            raise checks.refusal(
                "obstacles", "shapes with a name (Box, Sphere, Capsule, Cylinder, Floor, PointCloud)", shape
            )
        checks.word(NAME, name)
        if name in names:
            raise InvalidInputError(f"the name {name!r} is used by two shapes; names must differ")
        names.add(name)
    for robot in dict.fromkeys(each.robot for each in found if isinstance(each, RobotPart)):
        if robot.name in names:
            raise InvalidInputError(f"the name {robot.name!r} is used by a robot and a shape; names must differ")
    return found


def checked_scene(name: str, value: object) -> Scene:
    """A scene, or an error that names the argument.

    Raises:
        InvalidInputError: not a `Scene`.
    """
    return checks.instance(name, value, Scene, "a Scene, for example Scene([Floor(0.0)])")


def _rebuild(surroundings: Surroundings) -> Scene:
    """A scene of what is already checked; what was compiled is made anew."""
    scene = Scene()
    scene._keep(surroundings)
    return scene


def _checked_pairs(name: str, pairs: Iterable[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    """Pairs of names.

    Raises:
        InvalidInputError: anything else.
    """
    found = []
    for pair in checks.listed(name, pairs):
        if not isinstance(pair, list | tuple) or len(pair) != 2 or not all(isinstance(word, str) for word in pair):
            raise checks.refusal(name, "pairs of names, for example [('hand', 'cup')]", pair)
        found.append((pair[0], pair[1]))
    return tuple(found)


def _written(scene: Scene, file: Path) -> list[dict[str, object]]:
    """The entries of a file that `_obstacle` reads; clouds of points are written beside it.

    Raises:
        InvalidInputError: see `Scene.save`.
    """
    entries, robots = list[dict[str, object]](), set[OtherRobot]()
    for index, obstacle in enumerate(scene.obstacles):
        if isinstance(obstacle, RobotPart):
            if obstacle.robot not in robots:
                entries.append(_robot_entry(obstacle.robot, scene, file))
            robots.add(obstacle.robot)
            continue
        entry = _entry(obstacle)
        if isinstance(obstacle, PointCloud):
            name = f"_{obstacle.name}" if re.fullmatch(r"[A-Za-z0-9_-]{1,100}", obstacle.name) else f".{index}"
            cloud = file.with_name(f"{file.stem}{name}.npz")
            obstacle.save(cloud)
            entry["file"] = cloud.name
        entries.append(entry)
    return [*entries, *({**_entry(held.shape), HELD: held.to} for held in scene.attached)]


def _entry(obstacle: Obstacle) -> dict[str, object]:
    """One shape, without the file of a cloud.

    Raises:
        InvalidInputError: a shape that files do not have.
    """
    kind = next((kind for kind, each in KINDS.items() if type(obstacle) is each), None)
    if kind is None:
        raise InvalidInputError(f"{obstacle.name!r} is a {type(obstacle).__name__}, which no file of a scene holds")
    entry: dict[str, object] = {"shape": kind, "name": obstacle.name}
    for key in ("size", "radius", "length", "height"):
        if hasattr(obstacle, key):
            entry[key] = np.asarray(getattr(obstacle, key)).tolist()
    return entry if isinstance(obstacle, Floor) else {**entry, **_place_entry(pose_of(obstacle))}


def _robot_entry(other: OtherRobot, scene: Scene, file: Path) -> dict[str, object]:
    """Another robot by its name or its file.

    Raises:
        InvalidInputError: it is not what either gives, or some of its shapes are not in the scene.
    """
    source = other.robot.source
    word, place = source.bundled, source.path.resolve()
    if word is None:
        folder = file.parent.resolve()
        word = os.fspath(place.relative_to(folder) if place.is_relative_to(folder) else place)
    try:
        known = word if source.bundled is not None else os.fspath(place)
        again = fingerprint(_load_robot(other.name, known, other.q, pin.SE3.Identity()).robot)
    except JacokinError:  # as without the folders of its meshes
        again = ""
    if again != fingerprint(other.robot):
        raise InvalidInputError(f"{other.name!r} was loaded with options, which no file of a scene holds")
    if not {part.name for part in other.parts} <= set(scene.names):
        raise InvalidInputError(f"of the robot {other.name!r} some shapes are not in the scene: it cannot be saved")
    entry = {"shape": "robot", "name": other.name, "robot": word, "q": np.asarray(other.q).tolist()}
    entry |= _place_entry(poses.checked_pose(other.base))
    return entry if other.finger_angle is None else {**entry, "finger_angle": other.finger_angle}


def _place_entry(place: pin.SE3) -> dict[str, object]:
    """Position and orientation of an entry: as a quaternion where that reads back to the same bits."""
    entry: dict[str, object] = {"position": place.translation.tolist()}
    if np.array_equal(place.rotation, np.eye(3)):
        return entry
    quat_wxyz = poses.quaternion(place.rotation)
    if np.array_equal(pose(place.translation, quat_wxyz).rotation, place.rotation):
        return {**entry, "quat_wxyz": quat_wxyz.tolist()}
    return {**entry, "rotation": place.rotation.tolist()}


_Read = tuple[list[Obstacle], list[tuple[Obstacle, str]], float | None, tuple[tuple[str, str], ...]]


def _read_file(file: Path) -> _Read:
    """The shapes of a file that stand, those that the arm holds, its finger angle, and the contact that it allows."""
    content = _content(file)
    finger_angle: float | None = None
    allow: tuple[tuple[str, str], ...] = ()
    if isinstance(content, Mapping):
        _check_keys(str(file), content, ("obstacles", "finger_angle", "allow"))
        finger_angle = checks.optional(checks.number, f"{file}: finger_angle", content.get("finger_angle"), "rad")
        allow = _checked_pairs(f"{file}: allow", content.get("allow", ()))
        content = content.get("obstacles", [])
    if not isinstance(content, list):
        raise checks.refusal(f"{file}: obstacles", "a list of shapes", content)
    obstacles, held = list[Obstacle](), list[tuple[Obstacle, str]]()
    for index, entry in enumerate(content):
        where = f"{file}, obstacle {index}"
        found = _obstacle(where, entry, index, file.parent)
        if isinstance(found, OtherRobot):
            obstacles += found.parts
        elif HELD in entry:
            held.append((found, checks.word(f"{where}: {HELD}", entry[HELD])))
        else:
            obstacles.append(found)
    return obstacles, held, finger_angle, allow


def _content(file: Path) -> object:
    """What a file holds, as plain Python."""
    ending = file.suffix.lower()
    if ending not in (".yaml", ".yml", ".json"):
        raise InvalidInputError(f"the file of a scene must end in .yaml or .yml or .json, got {str(file)!r}")
    return read_json(file, "not a JSON file") if ending == ".json" else read_yaml(file, "not a YAML file")


def _obstacle(where: str, entry: object, index: int, folder: Path) -> Obstacle | OtherRobot:
    """One shape, or another robot; the file of a cloud is looked for in a folder.

    Raises:
        InvalidInputError: malformed.
        UnknownNameError: an unknown shape or key.
    """
    given = checks.mapping(where, entry, "a mapping with the key 'shape'")
    if "shape" not in given:
        known = dict.fromkeys(key for _, needed, more in SHAPES.values() for key in (*needed, *more))
        _check_keys(where, given, ("shape", "name", *known))
        raise InvalidInputError(f"{where}: needs the key 'shape', one of {', '.join(SHAPES)}")
    shape = checks.choice(f"shape in {where}:", given["shape"], SHAPES)
    build, needed, more = SHAPES[shape]
    keys = (*needed, *more)
    _check_keys(where, given, ("shape", "name", *keys))
    missing = [key for key in needed if key not in given]
    if missing:
        raise InvalidInputError(f"{where}: {shape} needs {', '.join(missing)}")
    name = given.get("name", Floor().name if build is Floor else f"{shape}_{index}")
    if not isinstance(name, str) or not name:
        raise checks.refusal(f"{where}: name", "a word", name)
    values = {key: given[key] for key in keys if key in given and key != HELD}
    try:
        if set(ORIENTATION) <= set(keys):
            position = values.pop("position", np.zeros(3))
            turned = {key: values.pop(key, None) for key in ORIENTATION}
            there = pose(position, turned["quat_wxyz"], rpy=turned["rpy"], rotation=turned["rotation"])
            values["base" if shape == "robot" else "pose"] = there
        if "file" in values:
            values["path"] = folder / checks.word("file", values.pop("file"))
        if shape == "robot" and Path(checks.word("robot", values["robot"])).suffix:
            values["robot"] = str(folder / values["robot"])
        return build(name=name, **values)
    except InvalidInputError as error:
        raise InvalidInputError(f"{where}: {error}") from error
    except ModelError as error:
        raise ModelError(f"{where}: {error}") from error


def _check_keys(where: str, entry: Mapping[object, object], known: tuple[str, ...]) -> None:
    for key in entry:
        checks.choice(f"key in {where}:", key, known)


def _collect_geoms(model: mujoco.MjModel, base: str | pin.SE3 | None, exclude: Iterable[str]) -> list[Obstacle]:
    """The shapes in the frame of the arm's base; see `Scene.from_mujoco`."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    T_base_world = _base(model, data, base).inverse()
    left_out = _excluded(model, exclude) | _carriers(model)
    found: list[Obstacle] = []
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        collides = model.geom_contype[geom] or model.geom_conaffinity[geom]
        if model.body_weldid[body] != 0 or not collides or geom in left_out:
            continue
        T_world_geom = pin.SE3(data.geom_xmat[geom].reshape(3, 3).copy(), data.geom_xpos[geom].copy())
        found.append(_obstacle_of_geom(model, geom, T_base_world * T_world_geom))
    return found


def _obstacle_of_geom(model: mujoco.MjModel, geom: int, pose: pin.SE3) -> Obstacle:
    name = mjcf.geom_name(model, geom)
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        if pose.rotation[2, 2] < 1.0 - 1e-9:
            raise InvalidInputError(f"the plane {name!r} is not horizontal in the base: leave it out with exclude")
        return Floor(float(pose.translation[2]), name)
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return Sphere(name, float(size[0]), pose.translation)
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return Capsule(name, float(size[0]), 2.0 * float(size[1]), pose)
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return Cylinder(name, float(size[0]), 2.0 * float(size[1]), pose)
    centre = model.geom_aabb[geom][:3]
    half = np.maximum(model.geom_aabb[geom][3:], 5e-7)  # [m]: a flat mesh has no thickness
    return Box(name, 2.0 * half, pose * pin.SE3(np.eye(3), centre))


def _base(model: mujoco.MjModel, data: mujoco.MjData, base: str | pin.SE3 | None) -> pin.SE3:
    """T_world_base."""
    if base is None:
        return pin.SE3.Identity()
    if not isinstance(base, str):
        return poses.checked_pose(base, "base")
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, base)
    if body >= 0:
        return mjcf.placement(data.xquat[body], data.xpos[body])
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, base)
    if site >= 0:
        return pin.SE3(data.site_xmat[site].reshape(3, 3).copy(), data.site_xpos[site].copy())
    names = [model.body(i).name for i in range(model.nbody)] + [model.site(i).name for i in range(model.nsite)]
    raise UnknownNameError("body or site", base, [name for name in names if name])


def _excluded(model: mujoco.MjModel, exclude: Iterable[str]) -> set[int]:
    geoms = {mjcf.geom_name(model, geom): geom for geom in range(model.ngeom)}
    bodies = {mjcf.body_name(model, body): body for body in range(model.nbody)}
    found: set[int] = set()
    for name in exclude:
        if name in geoms:
            found.add(geoms[name])
        elif name in bodies:
            found.update(np.flatnonzero(model.geom_bodyid == bodies[name]).tolist())
        else:
            raise UnknownNameError("geom or body", name, [*geoms, *bodies])
    return found


def _carriers(model: mujoco.MjModel) -> set[int]:
    """Geoms of bodies, the world aside, that stand still and carry a hinge or a slide: bases of arms."""
    found: set[int] = set()
    for joint in range(model.njnt):
        parent = int(model.body_parentid[model.jnt_bodyid[joint]])
        if model.jnt_type[joint] in mjcf.SCALAR_JOINTS and parent and model.body_weldid[parent] == 0:
            found.update(np.flatnonzero(model.geom_bodyid == parent).tolist())
    return found
