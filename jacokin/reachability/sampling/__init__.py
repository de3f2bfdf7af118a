"""Which poses a map is made of.

grid          positions: a box of space cut into cubes
orientations  sets of orientations
symmetries    what makes most of the poses superfluous
samples       both together, and which sample stands for a given pose; read this file first
bound         what a grid and a finite set leave out
"""
