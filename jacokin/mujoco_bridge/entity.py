"""Parts of a scene: a `mujoco.MjSpec` each, attached to one another to form the tree that a physics is compiled from.

Attaching entity B to entity A puts B's bodies into a new body of A's tree and prefixes the names of all of B's
elements: ``finger_1`` of a hand called ``jaco_hand`` becomes ``jaco_hand/finger_1``. The elements stay the same Python
objects throughout, so ``hand.joints`` can be bound whatever the hand is attached to.

An entity with a free joint (`Arena.add_free_entity`) has a pose in the world and a velocity. The pose of any other is
that of its body in the parent body, and it has no velocity of its own. If that body is a mocap body, which stands still
but may be put elsewhere, the pose is part of the simulation's state, otherwise of its model.
"""

from __future__ import annotations

import abc
import functools
import inspect
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError, PhysicsError, shown
from jacokin.model import checks
from jacokin.model.poses import unit_quaternion
from jacokin.mujoco_bridge.attachment import Attachment, attach_spec, count_elements, refuse_lost_elements
from jacokin.mujoco_bridge.distributions import RandomState
from jacokin.mujoco_bridge.observables import Observables
from jacokin.mujoco_bridge.simulation.physics import Physics, check_physics, disable_mask

# ruff: noqa: B027 - the hooks do nothing unless a subclass overrides them

# Methods that an episode calls on each of its entities, in the order of `Entity.iter_entities`. A control step is a
# number of physics steps, the substeps.
HOOKS = ("initialize_episode", "before_step", "before_substep", "after_substep", "after_step")


