"""The executor of a dask cluster, from the address of its scheduler."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Iterator
from concurrent.futures import Executor

from jacokin.errors import InvalidInputError, JacokinError, MissingExtraError

ANSWER_WITHIN = 10.0  # [s] that a scheduler has to answer


@contextlib.contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """An executor whose work is done by the workers of a scheduler, such as tcp://10.0.0.1:8786.

    Raises:
        MissingExtraError: distributed is not installed.
        InvalidInputError: no scheduler answers at the address.
        JacokinError: the cluster has no workers.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise MissingExtraError("distributed", "cluster") from error
    if not isinstance(address, str) or not address:
        raise InvalidInputError(f"the address of a scheduler must be like tcp://10.0.0.1:8786, got {address!r}")
    logger = logging.getLogger("distributed")
    level = logger.level
    logger.setLevel(logging.CRITICAL)  # it would log what the error below says, with tracebacks
    try:
        client = Client(address, timeout=ANSWER_WITHIN, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise InvalidInputError(f"no dask scheduler answers at {address}: {error}") from error
    finally:
        logger.setLevel(level)
    with client:
        if not client.nthreads():
            raise JacokinError(f"the dask scheduler at {address} has no workers: start some with `dask worker`")
        yield client.get_executor()
