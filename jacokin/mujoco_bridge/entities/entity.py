"""Parts of a scene: a `mujoco.MjSpec` each, attached to one another to form the tree that a physics is compiled from.

Attaching entity B to entity A puts B's bodies into a new body of A's tree and prefixes the names of all of B's
elements: ``finger_1`` of a hand called ``jaco_hand`` becomes ``jaco_hand/finger_1``. The elements stay the same Python
objects throughout, so ``hand.joints`` can be bound whatever the hand is attached to.
"""

from __future__ import annotations

import abc
import functools
import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from jacokin.errors import InvalidInputError, ModelError, shown
from jacokin.model import checks
from jacokin.mujoco_bridge.entities import pickling, spec_attachment
from jacokin.mujoco_bridge.entities.hooks import Hooks
from jacokin.mujoco_bridge.entities.placement import Placed
from jacokin.mujoco_bridge.observables.declaration import Observables
from jacokin.mujoco_bridge.quaternions import unit_quaternion
from jacokin.mujoco_bridge.simulation.simulation import mask

_UNNAMED = ("", "MuJoCo Model")  # what MuJoCo calls a model without a name


def check_name(name: str) -> str:
    """The name of an entity, or an error that says what is wrong with it.

    Raises:
        InvalidInputError: not a string, not one in UTF-8, empty, with a slash or a null character.
    """
    if not checks.text("name", name) or "/" in name:
        raise InvalidInputError(f"name must not be empty and must not contain '/', got {shown(name)}")
    return name


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


class Entity(Placed, Hooks):
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
        self._attachment: spec_attachment.Attachment | None = None
        if name is not None:
            check_name(name)
        self._build(*args, **kwargs)
        spec = self.mjcf_model
        if name is not None:
            spec.modelname = name
        elif spec.modelname in _UNNAMED:
            spec.modelname = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", type(self).__name__).lower()
        self._name: str = check_name(spec.modelname)
        given = {"name": name, "observable_options": observable_options, **kwargs}
        self._recipe = pickling.Recipe(args, given, pickling.count(spec), tuple(self._attached))
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
        children = [attachment for _, attachment in entity.attachments()]
        entity._attachment = spec_attachment.attach(spec, entity.mjcf_model, place, prefix, offset, turn, children)
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
        children = [(each, how.site, *how.pose()) for each, how in self.attachments()]
        for each, *_ in children:
            each.detach()
        before = attachment.undo(parent.root.mjcf_model)
        parent._attached.remove(self)
        self._parent = self._attachment = None
        before.replace_in(vars(self))
        self._observables = self._build_observables().continued(self._observables, before.replaced)
        for each, site, position, quaternion in children:
            self.attach(each, before.replaced(site), position=position, quaternion=quaternion)

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
                spec_attachment.refuse_lost_elements(spec, each.mjcf_model, each._attachment.before, each.name)
            # MuJoCo bounds each body's mass by the compiler options of the spec it came from.
            own = each.mjcf_model.compiler
            own.boundmass = max(own.boundmass, spec.compiler.boundmass)
            own.boundinertia = max(own.boundinertia, spec.compiler.boundinertia)
        flags = spec.option.disableflags
        spec.option.disableflags |= mask([flag for each in self.iter_entities() for flag in each.disabled_flags])
        try:
            return spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            raise ModelError(f"MuJoCo cannot compile {self.name!r}: {error}") from error
        finally:
            spec.option.disableflags = flags

    @property
    def recipe(self) -> pickling.Recipe:
        """How this entity was made."""
        return self._recipe

    def attachments(self) -> list[tuple[Entity, spec_attachment.Attachment]]:
        """The entities attached to this one, and how they are."""
        return [(each, each._attachment) for each in self._attached if each._attachment is not None]

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle and copy how this entity is made, and what is attached to it where; see `pickling`."""
        return pickling.reduced(self, self._recipe)


class ModelWrapperEntity(Entity):
    """An entity made of a spec and nothing else."""

    def _build(self, mjcf_model: mujoco.MjSpec, name: str | None = None) -> None:
        """Wrap a spec.

        Args:
            mjcf_model: the spec; it becomes part of the entity.
            name: replaces the name of the model.
        """
        if not isinstance(mjcf_model, mujoco.MjSpec):
            raise InvalidInputError(f"mjcf_model must be a mujoco.MjSpec, got {shown(mjcf_model)}")
        self._mjcf_root = mjcf_model
        if name is not None:
            mjcf_model.modelname = check_name(name)
