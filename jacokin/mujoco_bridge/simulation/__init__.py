"""The compiled scene: bindings of elements, forward passes, steps, pictures. Read `physics` first."""
