"""Kernels: plain functions on arrays, compiled to one library when the package is built. Read `closed_form/pose` first.

They take numbers and arrays, no robot and no file. C programs reach them through the files in the folder ``c``.

closed_form                          every branch of a six-joint Jaco at a pose
six_joints                           every branch of a six-joint arm of any structure
solution_set                         sets of solutions with one parameter
contact                              contact, distances and certain motions of an arm among obstacles
free_motion                          ways around what blocks a straight joint motion
clear_targets                        many targets, each answered by the nearest branch clear of contact
configurations                       poses, Jacobians, torques and mass matrices of many configurations
closest                              what comes closest to a target that is not reached
few_joints                           configurations of three to five joints from those of a chain of six
rung_links                           which solutions of neighbouring places of a path follow each other
speeds, course_times, motion_rows    the least time along a path, and along lines and parabolas; the rows of a motion
rest_to_rest                         the least time from rest to rest, with limits of jerk
tracking                             ticks of the tracker
branches                             a branch verified, polished, put within the limits; duplicates
entries, library                     what is compiled; the library loaded and called
vector, symmetric, trigonometry, chain, limits, tolerances
                                     what they have in common
"""