class Entity(abc.ABC):
    """A part of a scene. Subclasses say in `_build` what it consists of."""

    _mjcf_root: mujoco.MjSpec

    def __init__(
        self,
        *args: Any,
        name: str | None = None,
        observable_options: Mapping[str, object] | None = None,
        **kwargs: Any,
    ) -> None:
        """Build the entity.

        Args:
            args: passed to `_build`.
            name: name of the entity; None for the one that `_build` gives it, or that of the class.
            observable_options: options of the observables, see `Observables.set_options`.
            kwargs: passed to `_build`.

        Raises:
            InvalidInputError: a malformed name, or a `_build` that makes no spec.
        """
        self._parent: Entity | None = None
        self._attached: list[Entity] = []
        self._attachment: Attachment | None = None
        if name is not None:
            check_name(name)
        self._build(*args, **kwargs)
        spec = self.mjcf_model
        if name is not None:
            spec.modelname = name
        elif spec.modelname in ("", "MuJoCo Model"):  # what MuJoCo calls a model without a name
            spec.modelname = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", type(self).__name__).lower()
        self._name: str = check_name(spec.modelname)
        given = {"name": name, "observable_options": observable_options, **kwargs}
        self._recipe = _Construction(args, given, count_elements(spec), tuple(self._attached))
        self._observables = self._build_observables()
        self._observables.set_options(observable_options)

    def __init_subclass__(cls, **kwargs: Any) -> None:
        """Give a class the documentation of its `_build` as that of its constructor."""
        super().__init_subclass__(**kwargs)
        if "_build" in vars(cls) and "__init__" not in vars(cls):
            setattr(cls, "__init__", _constructor(cls))  # noqa: B010 - mypy refuses the assignment

    @abc.abstractmethod
    def _build(self, *args: Any, **kwargs: Any) -> None:
        """Make the spec, ``self._mjcf_root``, and whatever the properties return."""

    def _build_observables(self) -> Observables:
        """The observables of this entity; none unless overridden."""
        return Observables(self)

    @property
    def mjcf_model(self) -> mujoco.MjSpec:
        """The spec of this entity; once attached, what it holds is part of the root's spec."""
        spec = getattr(self, "_mjcf_root", None)
        if not isinstance(spec, mujoco.MjSpec):
            raise InvalidInputError(f"{type(self).__name__}._build must set self._mjcf_root to a mujoco.MjSpec")
        return spec

    @property
    def name(self) -> str:
        """Name of this entity, without those of its parents."""
        return self._name

    @property
    def prefix(self) -> str:
        """What the names of this entity's elements begin with: "" for a root, else such as "jaco_arm/jaco_hand/"."""
        return "" if self._parent is None else f"{self._parent.prefix}{self._name}/"

    @property
    def observables(self) -> Observables:
        """What can be observed of this entity."""
        return self._observables

    @property
    def parent(self) -> Entity | None:
        """The entity this one is attached to, or None."""
        return self._parent

    @property
    def root(self) -> Entity:
        """The entity at the root of the tree this one belongs to; itself if it is not attached."""
        return self if self._parent is None else self._parent.root

    @property
    def attachment_site(self) -> mujoco.MjsSite | None:
        """Where entities are attached unless a site is named; None for `root_body`."""
        return None

    @property
    def mount(self) -> mujoco.MjsBody | None:
        """The body made to hold this entity when it was attached; None for a root."""
        return None if self._attachment is None else self._attachment.body

    @property
    def root_body(self) -> mujoco.MjsBody:
        """The body that holds this entity: the one made on attaching, or the world body of its own spec."""
        return self.mjcf_model.worldbody if self._attachment is None else self._attachment.body

    @property
    def disabled_flags(self) -> tuple[str, ...]:
        """Parts of MuJoCo that a scene with this entity does without: names as `Physics.disable` takes them."""
        return ()

    def iter_entities(self, exclude_self: bool = False) -> Iterator[Entity]:
        """This entity and all attached to it, depth first, in the order of attaching."""
        if not exclude_self:
            yield self
        for each in self._attached:
            yield from each.iter_entities()

    def attach(
        self,
        entity: Entity,
        attach_site: mujoco.MjsSite | None = None,
        *,
        position: ArrayLike | None = None,
        quaternion: ArrayLike | None = None,
    ) -> mujoco.MjsBody:
        """Attach an entity rigidly. Physics made from this tree before do not have it.

        Args:
            entity: what to attach; it must not be attached yet.
            attach_site: a site of this entity; None for its `attachment_site`.
            position: (3,) where in the frame of the site [m]; None for its origin.
            quaternion: (4,) orientation in the frame of the site, wxyz; None for the site's own.

        Returns:
            The body made to hold the entity. Its ``pos`` and ``quat`` may still be changed, and joints added to it.

        Raises:
            InvalidInputError: an argument is wrong, the entity is attached already or would hold itself, or another
                of its name is there.
            ModelError: MuJoCo refuses to join the two.
        """
        self._check_attach(entity, attach_site)
        site = self.attachment_site if attach_site is None else attach_site
        offset = np.zeros(3) if position is None else checks.vector("position", position, 3, "m")
        turn = np.array([1.0, 0.0, 0.0, 0.0]) if quaternion is None else unit_quaternion("quaternion", quaternion)
        prefix = f"{self.prefix}{entity.name}/"
        spec = self.root.mjcf_model
        if spec.body(prefix) is not None:
            raise InvalidInputError(
                f"an entity of the name {entity.name!r} is attached here already; give this one another with name=..."
            )
        place = self.root_body if site is None else site
        children = [how for _, how in entity._children()]
        entity._attachment = attach_spec(spec, entity.mjcf_model, place, prefix, offset, turn, children)
        entity._parent = self
        self._attached.append(entity)
        return entity._attachment.body

    def _check_attach(self, entity: Entity, attach_site: mujoco.MjsSite | None) -> None:
        if not isinstance(entity, Entity):
            raise InvalidInputError(f"entity must be an Entity, got {shown(entity)}")
        if entity._parent is not None:
            raise InvalidInputError(f"{entity.name!r} is attached to {entity._parent.name!r} already; detach it first")
        if entity is self.root:
            raise InvalidInputError(f"{entity.name!r} cannot be attached to itself or to what is attached to it")
        sites = self.root.mjcf_model.sites
        if attach_site is not None and attach_site not in sites:
            names = ", ".join(site.name for site in sites) or "(none)"
            raise InvalidInputError(
                f"attach_site must be a site of {self.name!r}, got {shown(attach_site)}. Sites: {names}"
            )

    def detach(self) -> None:
        """Undo `attach`: the entity is again as it was before, with what was attached to it still attached.

        Its elements are new objects then; take them from the entity's properties again. Its observables are made
        anew with their options, those that were added are kept. A physics made before does not know the new elements.

        Raises:
            InvalidInputError: the entity is not attached.
        """
        parent, attachment = self._parent, self._attachment
        if parent is None or attachment is None:
            raise InvalidInputError(f"{self.name!r} is not attached to anything")
        children = [(each, how.site, *how.pose()) for each, how in self._children()]
        for each, *_ in children:
            each.detach()
        before = attachment.undo(parent.root.mjcf_model)
        parent._attached.remove(self)
        self._parent = self._attachment = None
        before.replace_in(vars(self))
        self._observables = self._build_observables().take_over(self._observables, before.replaced)
        for each, site, position, quaternion in children:
            self.attach(each, before.replaced(site), position=position, quaternion=quaternion)

    @property
    def freejoint(self) -> mujoco.MjsJoint | None:
        """The free joint by which the entity moves, or None."""
        mount = self.mount
        joints = [] if mount is None else mount.joints
        return next((joint for joint in joints if joint.type == mujoco.mjtJoint.mjJNT_FREE), None)

    @property
    def is_mocap(self) -> bool:
        """Whether the body that holds the entity is a mocap body."""
        return self.mount is not None and bool(self.mount.mocap)

    def get_pose(self, physics: Physics) -> tuple[Array, Array]:
        """Position (3,) [m] and orientation (4,) wxyz: in the world for a free entity, else in the parent body.

        Raises:
            PhysicsError: the entity is not attached.
        """
        position, orientation = self._live_pose(check_physics(physics))
        return position.copy(), orientation.copy()

    def set_pose(
        self, physics: Physics, position: ArrayLike | None = None, quaternion: ArrayLike | None = None
    ) -> None:
        """Place the entity: in the world if it is free, else in its parent body.

        Args:
            physics: the simulation.
            position: (3,) [m]; None leaves it.
            quaternion: (4,) wxyz; None leaves it.

        Raises:
            PhysicsError: the entity is not attached.
            InvalidInputError: a malformed position or quaternion.
        """
        check_physics(physics)
        at = None if position is None else checks.vector("position", position, 3, "m")
        turn = None if quaternion is None else unit_quaternion("quaternion", quaternion)
        place, orientation = self._live_pose(physics)
        if at is not None:
            place[:] = at
        if turn is not None:
            orientation[:] = turn

    def shift_pose(
        self,
        physics: Physics,
        position: ArrayLike | None = None,
        quaternion: ArrayLike | None = None,
        rotate_velocity: bool = False,
    ) -> None:
        """Move and turn the entity relative to where it is.

        Args:
            physics: the simulation.
            position: (3,) added to its position [m]; None leaves it.
            quaternion: (4,) wxyz, by which the entity is turned about its own origin, about axes of the world (of the
                parent body if it is not free); None leaves the orientation.
            rotate_velocity: turn the linear velocity of a free entity too. Its angular velocity is kept in axes of
                the entity, so it turns anyway.

        Raises:
            PhysicsError: the entity is not attached.
            InvalidInputError: a malformed position or quaternion.
        """
        checks.flag("rotate_velocity", rotate_velocity)
        at, turn = self.get_pose(physics)
        shifted = None if position is None else at + checks.vector("position", position, 3, "m")
        if quaternion is None:
            self.set_pose(physics, shifted)
            return
        rotation = unit_quaternion("quaternion", quaternion)
        self.set_pose(physics, shifted, quaternion_product(rotation, turn))
        if rotate_velocity and self.freejoint is not None:
            linear, _ = self.get_velocity(physics)
            self.set_velocity(physics, rotation_matrix(rotation) @ linear)

    def get_velocity(self, physics: Physics) -> tuple[Array, Array]:
        """Velocity (3,) [m/s] in axes of the world and angular velocity (3,) [rad/s] in axes of the entity.

        Raises:
            PhysicsError: the entity is not free.
        """
        qvel = check_physics(physics).bind(self._free()).qvel
        return qvel[:3].copy(), qvel[3:].copy()

    def set_velocity(
        self, physics: Physics, velocity: ArrayLike | None = None, angular_velocity: ArrayLike | None = None
    ) -> None:
        """Set the velocity of a free entity.

        Args:
            physics: the simulation.
            velocity: (3,) in axes of the world [m/s]; None leaves it.
            angular_velocity: (3,) in axes of the entity [rad/s]; None leaves it.

        Raises:
            PhysicsError: the entity is not free.
            InvalidInputError: a malformed velocity.
        """
        qvel = check_physics(physics).bind(self._free()).qvel
        linear = None if velocity is None else checks.vector("velocity", velocity, 3, "m/s")
        angular = None if angular_velocity is None else checks.vector("angular_velocity", angular_velocity, 3, "rad/s")
        if linear is not None:
            qvel[:3] = linear
        if angular is not None:
            qvel[3:] = angular

    def _live_pose(self, physics: Physics) -> tuple[Array, Array]:
        """Position (3,) [m] and orientation (4,) wxyz as live arrays.

        Raises:
            PhysicsError: the entity is not attached.
        """
        if self.mount is None:
            raise PhysicsError(f"{self.name!r} is not attached to anything and has no pose")
        free = self.freejoint
        if free is not None:
            qpos = physics.bind(free).qpos
            return qpos[:3], qpos[3:]
        bound = physics.bind(self.mount)
        return (bound.mocap_pos, bound.mocap_quat) if self.is_mocap else (bound.pos, bound.quat)

    def _free(self) -> mujoco.MjsJoint:
        free = self.freejoint
        if free is None:
            raise PhysicsError(f"{self.name!r} has no free joint and no velocity; attach it with add_free_entity")
        return free

    def initialize_episode(self, physics: Physics, random_state: RandomState | None) -> None:
        """Called when an episode starts, after the simulation was reset."""

    def before_step(self, physics: Physics, random_state: RandomState | None) -> None:
        """Called before each control step."""

    def before_substep(self, physics: Physics, random_state: RandomState | None) -> None:
        """Called before each physics step."""

    def after_substep(self, physics: Physics, random_state: RandomState | None) -> None:
        """Called after each physics step."""

    def after_step(self, physics: Physics, random_state: RandomState | None) -> None:
        """Called after each control step."""

    def compile(self) -> mujoco.MjModel:
        """Compile this entity with everything attached to it.

        Raises:
            InvalidInputError: the entity is attached to another (compile that one), or MuJoCo would leave out what
                was added to an entity after attaching it.
            ModelError: MuJoCo refuses the model; its message is passed on.
        """
        if self._parent is not None:
            raise InvalidInputError(
                f"{self.name!r} is attached to {self._parent.name!r}; make the physics from {self.root.name!r}"
            )
        spec = self.mjcf_model
        for each in self.iter_entities(exclude_self=True):
            if each._attachment is not None:
                refuse_lost_elements(spec, each.mjcf_model, each._attachment.before, each.name)
            # MuJoCo bounds each body's mass by the compiler options of the spec it came from.
            own = each.mjcf_model.compiler
            own.boundmass = max(own.boundmass, spec.compiler.boundmass)
            own.boundinertia = max(own.boundinertia, spec.compiler.boundinertia)
        flags = spec.option.disableflags
        spec.option.disableflags |= disable_mask(
            [flag for each in self.iter_entities() for flag in each.disabled_flags]
        )
        try:
            return spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            raise ModelError(f"MuJoCo cannot compile {self.name!r}: {error}") from error
        finally:
            spec.option.disableflags = flags

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle and copy how this entity was made, and what is attached to it where: MuJoCo cannot pickle its spec.

        Changes made to elements by hand are not in there.

        Raises:
            InvalidInputError: elements were added or removed by hand, or the entity was made from a `mujoco.MjSpec`.
        """
        self.root._refuse_additions()
        recipe = self._recipe
        if any(isinstance(value, mujoco.MjSpec) for value in (*recipe.args, *recipe.kwargs.values())):
            raise InvalidInputError(f"{self.name!r} cannot be pickled or copied: it was made from a mujoco.MjSpec")
        children = [_Child.of(each, how) for each, how in self._children() if each not in recipe.built_in]
        return _rebuilt, (type(self), recipe.args, recipe.kwargs, children)

    def _children(self) -> list[tuple[Entity, Attachment]]:
        """The entities attached to this one, and how they are."""
        return [(each, each._attachment) for each in self._attached if each._attachment is not None]

    def _refuse_additions(self) -> None:
        expected: Counter[str] = Counter()
        built_in: set[Entity] = set()
        for each in self.iter_entities():
            built_in.update(each._recipe.built_in)
            if each in built_in:
                continue  # counted with what built it
            expected.update(each._recipe.counts)
            expected["bodies"] += each.mount is not None
            expected["joints"] += each.freejoint is not None
        added = count_elements(self.mjcf_model)
        added.subtract(expected)
        changed = {kind: number for kind, number in added.items() if number}
        if changed:
            what = ", ".join(f"{number:+d} {kind}" for kind, number in changed.items())
            raise InvalidInputError(
                f"{self.name!r} cannot be pickled or copied: elements were added or removed by hand ({what}); "
                "do that in _build"
            )


def check_name(name: str) -> str:
    """The name of an entity, or an error that says what is wrong with it.

    Raises:
        InvalidInputError: not a string, not one in UTF-8, empty, with a slash or a null character.
    """
    if not checks.text("name", name) or "/" in name:
        raise InvalidInputError(f"name must not be empty and must not contain '/', got {shown(name)}")
    return name


def new_spec(default: str, name: str | None) -> mujoco.MjSpec:
    """An empty spec with angles in radians, called by a name, or the default for None.

    Raises:
        InvalidInputError: a malformed name.
    """
    spec = mujoco.MjSpec()
    spec.modelname = default if name is None else check_name(name)
    spec.compiler.degree = False
    return spec


def quaternion_product(first_wxyz: Array, second_wxyz: Array) -> Array:
    """The quaternion (4,) wxyz that rotates by the second and then by the first."""
    quat = np.empty(4)
    mujoco.mju_mulQuat(quat, first_wxyz, second_wxyz)
    return quat


def rotation_matrix(unit_quat_wxyz: Array) -> Array:
    """Rotation matrix (3, 3) of a unit quaternion (4,) wxyz."""
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, unit_quat_wxyz)
    return rotation.reshape(3, 3)


def _constructor(cls: type[Entity]) -> Callable[..., None]:
    """The constructor that a class inherits, with the parameters and the docstring of its `_build`."""

    @functools.wraps(cls._build)
    def constructor(self: Entity, *args: Any, **kwargs: Any) -> None:
        super(cls, self).__init__(*args, **kwargs)

    constructor.__name__, constructor.__qualname__ = "__init__", f"{cls.__qualname__}.__init__"
    own = list(inspect.signature(cls._build).parameters.values())
    options = inspect.Parameter("observable_options", inspect.Parameter.KEYWORD_ONLY, default=None)
    own.insert(len(own) - any(each.kind is inspect.Parameter.VAR_KEYWORD for each in own), options)
    setattr(constructor, "__signature__", inspect.Signature(own))  # noqa: B010 - mypy knows no such attribute
    return constructor


@dataclass(frozen=True, slots=True, eq=False)
class _Construction:
    """How an entity was made.

    Attributes:
        args: positional arguments of its constructor.
        kwargs: keyword arguments of its constructor.
        counts: numbers of elements that its spec had then, by kind.
        built_in: entities that `_build` attached.
    """

    args: tuple[Any, ...]
    kwargs: dict[str, Any]
    counts: Counter[str]
    built_in: tuple[Entity, ...]


class _Child(NamedTuple):
    """An attached entity, the name of its site without the parent's prefix, and where it is in the site's frame."""

    entity: Entity
    site: str | None
    position: Array
    quaternion: Array
    freejoint: str | None

    @classmethod
    def of(cls, entity: Entity, how: Attachment) -> _Child:
        free, parent = entity.freejoint, entity.parent
        prefix = "" if parent is None else parent.prefix
        site = None if how.site is None else how.site.name.removeprefix(prefix)
        return cls(entity, site, *how.pose(), None if free is None else free.name.removeprefix(entity.prefix))


def _rebuilt(
    cls: Callable[..., Entity], args: tuple[Any, ...], kwargs: dict[str, Any], children: list[_Child]
) -> Entity:
    entity = cls(*args, **kwargs)
    for each in children:
        site = None if each.site is None else entity.mjcf_model.site(each.site)
        body = entity.attach(each.entity, site, position=each.position, quaternion=each.quaternion)
        if each.freejoint is not None:
            body.add_freejoint(name=f"{each.entity.prefix}{each.freejoint}")
    return entity


class ModelWrapperEntity(Entity):
    """An entity made of a spec and nothing else."""

    def _build(self, mjcf_model: mujoco.MjSpec, name: str | None = None) -> None:
        """Wrap a spec.

        Args:
            mjcf_model: the spec; it becomes part of the entity.
            name: replaces the name of the model.
        """
        checks.instance("mjcf_model", mjcf_model, mujoco.MjSpec, "a mujoco.MjSpec")
        self._mjcf_root = mjcf_model
        if name is not None:
            mjcf_model.modelname = check_name(name)
