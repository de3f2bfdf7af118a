"""Parts of a scene: a `mujoco.MjSpec` each, attached to one another to form the tree that a physics is compiled from.

Attaching entity B to entity A puts B's bodies into a new body of A's tree and prefixes the names of all of B's
elements: ``finger_1`` of a hand called ``jaco_hand`` becomes ``jaco_hand/finger_1``. The elements stay the same Python
objects throughout, so ``hand.joints`` can be bound whatever the hand is attached to.
"""

from __future__ import annotations

import abc
import inspect
import re
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, ModelError, PhysicsError
from jacokin.model import checks
from jacokin.mujoco_bridge.entities import spec_attachment
from jacokin.mujoco_bridge.observables.observable import Observables
from jacokin.mujoco_bridge.quaternions import unit_quaternion
from jacokin.mujoco_bridge.simulation.physics import Physics, check_physics

_UNNAMED = ("", "MuJoCo Model")  # what MuJoCo calls a model without a name


class Entity(abc.ABC):
    """A part of a scene. Subclasses say in `_build` what it consists of."""

    _mjcf_root: mujoco.MjSpec

    def __init__(self, *args: Any, observable_options: Any = None, **kwargs: Any) -> None:
        """Build the entity.

        Args:
            args: passed to `_build`.
            observable_options: options of the observables, see `Observables.set_options`.
            kwargs: passed to `_build`; ``name`` works for every entity.

        Raises:
            InvalidInputError: a malformed name, or a `_build` that makes no spec.
        """
        self._parent: Entity | None = None
        self._attached: list[Entity] = []
        self._attachment: spec_attachment.Attachment | None = None
        self._is_compiled = False
        signature = inspect.signature(self._build)
        name = kwargs.get("name") if "name" in signature.parameters else kwargs.pop("name", None)
        for given in (name, signature.bind_partial(*args, **kwargs).arguments.get("name")):
            if not isinstance(given, str | None):
                raise InvalidInputError(f"name must be a string, got {given!r}")
        self._build(*args, **kwargs)
        spec = self.mjcf_model
        if name is not None:
            spec.modelname = name
        elif spec.modelname in _UNNAMED:
            spec.modelname = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", type(self).__name__).lower()
        if "/" in spec.modelname:
            raise InvalidInputError(f"name must not contain '/', got {spec.modelname!r}")
        self._name: str = spec.modelname
        self._observables = self._build_observables()
        self._observables.set_options(observable_options)

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
    def attachment_site(self) -> Any:
        """Where entities are attached unless a site is named: an element, or None for `root_body`."""
        return None

    @property
    def root_body(self) -> Any:
        """The body that holds this entity: the one made on attaching, or the world body of its own spec."""
        return self.mjcf_model.worldbody if self._attachment is None else self._attachment.body

    @property
    def is_compiled(self) -> bool:
        """Whether a physics was made from this entity, after which nothing can be attached."""
        return self._is_compiled

    def iter_entities(self, exclude_self: bool = False) -> Iterator[Entity]:
        """This entity and all attached to it, depth first, in the order of attaching."""
        if not exclude_self:
            yield self
        for each in self._attached:
            yield from each.iter_entities()

    def attach(
        self,
        entity: Entity,
        attach_site: Any = None,
        *,
        position: ArrayLike | None = None,
        quaternion: ArrayLike | None = None,
    ) -> Any:
        """Attach an entity rigidly.

        Args:
            entity: what to attach; it must not be attached yet.
            attach_site: a site of this entity; None for its `attachment_site`.
            position: (3,) where in the frame of the site [m]; None for its origin.
            quaternion: (4,) orientation in the frame of the site, wxyz; None for the site's own.

        Returns:
            The body made to hold the entity. Its ``pos`` and ``quat`` may still be changed, and joints added to it.

        Raises:
            InvalidInputError: an argument is wrong, the entity is attached already or would hold itself, another of
                its name is there, or one of the two was compiled.
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
        held = [each._attachment for each in entity._attached if each._attachment]
        entity._attachment = spec_attachment.attach(spec, entity.mjcf_model, place, prefix, offset, turn, held)
        entity._parent = self
        self._attached.append(entity)
        return entity._attachment.body

    def _check_attach(self, entity: Entity, attach_site: Any) -> None:
        if not isinstance(entity, Entity):
            raise InvalidInputError(f"entity must be an Entity, got {entity!r}")
        if entity._parent is not None:
            raise InvalidInputError(f"{entity.name!r} is attached to {entity._parent.name!r} already; detach it first")
        if entity is self.root:
            raise InvalidInputError(f"{entity.name!r} cannot be attached to itself or to what is attached to it")
        for each in (self.root, entity):
            if each._is_compiled:
                raise InvalidInputError(
                    f"{each.name!r} was compiled into a physics already; attach first, then make the physics"
                )
        if attach_site is None:
            return
        sites = self.root.mjcf_model.sites
        if not any(attach_site is site for site in sites):
            names = ", ".join(site.name for site in sites) or "(none)"
            raise InvalidInputError(f"attach_site must be a site of {self.name!r}, got {attach_site!r}. Sites: {names}")

    def detach(self) -> None:
        """Undo `attach`: the entity is again as it was before, with what was attached to it still attached.

        Its elements are new objects then; take them from the entity's properties again. Observables are made anew
        with their options kept.

        Raises:
            InvalidInputError: the entity is not attached, or the tree was compiled.
        """
        parent, attachment = self._parent, self._attachment
        if parent is None or attachment is None:
            raise InvalidInputError(f"{self.name!r} is not attached to anything")
        if self.root._is_compiled:
            raise InvalidInputError(f"{self.name!r} was compiled into a physics already and cannot be detached")
        held = [(each, each._attachment.where()) for each in self._attached if each._attachment]
        for each, _ in held:
            each.detach()
        restored = attachment.undo(parent.root.mjcf_model)
        parent._attached.remove(self)
        self._parent = self._attachment = None
        restored.replace_in(vars(self))
        options = {name: each.options for name, each in self._observables.as_dict(fully_qualified=False).items()}
        self._observables = self._build_observables()
        known = self._observables.as_dict(fully_qualified=False)
        self._observables.set_options({name: values for name, values in options.items() if name in known})
        for each, (site, position, quaternion) in held:
            self.attach(each, restored.now(site), position=position, quaternion=quaternion)

    def compile(self) -> mujoco.MjModel:
        """Compile this entity with everything attached to it; nothing can be attached afterwards.

        Raises:
            InvalidInputError: the entity is attached to another: compile that one.
            ModelError: MuJoCo refuses the model; its message is passed on.
        """
        if self._parent is not None:
            raise InvalidInputError(
                f"{self.name!r} is attached to {self._parent.name!r}; make the physics from {self.root.name!r}"
            )
        spec = self.mjcf_model
        for each in self.iter_entities(exclude_self=True):
            spec_attachment.refuse_lost_elements(spec, each.mjcf_model, each.name)
            # MuJoCo bounds each body's mass by the compiler options of the spec it came from.
            own = each.mjcf_model.compiler
            own.boundmass = max(own.boundmass, spec.compiler.boundmass)
            own.boundinertia = max(own.boundinertia, spec.compiler.boundinertia)
        try:
            model = spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            raise ModelError(f"MuJoCo cannot compile {self.name!r}: {error}") from error
        self._is_compiled = True
        return model

    def get_pose(self, physics: Physics) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Position (3,) [m] and orientation (4,) wxyz: in the world for a free entity, else in the parent body.

        Raises:
            PhysicsError: the entity is not attached.
        """
        check_physics(physics)
        free = self._free_joint()
        if free is not None:
            state = physics.bind(free).qpos
            return state[:3].copy(), state[3:].copy()
        bound = physics.bind(self._held_by())
        return bound.pos.copy(), bound.quat.copy()

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
        free = self._free_joint()
        bound = physics.bind(self._held_by() if free is None else free)
        if at is not None:
            (bound.pos if free is None else bound.qpos)[:3] = at
        if turn is not None:
            (bound.quat if free is None else bound.qpos[3:])[:] = turn

    def _held_by(self) -> Any:
        if self._attachment is None:
            raise PhysicsError(f"{self.name!r} is not attached to anything and has no pose")
        return self._attachment.body

    def _free_joint(self) -> Any:
        joints = self._held_by().joints
        return next((joint for joint in joints if joint.type == mujoco.mjtJoint.mjJNT_FREE), None)


class ModelWrapperEntity(Entity):
    """An entity made of a spec and nothing else."""

    def _build(self, mjcf_model: mujoco.MjSpec, name: str | None = None) -> None:
        """Wrap a spec; name it unless name is None."""
        if not isinstance(mjcf_model, mujoco.MjSpec):
            raise InvalidInputError(f"mjcf_model must be a mujoco.MjSpec, got {mjcf_model!r}")
        self._mjcf_root = mjcf_model
        if name:
            mjcf_model.modelname = name
