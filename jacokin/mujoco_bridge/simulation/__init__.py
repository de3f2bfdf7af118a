"""The compiled scene: bindings of elements, forward passes, steps, pictures. Read `physics` first.

physics         `Physics`: steps, resets, states
binding         what `physics.bind` returns; `elements` says where an element is in the model
forward_cache   when MuJoCo has to compute anew what depends on the state
rendering       pictures
"""
