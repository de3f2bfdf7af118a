"""The arm and the hand in MuJoCo: scenes made of entities, physics, observables. Read `simulation/physics` first.

    arm = robots.make_arm(observations.PERFECT_FEATURES)
    hand = robots.make_hand(observations.PERFECT_FEATURES)
    arm.attach(hand)
    arena = Arena()
    arena.attach(arm, position=robots.ARM_OFFSET)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)

Everything public is imported from here, or from the modules of the same names.

simulation                  the compiled scene: bindings, steps, pictures
entity, attachment          parts of a scene, and how they are joined and detached
arena, workspaces, cameras  what an arm stands on, where things happen, and who looks at it
base, jaco_arm, jaco_hand   arms and hands; `robots` makes them with the observables of `observations`
props                       things to handle
observables, updater        what is measured, and when it is reported
control                     commands, inverse kinematics and initial poses in a scene
distributions, rewards      random values for initial states; rewards between 0 and 1
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__)
