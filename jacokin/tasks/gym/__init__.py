"""The tasks as environments of Gymnasium. Read `environment` first, then `controls`.

environment    one environment; `vector` has many in one process
controls       what actions mean
packing        options, and the observations that follow from them
registration   the ids
"""

import importlib.util

from jacokin.errors import MissingExtraError

if importlib.util.find_spec("gymnasium") is None:
    raise MissingExtraError("gymnasium", "tasks")
