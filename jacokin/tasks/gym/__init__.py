"""The tasks as environments of Gymnasium. Read `environment` first, then `controls`."""

import importlib.util

from jacokin.errors import MissingExtraError

if importlib.util.find_spec("gymnasium") is None:
    raise MissingExtraError("gymnasium", "tasks")
