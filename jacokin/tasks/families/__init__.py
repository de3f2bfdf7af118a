"""The tasks, in modules by what is to be done. Read `reach` first.

reach    the hand is to be at a place
lift     a prop is to be lifted
place    a brick is to be put on a pedestal
bricks   bricks are to be stacked or taken apart and stacked anew
"""
