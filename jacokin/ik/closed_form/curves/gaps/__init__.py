"""Curves that lie between two slices wholly: each gets a slice of its own.

windows  of a seven-joint arm: where a discriminant is positive between two slices only
loops    of a six-joint arm: where complex roots of F become real between two slices only
"""
