"""The arm and the hand in MuJoCo: scenes made of entities, physics, observables.

    arm = robots.make_arm(observations.PERFECT_FEATURES)
    hand = robots.make_hand(observations.PERFECT_FEATURES)
    arm.attach(hand)
    arena = Arena()
    arena.attach(arm, position=robots.ARM_OFFSET)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)

Everything public is imported from here. Read `simulation/physics` first, then `entities/entity`, `base` and `jaco_arm`.
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__, __file__)
