"""Tasks for the arm and the hand: reach, lift, place, stack. Read `families` first, then `task`.

    env = jacokin.tasks.load("reach_site_features", seed=0)  # dm_env
    timestep = env.reset()

    gymnasium.register_envs(jacokin.tasks)
    env = gymnasium.make("jacokin/ReachSite-v0")

Importing this package registers the ids, if Gymnasium is installed: `register_envs` does nothing but keep the import.
Everything public is imported from here.

task, families     `Task`, a scene with initial states and a reward; the tasks themselves
registry           the tasks by name
episode            one simulation of a task, from reset to reset
environment, gym   the interfaces of dm_env and of Gymnasium to it
features           what agents observe
randomization      what differs between episodes
experts            scripted policies
datasets           episodes as data that other libraries read
"""

import importlib
import importlib.util

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__)

if importlib.util.find_spec("gymnasium") is not None:
    importlib.import_module("jacokin.tasks.gym.registration").register()
