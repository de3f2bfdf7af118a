"""`jacokin track`: follow a path of poses."""


def track() -> None:
    """Follow a path of poses."""
