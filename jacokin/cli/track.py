"""`jacokin track`"""


def track() -> None:
    """Placeholder"""
