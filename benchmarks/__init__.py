"""Measurements: jacokin beside its peers, what its parts cost, how complete and how exact its answers are."""
