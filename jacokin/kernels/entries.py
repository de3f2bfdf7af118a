"""The kernels that can be called as machine code: each a function of work arrays that returns an integer.

`build_kernels` compiles them with all they call; `library.Call` runs them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from jacokin.kernels.clear_targets import make_clear_work, solve_clear_targets
from jacokin.kernels.closed_form.batch import make_target_work, solve_targets
from jacokin.kernels.closest import find_closest, make_closest_work
from jacokin.kernels.configurations.dynamics import (
    find_mass_matrices,
    find_torques,
    make_mass_work,
    make_torque_work,
)
from jacokin.kernels.configurations.kinematics import make_frame_work, place_frames
from jacokin.kernels.contact.between import check_between, make_check_work
from jacokin.kernels.contact.cloud_tree import build_cloud, make_cloud_tree
from jacokin.kernels.contact.near_points import find_near_points, make_near_work
from jacokin.kernels.contact.run import make_contact_work, run_contact
from jacokin.kernels.contact.world import build_world, make_world_work
from jacokin.kernels.course_times import fit_course_times, make_course_work
from jacokin.kernels.few_joints import make_few_work, take_few
from jacokin.kernels.free_motion.run import make_motion_work, run_free_motion
from jacokin.kernels.motion_rows import average_rows, look_between, make_average_work, make_between_work
from jacokin.kernels.rest_to_rest import fit_rest_to_rest, make_rest_work
from jacokin.kernels.rung_links import link_rungs, make_link_work
from jacokin.kernels.six_joints.ranking import make_rank_work, rank_labellings
from jacokin.kernels.solution_set.nearest import find_nearest, find_point, make_nearest_work, make_point_work
from jacokin.kernels.solution_set.run import make_set_work, solve_set
from jacokin.kernels.speeds import fit_speeds, make_speed_work
from jacokin.kernels.tracking.reach import make_reach_work, try_reach
from jacokin.kernels.tracking.run import make_run_work, run_tick


class Entry(NamedTuple):
    """One kernel of the library; its name there is that of the function."""

    run: Callable[[Any], int]
    make_work: Callable[[], tuple[Any, ...]]  # an array of length 0 may have any length in a call


ENTRIES = (
    Entry(solve_targets, make_target_work),
    Entry(rank_labellings, make_rank_work),
    Entry(run_contact, make_contact_work),
    Entry(build_cloud, make_cloud_tree),
    Entry(build_world, make_world_work),
    Entry(find_near_points, make_near_work),
    Entry(run_free_motion, make_motion_work),
    Entry(solve_clear_targets, make_clear_work),
    Entry(link_rungs, make_link_work),
    Entry(fit_speeds, make_speed_work),
    Entry(fit_course_times, make_course_work),
    Entry(average_rows, make_average_work),
    Entry(look_between, make_between_work),
    Entry(check_between, make_check_work),
    Entry(fit_rest_to_rest, make_rest_work),
    Entry(find_closest, make_closest_work),
    Entry(run_tick, make_run_work),
    Entry(try_reach, make_reach_work),
    Entry(solve_set, make_set_work),
    Entry(find_point, make_point_work),
    Entry(find_nearest, make_nearest_work),
    Entry(take_few, make_few_work),
    Entry(place_frames, make_frame_work),
    Entry(find_torques, make_torque_work),
    Entry(find_mass_matrices, make_mass_work),
)
