"""Families of configurations with one free parameter: a tool that may turn about an axis, or a seven-joint arm.

family         the answer: intervals of the parameter on each branch. Read this file first
interval       one interval, and its members
curves         the intervals of a target, by the compiled kernels of `closed_form.curves`
pieces         what the kernels return, cut out and joined across the seam of the circle
"""
