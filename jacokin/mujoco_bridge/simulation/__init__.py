"""The compiled scene: bindings of elements, forward passes, steps, pictures. Read `physics` first.

physics     `Physics`: steps, resets, states
binding     what `physics.bind` returns, and when MuJoCo has to compute anew what depends on the state
elements    where an element is in the model
rendering   pictures
"""
